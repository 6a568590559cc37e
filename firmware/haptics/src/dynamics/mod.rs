//! Motion of the held part: mass properties, coupling to the handle, the implicit step, limits on the handle's wrench.

pub(crate) mod body;
pub(crate) mod contact_force;
pub(crate) mod coupling;
pub(crate) mod force;
pub(crate) mod friction;
pub(crate) mod limits;
pub(crate) mod step;
pub(crate) mod system;

//! Energy at the handle: observer and valve of the coupling, and the bound on what constraint targets deliver to the hand.

pub(crate) mod energy_bound;
mod quantised_work;
pub(crate) mod tank;

//! Constraint targets: alignment errors, saturating springs, engagement, and the gaps between guided faces.

mod alignment;
mod fit;
pub(crate) mod geometric_energy;
pub(crate) mod saturating_spring;
pub(crate) mod targets;

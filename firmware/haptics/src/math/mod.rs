//! Mathematics: rigid motions, small linear algebra, and scalars. Imports nothing of the crate.

pub(crate) mod pose;
pub mod rotation;
pub(crate) mod scalar;
pub(crate) mod symmetric6;
pub(crate) mod vector;

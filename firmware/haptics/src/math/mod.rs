//! Rigid motions, small linear algebra, and single numbers. Imports nothing of the crate.

pub(crate) mod pose;
pub mod rotation;
pub(crate) mod scalar;
pub(crate) mod symmetric6;
pub(crate) mod vector;

//! The textbook's methods, kept for comparison: contact of points with voxels, and explicit integration.

pub(crate) mod explicit;
pub(crate) mod occupancy;

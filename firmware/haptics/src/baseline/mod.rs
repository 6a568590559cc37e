//! The textbook's methods, kept to be compared with: contact of points with voxels, and explicit integration.

pub(crate) mod explicit;
pub(crate) mod occupancy;

//! Placement of a part and its bounding sphere.

use glam::Vec3;

use crate::math::pose::Pose;

/// A part at its placement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub pose: Pose,
    /// Bounding sphere, world, m.
    pub center: Vec3,
    pub radius: f32,
    /// Centre of the sphere in the shape frame, m.
    pub local_center: Vec3,
}

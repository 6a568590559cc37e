//! Where a part stands.

use glam::Vec3;

use crate::math::pose::Pose;

/// A part where it stands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub pose: Pose,
    /// Sphere about it, world.
    pub center: Vec3,
    pub radius: f32,
    /// Sphere centre in the shape frame.
    pub local_center: Vec3,
}

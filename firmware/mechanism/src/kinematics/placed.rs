//! Result of a mechanism's own kinematics, before its mount and wrist.

use glam::{Mat3, Quat, Vec3};

/// Handle pose and derivatives from a mechanism's own joints, in its own frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub position: Vec3,
    /// ∂p/∂θ, columns by joint; zero for absent joints.
    pub linear: Mat3,
    /// Orientation of the link that carries the wrist.
    pub link: Quat,
    /// Angular velocity of that link for each joint's rate.
    pub angular: Mat3,
}

//! Pose, velocity and wrench of a rigid body on the wire.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A rigid pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct WirePose {
    /// Position, m.
    pub position: [f32; 3],
    /// Unit quaternion x, y, z, w.
    pub orientation: [f32; 4],
}

/// Force and torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct WireWrench {
    /// Force, N.
    pub force: [f32; 3],
    /// Torque, N·m.
    pub torque: [f32; 3],
}

/// Velocity of a rigid body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct WireTwist {
    /// Linear velocity, m/s.
    pub linear: [f32; 3],
    /// Angular velocity, rad/s.
    pub angular: [f32; 3],
}

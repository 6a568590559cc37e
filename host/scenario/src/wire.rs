//! Poses and vectors of telemetry in double precision.

use glam::{DAffine3, DQuat, DVec3};
use mortise_protocol::message::WirePose;

/// A wire pose in millimetres.
pub fn pose_mm(pose: &WirePose) -> DAffine3 {
    let [x, y, z] = pose.position.map(f64::from);
    let [i, j, k, w] = pose.orientation.map(f64::from);
    DAffine3::from_rotation_translation(
        DQuat::from_xyzw(i, j, k, w).normalize(),
        1e3 * DVec3::new(x, y, z),
    )
}

/// A wire vector, in its own unit.
pub fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

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

/// A pose in millimetres for the wire.
pub(crate) fn to_wire(pose: &DAffine3) -> WirePose {
    wire_pose(pose.translation, DQuat::from_mat3(&pose.matrix3).normalize())
}

/// A position, mm, and an orientation for the wire.
pub(crate) fn wire_pose(position_mm: DVec3, orientation: DQuat) -> WirePose {
    WirePose {
        position: (1e-3 * position_mm).as_vec3().to_array(),
        orientation: orientation.as_quat().to_array(),
    }
}

/// A wire vector, in its own unit.
pub fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

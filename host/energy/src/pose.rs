//! Poses beside a pose.

use glam::{DAffine3, DQuat, DVec3};

/// A pose moved by `by` and turned by the rotation vector `turn` (rad) about `about`; lengths in the poses' unit.
pub fn moved(pose: &DAffine3, by: DVec3, turn: DVec3, about: DVec3) -> DAffine3 {
    DAffine3::from_translation(about + by)
        * DAffine3::from_quat(DQuat::from_scaled_axis(turn))
        * DAffine3::from_translation(-about)
        * *pose
}

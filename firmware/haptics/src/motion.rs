//! Speeds and distances of the held object within one tick.

use glam::Vec3;

use crate::math::pose::Twist;
use crate::math::scalar::inverse_sqrt;

/// Upper bound of the speed of any point within `reach` of the centre of mass, m/s.
pub(crate) fn point_speed(twist: Twist, reach: f32) -> f32 {
    // Rounded up by more than the error of the inverse roots.
    let length = |v: Vec3| {
        let squared = v.length_squared();
        1.000_001 * squared * inverse_sqrt(squared)
    };
    length(twist.linear) + length(twist.angular) * reach
}

/// Scales `twist` so that no point within `reach` is faster than `limit` (m/s). Returns whether it was scaled.
///
/// A scaled motion keeps every linearised gap that the full one keeps, because it ends on the same path.
pub(crate) fn slow_down(twist: &mut Twist, reach: f32, limit: f32) -> bool {
    let speed = point_speed(*twist, reach);
    if speed > limit {
        let scale = limit / speed;
        twist.linear *= scale;
        twist.angular *= scale;
        true
    } else {
        false
    }
}

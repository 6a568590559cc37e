//! Speeds and distances of the held object within one tick.

use glam::Vec3;

use crate::math::pose::Twist;
use crate::math::scalar::inverse_sqrt;

/// Upper bound of the speed of any point within `reach` of the centre of mass, m/s.
pub(crate) fn point_speed(twist: Twist, reach: f32) -> f32 {
    // No less than the lengths, by more than rounding can make the roots too small.
    let length = |v: Vec3| {
        let squared = v.length_squared();
        1.000_001 * squared * inverse_sqrt(squared)
    };
    length(twist.linear) + length(twist.angular) * reach
}

/// Scales `twist` so that no point within `reach` is faster than `most`; whether it had to.
///
/// A scaled motion keeps every linearised gap that the full one keeps: it stops part of the way.
pub(crate) fn slow_down(twist: &mut Twist, reach: f32, most: f32) -> bool {
    let speed = point_speed(*twist, reach);
    if speed > most {
        let scale = most / speed;
        twist.linear *= scale;
        twist.angular *= scale;
        true
    } else {
        false
    }
}

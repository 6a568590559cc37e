//! Yaw at the base, then two links that move in the plane the yaw turns, both driven from the base by wires (WoodenHaptics, Forsslund et al., TEI
//! 2015).
//!
//! θ₂ is the upper link's angle from straight up, θ₃ the lower link's from straight down, both against the frame:
//!
//! ```text
//! r = B sin θ₂ + C sin θ₃,   p = ( r cos θ₁,  r sin θ₁,  A + B cos θ₂ − C cos θ₃ )
//! ```
//!
//! Same form as `computePosition` in forsslund/haptikfabrikenapi.

use glam::{Mat3, Quat, Vec3};
use mortise_protocol::limits::MAX_JOINTS;

use super::placed::Placed;

pub(super) fn place(base_height: f32, upper: f32, lower: f32, angles: [f32; MAX_JOINTS]) -> Placed {
    let (yaw_sin, yaw_cos) = libm::sincosf(angles[0]);
    let (upper_sin, upper_cos) = libm::sincosf(angles[1]);
    let (lower_sin, lower_cos) = libm::sincosf(angles[2]);
    let reach = upper * upper_sin + lower * lower_sin;
    let outward = Vec3::new(yaw_cos, yaw_sin, 0.0);
    let sideways = Vec3::new(-yaw_sin, yaw_cos, 0.0);
    // The lower link turns about −y of the yawed frame.
    let (half_yaw_sin, half_yaw_cos) = libm::sincosf(0.5 * angles[0]);
    let (half_sin, half_cos) = libm::sincosf(-0.5 * angles[2]);
    let link =
        Quat::from_xyzw(0.0, 0.0, half_yaw_sin, half_yaw_cos) * Quat::from_xyzw(0.0, half_sin, 0.0, half_cos);
    Placed {
        position: outward * reach + Vec3::Z * (base_height + upper * upper_cos - lower * lower_cos),
        linear: Mat3::from_cols(
            sideways * reach,
            outward * (upper * upper_cos) - Vec3::Z * (upper * upper_sin),
            outward * (lower * lower_cos) + Vec3::Z * (lower * lower_sin),
        ),
        link,
        angular: Mat3::from_cols(Vec3::Z, Vec3::ZERO, -sideways),
    }
}

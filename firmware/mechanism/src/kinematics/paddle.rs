//! One joint: p = r·(cos θ, sin θ, 0), ∂p/∂θ = r·(−sin θ, cos θ, 0).

use glam::{Mat3, Quat, Vec3};
use mortise_protocol::limits::MAX_JOINTS;

use super::placed::Placed;

pub(super) fn place(radius: f32, angles: [f32; MAX_JOINTS]) -> Placed {
    let (sin, cos) = libm::sincosf(angles[0]);
    let (half_sin, half_cos) = libm::sincosf(0.5 * angles[0]);
    Placed {
        position: radius * Vec3::new(cos, sin, 0.0),
        linear: Mat3::from_cols(radius * Vec3::new(-sin, cos, 0.0), Vec3::ZERO, Vec3::ZERO),
        link: Quat::from_xyzw(0.0, 0.0, half_sin, half_cos),
        angular: Mat3::from_cols(Vec3::Z, Vec3::ZERO, Vec3::ZERO),
    }
}

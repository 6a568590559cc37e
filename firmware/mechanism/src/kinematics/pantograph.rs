//! Five links in a plane, as in Hayward's Pantograph: two motors, two elbows, one handle.
//!
//! With motors at (∓base/2, 0) and proximal links l the elbows are E = (∓base/2 + l·cos θ, l·sin θ). The distal links d₁, d₂ meet at
//!
//! ```text
//! e = (E₂ − E₁)/D,  D = |E₂ − E₁|,  a = (d₁² − d₂² + D²)/(2D),  h² = d₁² − a²,  p = E₁ + a·e + h·e⊥
//! ```
//!
//! with e⊥ to the left of e. The distal links have constant length: u·∂p/∂θ = u·∂E/∂θ with u = p − E for each side, two equations for each column of
//! J: ∂p/∂θ₁ = (u₁·t₁)/(u₁ × u₂)·(u₂y, −u₂x), ∂p/∂θ₂ = (u₂·t₂)/(u₁ × u₂)·(−u₁y, u₁x), t = ∂E/∂θ. u₁ × u₂ vanishes where the distal links are
//! collinear.

use glam::{Mat3, Quat, Vec2, Vec3};
use mortise_protocol::limits::MAX_JOINTS;

use super::placed::Placed;

/// The distal links are treated as collinear when the handle is nearer to the line of the elbows than this share of a link: 0.06°.
const FLAT: f32 = 1e-3;

pub(super) fn place(
    base: f32,
    proximal: [f32; 2],
    distal: [f32; 2],
    angles: [f32; MAX_JOINTS],
) -> Option<Placed> {
    let side = |number: usize, x: f32| {
        let (sin, cos) = libm::sincosf(angles[number]);
        let length = proximal[number];
        let elbow = Vec2::new(x + length * cos, length * sin);
        (elbow, length * Vec2::new(-sin, cos))
    };
    let (left, left_moves) = side(0, -0.5 * base);
    let (right, right_moves) = side(1, 0.5 * base);
    let between = right - left;
    let distance = libm::sqrtf(between.length_squared());
    let least = FLAT * distal[0].min(distal[1]);
    if distance < least {
        return None;
    }
    let along = between / distance;
    let (d1, d2) = (distal[0], distal[1]);
    let a = (d1 * d1 - d2 * d2 + distance * distance) / (2.0 * distance);
    let height2 = d1 * d1 - a * a;
    if height2 < least * least {
        return None;
    }
    let handle = left + along * a + Vec2::new(-along.y, along.x) * libm::sqrtf(height2);
    let (u1, u2) = (handle - left, handle - right);
    let area = u1.perp_dot(u2);
    let first = Vec2::new(u2.y, -u2.x) * (u1.dot(left_moves) / area);
    let second = Vec2::new(-u1.y, u1.x) * (u2.dot(right_moves) / area);
    // The left distal link carries the wrist: its direction u₁ turns at (u₁ × u̇₁)/d₁².
    let turns = |moves: Vec2| Vec3::Z * (u1.perp_dot(moves) / (d1 * d1));
    let (half_sin, half_cos) = libm::sincosf(0.5 * libm::atan2f(u1.y, u1.x));
    Some(Placed {
        position: handle.extend(0.0),
        linear: Mat3::from_cols(first.extend(0.0), second.extend(0.0), Vec3::ZERO),
        link: Quat::from_xyzw(0.0, 0.0, half_sin, half_cos),
        angular: Mat3::from_cols(turns(first - left_moves), turns(second), Vec3::ZERO),
    })
}

//! Conversion between rotation vectors (axis · angle, rad) and unit quaternions, for the range each side needs.
//!
//! Series in the squared angle instead of library sines: they need neither a square root nor double precision, which a Cortex-M7 built for single
//! precision would do in software.

use glam::{Quat, Vec3};

use crate::math::pose::renormalize;

/// Longest rotation vector within the accuracy of [`exp`], rad.
pub const EXP_MAX: f32 = core::f32::consts::PI;

/// Angle past half a turn up to which [`log_continuous`] keeps its branch, rad.
pub const BRANCH_HYSTERESIS: f32 = 0.3;

/// Unit quaternion of rotation vector `phi` (rad), `|phi| ≤ EXP_MAX`.
///
/// With x = |φ|/2 ≤ π/2 the first omitted term of sin(x)/x is x¹²/13! < 4·10⁻⁸, of cos(x) x¹⁴/14! < 7·10⁻⁹.
#[inline]
pub fn exp(phi: Vec3) -> Quat {
    let x2 = 0.25 * phi.length_squared();
    let sinc = 1.0
        - x2 * (1.0 / 6.0)
            * (1.0
                - x2 * (1.0 / 20.0)
                    * (1.0 - x2 * (1.0 / 42.0) * (1.0 - x2 * (1.0 / 72.0) * (1.0 - x2 * (1.0 / 110.0)))));
    let cos = 1.0
        - x2 * 0.5
            * (1.0
                - x2 * (1.0 / 12.0)
                    * (1.0
                        - x2 * (1.0 / 30.0)
                            * (1.0
                                - x2 * (1.0 / 56.0)
                                    * (1.0 - x2 * (1.0 / 90.0) * (1.0 - x2 * (1.0 / 132.0))))));
    let v = phi * (0.5 * sinc);
    renormalize(Quat::from_xyzw(v.x, v.y, v.z, cos))
}

/// Rotation vector (rad) of unit quaternion `q`, on the branch that continues `previous`.
///
/// The shorter rotation is taken, except within [`BRANCH_HYSTERESIS`] past half a turn from `previous`: there the vector keeps its direction, so that
/// noise about half a turn cannot flip the torque back and forth. Relative error < 10⁻⁶.
#[inline]
pub fn log_continuous(q: Quat, previous: Vec3) -> Vec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let v = Vec3::new(q.x, q.y, q.z);
    let n2 = v.length_squared();
    if n2 < 0.01 {
        // 2·asin(n)/n in n²; the first omitted term is 2·(105/3456)·n⁸ < 10⁻⁹.
        return v * (2.0 * (1.0 + n2 * (1.0 / 6.0 + n2 * (3.0 / 40.0 + n2 * (15.0 / 336.0)))));
    }
    let n = libm::sqrtf(n2);
    let angle = 2.0 * libm::atan2f(n, q.w);
    let short = v * (angle / n);
    let past = core::f32::consts::PI - angle;
    if past < BRANCH_HYSTERESIS && previous.dot(short) < 0.0 && previous.length_squared() > 1.0 {
        v * ((angle - 2.0 * core::f32::consts::PI) / n)
    } else {
        short
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quat(axis: Vec3, angle: f32) -> Quat {
        Quat::from_axis_angle(axis, angle)
    }

    #[test]
    fn exp_agrees_with_the_library_up_to_half_a_turn() {
        let axis = Vec3::new(0.36, 0.48, 0.8);
        for i in 0..=1000 {
            let angle = EXP_MAX * i as f32 / 1000.0;
            let (a, b) = (exp(axis * angle), quat(axis, angle));
            // Four roundings of 6·10⁻⁸ in each of the two.
            assert!((a - b).length() < 5e-7, "{angle}: {a} {b}");
        }
    }

    #[test]
    fn log_inverts_exp() {
        let axis = Vec3::new(-0.6, 0.0, 0.8);
        for i in 0..1000 {
            let angle = 3.1 * i as f32 / 1000.0;
            let back = log_continuous(exp(axis * angle), Vec3::ZERO);
            // Near half a turn w is small and its rounding of 6·10⁻⁸ counts fourfold in the angle.
            assert!((back - axis * angle).length() < 1.5e-6, "{angle}: {back}");
        }
    }

    #[test]
    fn log_does_not_flip_just_past_half_a_turn() {
        let axis = Vec3::Z;
        let mut previous = Vec3::ZERO;
        for i in 0..330 {
            let angle = 0.01 * i as f32;
            previous = log_continuous(quat(axis, angle), previous);
            assert!((previous.z - angle).abs() < 1e-5, "{angle}: {previous}");
        }
        // Beyond the hysteresis (π + 0.3) the shorter rotation is taken.
        let far = log_continuous(quat(axis, 3.6), previous);
        assert!(far.z < 0.0);
    }
}

//! A serial arm with three joints: yaw at the base, then two links that move in the plane the yaw turns.
//!
//! Joint angles θ = (θ_A, θ_B, θ_C), rad. θ_A turns the whole arm about the vertical z axis. θ_B is the upper link's angle from straight
//! up, θ_C the lower link's angle from straight down; both are measured against the frame, not against each other, because both motors sit
//! on the base and drive the links by wires (WoodenHaptics, Forsslund et al., TEI 2015). With link lengths B and C, base height A and
//! workspace centre o, the handle is at
//!
//! ```text
//! r = B sin θ_B + C sin θ_C
//! p = ( r cos θ_A,  r sin θ_A,  A + B cos θ_B − C cos θ_C ) − o        (x forward, y left, z up; m)
//! ```
//!
//! Same form as `computePosition` in forsslund/haptikfabrikenapi. The handle turns freely in an unsensed gimbal: three force axes, no
//! torque axes. Cost: three sine–cosine pairs a tick, shared by position, velocity and torque.

use glam::{Mat3, Vec3};

/// Lengths of the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// Height of the shoulder over the base, m.
    pub base_height: f32,
    /// Length of the upper link, m.
    pub upper: f32,
    /// Length of the lower link, m.
    pub lower: f32,
    /// Centre of the workspace over the base, m: the world's origin.
    pub origin: Vec3,
}

/// The arm in one posture: its angles' sines and cosines, computed once a tick.
#[derive(Clone, Copy, Debug)]
pub struct Posture {
    arm: Arm,
    yaw: (f32, f32),
    upper: (f32, f32),
    lower: (f32, f32),
}

impl Arm {
    /// The posture at these joint angles θ_A, θ_B, θ_C, rad.
    pub fn posture(self, angles: Vec3) -> Posture {
        Posture {
            arm: self,
            yaw: libm::sincosf(angles.x),
            upper: libm::sincosf(angles.y),
            lower: libm::sincosf(angles.z),
        }
    }
}

impl Posture {
    /// Distance of the handle from the yaw axis, m; negative behind it.
    fn reach(&self) -> f32 {
        self.arm.upper * self.upper.0 + self.arm.lower * self.lower.0
    }

    /// Handle in the world, m.
    pub fn position(&self) -> Vec3 {
        let reach = self.reach();
        let height = self.arm.base_height + self.arm.upper * self.upper.1 - self.arm.lower * self.lower.1;
        Vec3::new(reach * self.yaw.1, reach * self.yaw.0, height) - self.arm.origin
    }

    /// J = ∂p/∂θ, m/rad; columns belong to θ_A, θ_B, θ_C.
    pub fn jacobian(&self) -> Mat3 {
        let (sin_yaw, cos_yaw) = self.yaw;
        let reach = self.reach();
        let upper = self.arm.upper * self.upper.1;
        let lower = self.arm.lower * self.lower.1;
        Mat3::from_cols(
            Vec3::new(-reach * sin_yaw, reach * cos_yaw, 0.0),
            Vec3::new(upper * cos_yaw, upper * sin_yaw, -self.arm.upper * self.upper.0),
            Vec3::new(lower * cos_yaw, lower * sin_yaw, self.arm.lower * self.lower.0),
        )
    }

    /// Velocity of the handle, v = J θ̇, m/s, from joint rates, rad/s.
    pub fn velocity(&self, rates: Vec3) -> Vec3 {
        self.jacobian() * rates
    }

    /// Joint torques that make the handle push with `force` (N, world), τ = Jᵀ F, N·m. Needs no inverse, so it is bounded by
    /// |F| times the arm's length in every posture, singular ones included.
    pub fn torques(&self, force: Vec3) -> Vec3 {
        self.jacobian().transpose() * force
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::rig::RIG;

    fn angles() -> impl Strategy<Value = Vec3> {
        (-1.5f32..1.5, -1.2f32..1.5, -0.5f32..2.0).prop_map(|(a, b, c)| Vec3::new(a, b, c))
    }

    fn vector(size: f32) -> impl Strategy<Value = Vec3> {
        (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    /// The formula of the module's head in double precision.
    fn exact(arm: Arm, angles: Vec3) -> [f64; 3] {
        let (a, b, c) = (f64::from(angles.x), f64::from(angles.y), f64::from(angles.z));
        let (upper, lower) = (f64::from(arm.upper), f64::from(arm.lower));
        let reach = upper * libm::sin(b) + lower * libm::sin(c);
        [
            reach * libm::cos(a) - f64::from(arm.origin.x),
            reach * libm::sin(a) - f64::from(arm.origin.y),
            f64::from(arm.base_height) + upper * libm::cos(b)
                - lower * libm::cos(c)
                - f64::from(arm.origin.z),
        ]
    }

    #[test]
    fn upper_link_up_and_lower_link_level_is_a_right_angle() {
        let arm = RIG.arm;
        let position = arm
            .posture(Vec3::new(0.0, 0.0, core::f32::consts::FRAC_PI_2))
            .position();
        let expected = Vec3::new(arm.lower, 0.0, arm.base_height + arm.upper) - arm.origin;
        // Three roundings of numbers under 0.5 m: 3 · 2⁻²⁵ m < 0.1 µm.
        assert!((position - expected).length() < 1e-7, "{position} {expected}");
    }

    proptest! {
        /// Single precision keeps the handle within 1 µm of the formula: values stay under 0.6 m, where half an ulp is 0.03 µm,
        /// and fewer than ten roundings add up on each axis.
        #[test]
        fn position_is_the_formula(angles in angles()) {
            let position = RIG.arm.posture(angles).position();
            for (found, exact) in position.to_array().iter().zip(exact(RIG.arm, angles)) {
                prop_assert!((f64::from(*found) - exact).abs() < 0.6e-6, "{found} {exact}");
            }
        }

        /// J against the central difference of the formula in double precision: with a step of 1e-5 rad the difference is off by
        /// h²/6 times the third derivative (under 0.5 m) ≈ 1e-11 plus rounding 1e-16/1e-5 = 1e-11; J itself by single-precision rounding, under 1e-6 m/rad.
        #[test]
        fn jacobian_is_the_derivative(angles in angles()) {
            let jacobian = RIG.arm.posture(angles).jacobian();
            let step = 1e-5f64;
            for joint in 0..3 {
                let at = |delta: f64| {
                    let arm = RIG.arm;
                    let mut q = [f64::from(angles.x), f64::from(angles.y), f64::from(angles.z)];
                    q[joint] += delta;
                    let (upper, lower) = (f64::from(arm.upper), f64::from(arm.lower));
                    let reach = upper * libm::sin(q[1]) + lower * libm::sin(q[2]);
                    [
                        reach * libm::cos(q[0]),
                        reach * libm::sin(q[0]),
                        upper * libm::cos(q[1]) - lower * libm::cos(q[2]),
                    ]
                };
                let (ahead, behind) = (at(step), at(-step));
                for axis in 0..3 {
                    let slope = (ahead[axis] - behind[axis]) / (2.0 * step);
                    let found = f64::from(jacobian.col(joint)[axis]);
                    prop_assert!((found - slope).abs() < 1e-6, "joint {joint} axis {axis}: {found} {slope}");
                }
            }
        }

        /// Virtual work: τ·θ̇ = F·v whatever the posture. Both sides are sums of nine products under 0.5 · 20 · 10 = 100 W with a relative rounding
        /// of about 2⁻²² each: under 1 mW together.
        #[test]
        fn torques_do_the_work_of_the_force(angles in angles(), rates in vector(10.0), force in vector(20.0)) {
            let posture = RIG.arm.posture(angles);
            let joints = posture.torques(force).dot(rates);
            let handle = force.dot(posture.velocity(rates));
            prop_assert!((joints - handle).abs() < 1e-3, "{joints} W against {handle} W");
        }

        /// No posture asks for more torque than force times the longest lever of each joint.
        #[test]
        fn torques_are_bounded_in_singular_postures(yaw in -1.5f32..1.5, fold in -1.5f32..1.5, force in vector(20.0)) {
            // θ_C = θ_B + π: both links in one line, det J = 0.
            let posture = RIG.arm.posture(Vec3::new(yaw, fold, fold + core::f32::consts::PI));
            let torques = posture.torques(force);
            let levers = Vec3::new(RIG.arm.upper + RIG.arm.lower, RIG.arm.upper, RIG.arm.lower);
            for joint in 0..3 {
                prop_assert!(torques[joint].abs() <= force.length() * levers[joint] * 1.000_001);
            }
        }
    }
}

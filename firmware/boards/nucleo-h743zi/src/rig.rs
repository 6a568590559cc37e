//! The mechanism this firmware is compiled for: an arm like WoodenHaptics with three encoders and three motors.
//!
//! Lengths, capstans, encoders and torque constants are those of `woodenhaptics_v2015` in forsslund/haptikfabrikenapi
//! (`haptikfabrikenapi.h`, read 2025-11). Another arm of the same kind needs another [`RIG`] and nothing else.

use glam::Vec3;
use mortise_mechanism::ceilings::Ceilings;

use crate::drive::{AXES, Driver};
use crate::kinematics::Arm;

/// A rig: lengths, motors, encoders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    /// Lengths.
    pub arm: Arm,
    /// Motors with transmission and driver, joints A, B, C.
    pub drivers: [Driver; AXES],
    /// Encoder counts (all four edges) per motor turn.
    pub counts_per_turn: [f32; AXES],
    /// Encoder counts of each joint in the posture the arm stands in when its reference is set: there is no index pulse.
    pub home_counts: [i32; AXES],
    /// The most its motors and links bear, whatever parameters say.
    pub ceilings: Ceilings,
    /// Fastest joint rate the mechanism can reach, rad/s: what moves faster is an encoder fault.
    pub joint_rate_limit: f32,
}

/// A motor of the 2015 arm: maxon RE 30 behind a 10 mm capstan, and an ESCON 50/5 set to 3 A at 90 % duty and 0 A at 10 %.
const fn motor(drum_m: f32) -> Driver {
    const CAPSTAN_M: f32 = 0.010;
    Driver {
        ratio: CAPSTAN_M / drum_m,
        torque_constant: 0.0259,
        // `motor_and_body_aligned` is false: motor and joint turn the same way in that file's sense of signs.
        reversed: false,
        current_limit: 3.0,
        full_current: 3.0,
        zero_duty: 0.10,
        full_duty: 0.90,
    }
}

/// The compiled rig.
pub const RIG: Rig = Rig {
    arm: Arm {
        base_height: 0.080,
        upper: 0.205,
        lower: 0.245,
        origin: Vec3::new(0.220, 0.0, 0.080),
    },
    drivers: [motor(0.160), motor(0.120), motor(0.120)],
    counts_per_turn: [2000.0; AXES],
    home_counts: [0, 0, 6000],
    ceilings: Ceilings {
        // 3 A · 0.0259 N·m/A · 16 over a lever of 0.22 m is 5.6 N at the centre of the workspace: nothing needs twice as much.
        force_n: 10.0,
        // No torque axes.
        torque_nm: 0.0,
        // Both links in one line end 0.205 + 0.245 − 0.22 = 0.23 m in front of the centre; the home posture is 0.21 m from it.
        workspace_m: 0.25,
        ..Ceilings::LARGEST
    },
    joint_rate_limit: 30.0,
};

impl Rig {
    /// Radians of a joint per encoder count, signed.
    pub fn radians_per_count(&self, axis: usize) -> f32 {
        let driver = &self.drivers[axis];
        let sense = if driver.reversed { -1.0 } else { 1.0 };
        sense * core::f32::consts::TAU * driver.ratio / self.counts_per_turn[axis]
    }

    /// Most counts an encoder can move in `seconds`, rounded up.
    pub fn counts_limit(&self, axis: usize, seconds: f32) -> u16 {
        let counts = self.joint_rate_limit * seconds / self.radians_per_count(axis).abs();
        libm::ceilf(counts) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn home_posture_is_inside_reach_and_in_front() {
        let angles = core::array::from_fn(|axis| RIG.home_counts[axis] as f32 * RIG.radians_per_count(axis));
        let position = RIG.arm.posture(Vec3::from_array(angles)).position();
        // 6000 counts are three motor turns, a quarter turn of a 120 mm drum by a 10 mm capstan: lower link level, upper link up.
        assert!((angles[2] - core::f32::consts::FRAC_PI_2).abs() < 1e-6);
        assert!(
            (position - Vec3::new(0.025, 0.0, 0.205)).length() < 1e-6,
            "{position}"
        );
    }

    #[test]
    fn a_count_is_finer_than_an_eighth_of_a_millimetre_at_the_handle() {
        for axis in 0..AXES {
            let lever = RIG.arm.upper + RIG.arm.lower;
            assert!(RIG.radians_per_count(axis).abs() * lever < 1.25e-4, "axis {axis}");
            // And the limit of a tick lies far from where a 16-bit counter becomes ambiguous.
            assert!((10..=1000).contains(&RIG.counts_limit(axis, 0.001)));
        }
    }
}

//! From joint torques to what the current drivers are told.
//!
//! Each driver (maxon ESCON or the like) regulates its motor's current to a set value given as duty cycle and direction. Duty maps linearly to
//! current between [`Driver::zero_duty`] and [`Driver::full_duty`]; the margins at both ends let a driver tell a broken wire (0 % or 100 %) from a
//! command.

use glam::Vec3;

/// Motors.
pub const AXES: usize = 3;

/// One motor with its transmission and driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Driver {
    /// Joint turn per motor turn (capstan over drum), below 1.
    pub ratio: f32,
    /// Torque constant, N·m/A.
    pub torque_constant: f32,
    /// The motor turns against the joint's positive sense.
    pub reversed: bool,
    /// Largest current commanded, A.
    pub current_limit: f32,
    /// Current at `full_duty`, A.
    pub full_current: f32,
    /// Share of the period that means no current.
    pub zero_duty: f32,
    /// Share of the period that means `full_current`.
    pub full_duty: f32,
}

/// What one driver is told for one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Share of the PWM period the line is high, 0 to 1.
    pub duty: f32,
    /// Level of the direction line.
    pub forward: bool,
}

/// Currents (A, signed in the motor's sense) for these joint torques (N·m).
///
/// When a motor would exceed its limit all three are scaled by one factor: the force on the handle gets weaker but keeps its
/// direction. A torque that is not a number, or leads to none, gives no current at all.
pub fn currents(drivers: &[Driver; AXES], torques: Vec3) -> [f32; AXES] {
    let mut current = [0.0; AXES];
    let mut scale = 1.0f32;
    for axis in 0..AXES {
        let driver = &drivers[axis];
        let sense = if driver.reversed { -1.0 } else { 1.0 };
        // Without losses motor torque = joint torque · (joint turn / motor turn).
        let wanted = sense * torques[axis] * driver.ratio / driver.torque_constant;
        if !wanted.is_finite() {
            return [0.0; AXES];
        }
        if wanted.abs() > driver.current_limit {
            scale = scale.min(driver.current_limit / wanted.abs());
        }
        current[axis] = wanted;
    }
    current.map(|wanted| wanted * scale)
}

impl Driver {
    /// Duty and direction for a current (A). Never outside `zero_duty..=full_duty`; no current when `current` is not a number.
    pub fn setpoint(&self, current: f32) -> Setpoint {
        // `min` alone would turn NaN into full current.
        let share = if current.is_finite() {
            (current.abs() / self.full_current).min(1.0)
        } else {
            0.0
        };
        Setpoint {
            duty: self.zero_duty + share * (self.full_duty - self.zero_duty),
            forward: current >= 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::rig::RIG;

    fn torque() -> impl Strategy<Value = f32> {
        prop_oneof![8 => -10.0f32..10.0, 1 => Just(f32::NAN), 1 => Just(f32::INFINITY), 1 => Just(-f32::MAX)]
    }

    proptest! {
        #[test]
        fn never_beyond_the_limit_and_always_a_duty(x in torque(), y in torque(), z in torque()) {
            let currents = currents(&RIG.drivers, Vec3::new(x, y, z));
            for (current, driver) in currents.into_iter().zip(&RIG.drivers) {
                // The scale is rounded once: one part in 2²³.
                prop_assert!(current.abs() <= driver.current_limit * 1.000_000_2);
                let setpoint = driver.setpoint(current);
                prop_assert!((driver.zero_duty..=driver.full_duty).contains(&setpoint.duty));
            }
        }

        #[test]
        fn saturation_keeps_the_direction(x in -10.0f32..10.0, y in -10.0f32..10.0, z in -10.0f32..10.0) {
            let torques = Vec3::new(x, y, z);
            let found = currents(&RIG.drivers, torques);
            let back = |axis: usize| {
                let driver = &RIG.drivers[axis];
                let sense = if driver.reversed { -1.0 } else { 1.0 };
                sense * found[axis] * driver.torque_constant / driver.ratio
            };
            let produced = Vec3::new(back(0), back(1), back(2));
            // Parallel up to rounding: 5 roundings of 2⁻²⁴ on each factor of products under |a||b|.
            prop_assert!(produced.cross(torques).length() <= 1e-6 * produced.length() * torques.length() + 1e-9);
            prop_assert!(produced.dot(torques) >= 0.0);
            prop_assert!(produced.length() <= torques.length() * 1.000_001);
        }
    }

    #[test]
    fn a_number_that_is_none_gives_no_current() {
        let driver = RIG.drivers[0];
        assert_eq!(currents(&RIG.drivers, Vec3::new(1.0, f32::NAN, 0.0)), [0.0; AXES]);
        assert_eq!(driver.setpoint(f32::NAN).duty, driver.zero_duty);
    }

    #[test]
    fn half_the_full_current_is_half_way_between_the_margins() {
        let driver = RIG.drivers[1];
        let setpoint = driver.setpoint(-driver.full_current / 2.0);
        assert!((setpoint.duty - (driver.zero_duty + driver.full_duty) / 2.0).abs() < 1e-6);
        assert!(!setpoint.forward);
    }
}

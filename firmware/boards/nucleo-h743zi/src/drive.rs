//! From motor currents to what the current drivers are given.
//!
//! Each driver (maxon ESCON or the like) regulates its motor's current to a set value given as duty cycle and direction. Duty maps linearly to
//! current between [`ZERO_DUTY`] and [`FULL_DUTY`]; the margins at both ends let a driver tell a broken wire (0 % or 100 %) from a
//! command. Set every driver to [`FULL_CURRENT_A`] at [`FULL_DUTY`] and no current at [`ZERO_DUTY`].

use mortise_protocol::rig::Rig;

/// Motors the board has outputs for.
pub const AXES: usize = 3;
/// Current at [`FULL_DUTY`], A.
pub const FULL_CURRENT_A: f32 = 3.0;
/// Share of the PWM period that means no current.
pub const ZERO_DUTY: f32 = 0.10;
/// Share of the PWM period that means [`FULL_CURRENT_A`].
pub const FULL_DUTY: f32 = 0.90;

/// What one driver is given for one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Share of the PWM period the line is high, 0 to 1.
    pub duty: f32,
    /// Level of the direction line.
    pub forward: bool,
}

impl Setpoint {
    /// Duty and direction for a current (A). Never outside [`ZERO_DUTY`] to [`FULL_DUTY`]; no current when `current` is not a number.
    pub fn of(current: f32) -> Self {
        // `min` alone would turn NaN into full current.
        let share = if current.is_finite() {
            (current.abs() / FULL_CURRENT_A).min(1.0)
        } else {
            0.0
        };
        Self {
            duty: ZERO_DUTY + share * (FULL_DUTY - ZERO_DUTY),
            forward: current >= 0.0,
        }
    }
}

/// What of a description this board can do: no motor is given more than its driver's full current, so that a force keeps its direction; a wrist is not
/// sensed, because there are inputs for three encoders only.
pub fn fitted(rig: &Rig) -> Rig {
    let mut fitted = rig.clone();
    for joint in &mut fitted.joints {
        joint.current_limit = joint.current_limit.min(FULL_CURRENT_A);
    }
    fitted.wrist = None;
    fitted
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn always_a_duty_within_the_margins(current in any::<f32>()) {
            prop_assert!((ZERO_DUTY..=FULL_DUTY).contains(&Setpoint::of(current).duty));
        }
    }

    #[test]
    fn a_number_that_is_none_gives_no_current() {
        for current in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(Setpoint::of(current).duty, ZERO_DUTY);
        }
    }

    #[test]
    fn half_the_full_current_is_half_way_between_the_margins() {
        let setpoint = Setpoint::of(-FULL_CURRENT_A / 2.0);
        assert!((setpoint.duty - (ZERO_DUTY + FULL_DUTY) / 2.0).abs() < 1e-6);
        assert!(!setpoint.forward);
    }
}

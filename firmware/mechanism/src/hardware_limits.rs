//! Hardware limits: the rig's compiled limits, and their enforcement on a wrench after the force law.
//!
//! Every adjustable limit has a range of its own ([`mortise_protocol::parameter`]). A rig whose motors or links bear less states that here, in its
//! firmware: no message can change these numbers. A parameter beyond its hardware limit is refused with the range that holds on this board, and
//! [`restrain`] limits the wrench once more after everything else, so that an error in the force law or in the settings has no effect beyond these
//! limits.

use glam::Vec3;
use mortise_haptics::{Twist, Wrench};
use mortise_protocol::parameter::ParameterId;
use mortise_protocol::rig::Rig;

/// Hardware limits of one rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HardwareLimits {
    /// Force at the handle, N.
    pub force_n: f32,
    /// Torque at the handle, N·m.
    pub torque_nm: f32,
    /// Rate of change of force, N/s.
    pub force_slew_n_per_s: f32,
    /// Rate of change of torque, N·m/s.
    pub torque_slew_nm_per_s: f32,
    /// Mechanical power into the handle, W.
    pub power_w: f32,
    /// Handle speed, m/s.
    pub speed_m_per_s: f32,
    /// Handle rotation, rad/s.
    pub angular_speed_rad_per_s: f32,
    /// Distance of the handle from the world's origin, m.
    pub workspace_m: f32,
}

impl HardwareLimits {
    /// The largest values any board accepts.
    pub const LARGEST: Self = Self {
        force_n: ParameterId::ForceLimit.row().max,
        torque_nm: ParameterId::TorqueLimit.row().max,
        force_slew_n_per_s: ParameterId::ForceSlew.row().max,
        torque_slew_nm_per_s: ParameterId::TorqueSlew.row().max,
        power_w: ParameterId::PowerLimit.row().max,
        speed_m_per_s: ParameterId::SpeedLimit.row().max,
        angular_speed_rad_per_s: ParameterId::AngularSpeedLimit.row().max,
        workspace_m: ParameterId::WorkspaceRadius.row().max,
    };

    /// The limits of a described rig, none above the firmware's own.
    pub fn of(rig: &Rig) -> Self {
        let own = rig.ceilings;
        Self {
            force_n: Self::LARGEST.force_n.min(own.force),
            power_w: Self::LARGEST.power_w.min(own.power),
            speed_m_per_s: Self::LARGEST.speed_m_per_s.min(own.speed),
            workspace_m: Self::LARGEST.workspace_m.min(own.workspace),
            ..Self::LARGEST
        }
    }

    /// The largest value of a parameter on this rig: the lower of its range's end and the hardware limit.
    pub fn most(&self, id: ParameterId) -> f32 {
        let limit = match id {
            ParameterId::ForceLimit => self.force_n,
            ParameterId::TorqueLimit => self.torque_nm,
            ParameterId::ForceSlew => self.force_slew_n_per_s,
            ParameterId::TorqueSlew => self.torque_slew_nm_per_s,
            ParameterId::PowerLimit => self.power_w,
            ParameterId::SpeedLimit => self.speed_m_per_s,
            ParameterId::AngularSpeedLimit => self.angular_speed_rad_per_s,
            ParameterId::WorkspaceRadius => self.workspace_m,
            _ => f32::INFINITY,
        };
        // A limit that is not a number yields the range's smallest value; `min` would return the larger one.
        if limit >= id.row().min {
            limit.min(id.row().max)
        } else {
            id.row().min
        }
    }

    /// Limits for one tick: the adjustable ones, none above its hardware limit.
    pub fn with(&self, power_w: f32, workspace_m: f32) -> Bounds {
        Bounds {
            force_n: self.most(ParameterId::ForceLimit),
            torque_nm: self.most(ParameterId::TorqueLimit),
            power_w: power_w.min(self.most(ParameterId::PowerLimit)),
            workspace_m: workspace_m.min(self.most(ParameterId::WorkspaceRadius)),
        }
    }
}

/// Limits for one tick, see [`HardwareLimits::with`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    force_n: f32,
    torque_nm: f32,
    power_w: f32,
    workspace_m: f32,
}

/// Whether the handle is outside the workspace.
pub fn is_outside(handle: Vec3, radius_m: f32) -> bool {
    handle.length_squared() > radius_m * radius_m
}

/// The part of `wrench` (world, at the handle's origin) that may reach the motors, with the handle at `handle` moving with `twist`:
///
/// 1. force and torque are limited to their hardware limits;
/// 2. outside the workspace no part of the force points outwards: F − max(0, F·r̂)·r̂;
/// 3. power into the handle, P = F·v + τ·ω, is at most the limit: a wrench above it is scaled by limit/P. A braking wrench is never weakened;
/// 4. a wrench that is not finite becomes zero.
///
/// The power limit is applied last of the three, because cutting a torque that absorbs power could raise the total; its single factor violates
/// neither of the limits before it. Cost: about 60 operations.
pub fn restrain(wrench: Wrench, handle: Vec3, twist: &Twist, bounds: &Bounds) -> Wrench {
    let mut force = wrench.force.clamp_length_max(bounds.force_n);
    let mut torque = wrench.torque.clamp_length_max(bounds.torque_nm);
    if is_outside(handle, bounds.workspace_m) {
        // Scaled first, because the square of a large component overflows.
        let scaled = handle / handle.abs().max_element();
        let outwards = scaled / libm::sqrtf(scaled.length_squared());
        force -= outwards * force.dot(outwards).max(0.0);
    }
    let power = force.dot(twist.linear) + torque.dot(twist.angular);
    // Infinite products may cancel to NaN, which does not compare as within the limit; the share is then zero, and so is the wrench.
    let within = power <= bounds.power_w;
    if !within {
        let share = bounds.power_w / power;
        force *= share;
        torque *= share;
    }
    let out = Wrench { force, torque };
    if out.is_finite() { out } else { Wrench::ZERO }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            8 => -30.0f32..30.0,
            1 => prop::sample::select(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -f32::MAX, 0.0][..]),
        ]
    }

    fn vector() -> impl Strategy<Value = Vec3> {
        (number(), number(), number()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// For any input. One part in 10⁶ for the roundings of scaling, projecting and measuring again.
        #[test]
        fn nothing_beyond_a_bound_gets_through(
            force in vector(), torque in vector(), linear in vector(), angular in vector(), handle in vector(),
        ) {
            let bounds = HardwareLimits { force_n: 8.0, torque_nm: 0.3, ..HardwareLimits::LARGEST }.with(5.0, 0.5);
            let twist = Twist { linear, angular };
            let out = restrain(Wrench { force, torque }, handle, &twist, &bounds);
            prop_assert!(out.is_finite());
            prop_assert!(out.force.length() <= 8.0 * 1.000_001);
            prop_assert!(out.torque.length() <= 0.3 * 1.000_001);
            let power = out.force.dot(linear) + out.torque.dot(angular);
            if linear.is_finite() && angular.is_finite() && linear.length() < 100.0 && angular.length() < 100.0 {
                // A dozen products under 8 N · 52 m/s and 0.3 N·m · 52 rad/s, each with a relative rounding of 2⁻²⁴.
                prop_assert!(power <= 5.0 + 5e-4, "{power} W");
            }
            if handle.is_finite() && handle.length() > 0.5 && handle.length() < 100.0 {
                prop_assert!(out.force.dot(handle.normalize()) <= 1e-4, "{}", out.force.dot(handle.normalize()));
            }
        }

        /// A wrench within every bound is unchanged to the bit.
        #[test]
        fn what_is_allowed_is_not_touched(
            force in prop::array::uniform3(-2.0f32..2.0), linear in prop::array::uniform3(-0.5f32..0.5),
        ) {
            let (force, linear) = (Vec3::from_array(force), Vec3::from_array(linear));
            let twist = Twist { linear, angular: Vec3::ZERO };
            let wrench = Wrench { force, torque: Vec3::new(0.1, 0.0, 0.0) };
            let bounds = HardwareLimits::LARGEST.with(10.0, 1.0);
            prop_assert_eq!(restrain(wrench, Vec3::splat(0.1), &twist, &bounds), wrench);
        }
    }

    #[test]
    fn power_is_cut_when_it_is_given_and_not_when_it_is_taken() {
        let bounds = HardwareLimits::LARGEST.with(5.0, 1.0);
        let twist = Twist {
            linear: Vec3::new(2.0, 0.0, 0.0),
            angular: Vec3::ZERO,
        };
        let pushing = Wrench {
            force: Vec3::new(10.0, 0.0, 0.0),
            torque: Vec3::ZERO,
        };
        // 20 W requested, 5 W allowed.
        assert_eq!(
            restrain(pushing, Vec3::ZERO, &twist, &bounds).force,
            Vec3::new(2.5, 0.0, 0.0)
        );
        let braking = Wrench {
            force: Vec3::new(-10.0, 0.0, 0.0),
            torque: Vec3::ZERO,
        };
        assert_eq!(restrain(braking, Vec3::ZERO, &twist, &bounds), braking);
    }

    #[test]
    fn a_limit_that_is_no_number_allows_the_least() {
        for bad in [f32::NAN, -1.0, f32::NEG_INFINITY] {
            let limits = HardwareLimits {
                force_n: bad,
                ..HardwareLimits::LARGEST
            };
            assert_eq!(
                limits.most(ParameterId::ForceLimit),
                ParameterId::ForceLimit.row().min
            );
        }
    }
}

//! The parameters' values, and the tick's settings, which are derived from them at low priority.

use core::hash::{Hash, Hasher};

use mortise_haptics::{FromParameter, Settings, each_parameter_drives_one_setting, settings_group};
use mortise_mechanism::hardware_limits::HardwareLimits;
use mortise_protocol::message::Refusal;
use mortise_protocol::parameter::{PARAMETERS, ParameterId};

use crate::board::{TICK_HZ, TICK_S};

/// Complete settings of the control plane, replaced as a whole between two ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlSettings {
    /// Settings of the force law.
    pub law: Settings,
    /// Limits beyond which the control plane raises a fault or weakens a wrench.
    pub safety: SafetySettings,
    /// The values these settings were derived from, which a host reads back.
    pub parameters: Parameters,
}

settings_group! {
    /// Limits beyond which the control plane raises a fault or weakens a wrench.
    SafetySettings: "safety" {
        /// Handle speed above which a fault is raised, m/s.
        speed_m_per_s: f32 <- SpeedLimit;
        /// Handle rotation above which a fault is raised, rad/s.
        angular_speed_rad_per_s: f32 <- AngularSpeedLimit;
        /// Power limit into the handle, W.
        power_w: f32 <- PowerLimit;
        /// Distance of the handle from the world's origin above which a fault is raised, m.
        workspace_m: f32 <- WorkspaceRadius;
        /// Ticks without a frame from the host, motors live, after which a fault is raised.
        host_timeout: Ticks <- HostTimeout;
    }
}

/// A number of ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ticks(pub u32);

impl FromParameter for Ticks {
    /// The whole ticks in this many seconds.
    fn from_parameter(value: f32) -> Self {
        Self((value * f32::from(TICK_HZ)) as u32)
    }
}

// A parameter without a setting, or with two, does not compile.
const _: () = assert!(each_parameter_drives_one_setting(&[
    Settings::PARAMETERS,
    &[SafetySettings::PARAMETERS]
]));

impl SafetySettings {
    /// With these nothing could stay armed.
    const NOTHING_ALLOWED: Self = Self {
        speed_m_per_s: 0.0,
        angular_speed_rad_per_s: 0.0,
        power_w: 0.0,
        workspace_m: 0.0,
        host_timeout: Ticks(0),
    };
}

impl ControlSettings {
    /// The defaults of every parameter on a rig with these hardware limits.
    pub fn at_start(hardware_limits: HardwareLimits) -> Self {
        let parameters = Parameters::within(hardware_limits);
        // The defaults pass their own checks (tested), so the fallback is never used.
        parameters.settings().unwrap_or_else(|_| Self {
            law: Settings::default(),
            safety: SafetySettings::NOTHING_ALLOWED,
            parameters,
        })
    }
}

/// The value of every parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    values: [f32; PARAMETERS.len()],
    hardware_limits: HardwareLimits,
}

impl Default for Parameters {
    /// The defaults on a rig with the largest limits a board accepts.
    fn default() -> Self {
        Self::within(HardwareLimits::LARGEST)
    }
}

impl Parameters {
    /// The defaults, none above this rig's hardware limit.
    pub fn within(hardware_limits: HardwareLimits) -> Self {
        let mut values = [0.0; PARAMETERS.len()];
        for (value, row) in values.iter_mut().zip(PARAMETERS) {
            *value = row.default.min(hardware_limits.most(row.id));
        }
        Self {
            values,
            hardware_limits,
        }
    }

    /// A parameter's value, in its unit.
    pub fn get(&self, id: ParameterId) -> f32 {
        self.values[id as usize]
    }

    /// Adds to `hasher` the values that are not the defaults.
    pub(crate) fn fingerprint(&self, hasher: &mut impl Hasher) {
        for row in PARAMETERS {
            let value = self.get(row.id);
            if value != row.default {
                (row.id, value.to_bits()).hash(hasher);
            }
        }
        // Ends the list.
        PARAMETERS.len().hash(hasher);
    }

    /// This set with one value changed. A value outside its range, above the rig's hardware limit or not a number is refused with the range valid
    /// here.
    pub fn with(mut self, id: ParameterId, value: f32) -> Result<Self, Refusal> {
        let (min, max) = (id.row().min, self.hardware_limits.most(id));
        // A comparison with NaN is false, so NaN is refused too.
        if !(value >= min && value <= max) {
            return Err(Refusal::OutOfRange { id, min, max });
        }
        self.values[id as usize] = value;
        Ok(self)
    }

    /// The settings for these values; fields without a parameter keep the force law's default.
    pub fn settings(&self) -> Result<ControlSettings, Refusal> {
        let mut settings = ControlSettings {
            law: Settings {
                period_s: TICK_S,
                ..Settings::default()
            },
            safety: SafetySettings::default(),
            parameters: *self,
        };
        settings.law.adopt(&|id| self.get(id));
        settings.safety.adopt(&|id| self.get(id));
        settings.law.validate().map_err(|_| Refusal::BadNumber)?;
        Ok(settings)
    }
}

#[cfg(test)]
mod tests {
    use mortise_haptics::Integrator;

    use super::*;

    #[test]
    fn every_parameter_changes_the_settings() {
        let at = |id, value| {
            let parameters = Parameters::default().with(id, value);
            parameters.and_then(|parameters| parameters.settings()).unwrap()
        };
        for row in PARAMETERS {
            let (low, high) = (at(row.id, row.min), at(row.id, row.max));
            assert_ne!((low.law, low.safety), (high.law, high.safety), "{}", row.name);
        }
    }

    #[test]
    fn every_corner_of_every_range_makes_valid_settings() {
        for row in PARAMETERS {
            for value in [row.min, row.default, row.max] {
                let settings = Parameters::default()
                    .with(row.id, value)
                    .and_then(|p| p.settings());
                assert!(settings.is_ok(), "{} = {value}: {settings:?}", row.name);
            }
        }
    }

    #[test]
    fn a_rigs_hardware_limit_is_the_range_that_holds() {
        let hardware_limits = HardwareLimits {
            force_n: 6.0,
            speed_m_per_s: 1.0,
            angular_speed_rad_per_s: 30.0,
            workspace_m: 0.1,
            ..HardwareLimits::LARGEST
        };
        let weak = Parameters::within(hardware_limits);
        let default = ParameterId::ForceLimit.row().default;
        assert!(default > 6.0, "the default itself must be cut");
        for (id, most) in [
            (ParameterId::ForceLimit, 6.0),
            (ParameterId::SpeedLimit, 1.0),
            (ParameterId::AngularSpeedLimit, 30.0),
            (ParameterId::WorkspaceRadius, 0.1),
        ] {
            let min = id.row().min;
            assert_eq!(weak.get(id), most);
            assert!(weak.with(id, most).is_ok());
            let refused = Err(Refusal::OutOfRange { id, min, max: most });
            assert_eq!(weak.with(id, most * 1.001), refused);
            assert_eq!(weak.with(id, f32::NAN), refused);
        }
        assert!(weak.settings().is_ok());
    }

    #[test]
    fn a_board_starts_with_the_force_laws_own_defaults() {
        let started = Parameters::default().settings().map(|settings| settings.law);
        assert_eq!(started, Ok(Settings::default()));
    }

    #[test]
    fn the_integrator_can_be_chosen() {
        for (value, integrator) in [(0.0, Integrator::Implicit), (1.0, Integrator::Explicit)] {
            let settings = Parameters::default()
                .with(ParameterId::Integrator, value)
                .and_then(|p| p.settings());
            assert_eq!(settings.map(|s| s.law.integrator), Ok(integrator));
        }
    }

    #[test]
    fn what_is_outside_is_refused_with_the_range_and_changes_nothing() {
        for row in PARAMETERS {
            let outside = [
                row.min - row.min.abs() * 1e-3 - 1e-3,
                row.max * 1.001,
                f32::NAN,
                f32::INFINITY,
                f32::NEG_INFINITY,
            ];
            for value in outside {
                assert_eq!(
                    Parameters::default().with(row.id, value),
                    Err(Refusal::OutOfRange {
                        id: row.id,
                        min: row.min,
                        max: row.max
                    }),
                    "{} = {value}",
                    row.name
                );
            }
        }
    }
}

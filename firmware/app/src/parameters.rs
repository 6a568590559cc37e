//! The parameters' values, and the tick's settings, which are derived from them at low priority.

use mortise_haptics::{GuidanceMethod, Integrator, Settings};
use mortise_mechanism::ceilings::Ceilings;
use mortise_protocol::message::Refusal;
use mortise_protocol::parameter::{PARAMETERS, ParameterId};

use crate::board::{TICK_HZ, TICK_S};

/// Complete settings of the control plane, replaced as a whole between two ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlSettings {
    /// Settings of the force law.
    pub law: Settings,
    /// Handle speed above which a fault is raised, m/s.
    pub speed_limit_m_per_s: f32,
    /// Handle rotation above which a fault is raised, rad/s.
    pub angular_speed_limit_rad_per_s: f32,
    /// Power limit into the handle, W.
    pub power_limit_w: f32,
    /// Distance of the handle from the world's origin above which a fault is raised, m.
    pub workspace_m: f32,
    /// Ticks without a frame from the host, motors live, after which a fault is raised.
    pub host_timeout_ticks: u32,
    /// The values these settings were derived from, which a host reads back.
    pub parameters: Parameters,
}

/// The value of every parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    values: [f32; PARAMETERS.len()],
    ceilings: Ceilings,
}

impl Default for Parameters {
    /// The defaults on a rig with the largest limits a board accepts.
    fn default() -> Self {
        Self::within(Ceilings::LARGEST)
    }
}

impl Parameters {
    /// The defaults, none above this rig's hardware limit.
    pub fn within(ceilings: Ceilings) -> Self {
        let mut values = [0.0; PARAMETERS.len()];
        for (value, row) in values.iter_mut().zip(PARAMETERS) {
            *value = row.default.min(ceilings.most(row.id));
        }
        Self { values, ceilings }
    }

    /// A parameter's value, in its unit.
    pub fn get(&self, id: ParameterId) -> f32 {
        self.values[id as usize]
    }

    /// This set with one value changed. A value outside its range, above the rig's hardware limit or not a number is refused with the range valid
    /// here.
    pub fn with(mut self, id: ParameterId, value: f32) -> Result<Self, Refusal> {
        let (min, max) = (id.row().min, self.ceilings.most(id));
        // A comparison with NaN is false, so NaN is refused too.
        if !(value >= min && value <= max) {
            return Err(Refusal::OutOfRange { id, min, max });
        }
        self.values[id as usize] = value;
        Ok(self)
    }

    /// The settings for these values; fields without a parameter keep the force law's default.
    pub fn settings(&self) -> Result<ControlSettings, Refusal> {
        use ParameterId as P;
        let mut law = Settings::default();
        law.coupling.k_t_n_per_m = self.get(P::CouplingStiffness);
        law.coupling.b_t = self.get(P::CouplingDamping);
        law.coupling.k_r = self.get(P::CouplingAngularStiffness);
        law.coupling.b_r = self.get(P::CouplingAngularDamping);
        law.coupling.force_max_n = self.get(P::CouplingForce);
        law.coupling.torque_max_nm = self.get(P::CouplingTorque);
        law.contact.stiffness_n_per_m = self.get(P::ContactStiffness);
        law.contact.damping_s = self.get(P::ContactDamping);
        law.contact.point_budget = self.get(P::PointBudget) as u32;
        law.contact.shrinking = self.get(P::Shrinking);
        law.object.mass_kg = self.get(P::ObjectMass);
        law.limits.force_n = self.get(P::ForceLimit);
        law.limits.torque_nm = self.get(P::TorqueLimit);
        law.limits.force_slew_n_per_s = self.get(P::ForceSlew);
        law.limits.torque_slew_nm_per_s = self.get(P::TorqueSlew);
        law.period_s = TICK_S;
        law.integrator = if self.get(P::Integrator) < 0.5 {
            Integrator::Implicit
        } else {
            Integrator::Explicit
        };
        let guidance = self.get(P::Guidance);
        law.guidance.method = if guidance < 0.5 {
            GuidanceMethod::Off
        } else if guidance < 1.5 {
            GuidanceMethod::Capped
        } else {
            GuidanceMethod::Thesis
        };
        law.guidance.exclusions = self.get(P::Joints) >= 0.5;
        law.validate().map_err(|_| Refusal::BadNumber)?;
        Ok(ControlSettings {
            law,
            speed_limit_m_per_s: self.get(P::SpeedLimit),
            angular_speed_limit_rad_per_s: self.get(P::AngularSpeedLimit),
            power_limit_w: self.get(P::PowerLimit),
            workspace_m: self.get(P::WorkspaceRadius),
            host_timeout_ticks: (self.get(P::HostTimeout) * f32::from(TICK_HZ)) as u32,
            parameters: *self,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn a_rigs_ceiling_is_the_range_that_holds() {
        let ceilings = Ceilings {
            force_n: 6.0,
            speed_m_per_s: 1.0,
            angular_speed_rad_per_s: 30.0,
            workspace_m: 0.1,
            ..Ceilings::LARGEST
        };
        let weak = Parameters::within(ceilings);
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

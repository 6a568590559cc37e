//! Settings of the force law, their defaults and ranges.
//!
//! Made and checked at low priority, handed to the tick as finished values. The defaults suit a hand-held part and a handle of about
//! 0.15 kg: an object of 0.1 kg on a coupling of 1 kN/m is critically damped at b = 2·√(k·m) = 20 N s/m.

use core::fmt;

/// All of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Between handle and object.
    pub coupling: CouplingSettings,
    /// Between object and the other parts.
    pub contact: ContactSettings,
    /// At contacts.
    pub friction: FrictionSettings,
    /// The simulated object.
    pub object: ObjectSettings,
    /// How constraint targets guide.
    pub guidance: GuidanceSettings,
    /// How much energy the coupling may make.
    pub passivity: PassivitySettings,
    /// What may reach the motors.
    pub limits: LimitSettings,
    /// Time from tick to tick (h in the notation), s. Default 1 ms.
    pub period_s: f32,
    /// How the object is moved. Default [`Integrator::Implicit`].
    pub integrator: Integrator,
}

/// How the object is moved from tick to tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Backward Euler: stable at any contact stiffness.
    #[default]
    Implicit,
    /// Newton–Euler with forces of the tick's start, eqs. 11–12 of Faas 2010, with its speed limit and pre-contact braking, eqs. 5–6: the
    /// textbook's, which trembles once h²·k/m of all touching points together comes near 4. [`ContactSettings::damping_s`] has no part in it.
    Explicit,
}

/// Virtual coupling, eqs. 1–2 of Faas 2010: F = k_T·d − b_T·v, τ = k_R·θ − b_R·ω, with v and ω of the object relative to the handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingSettings {
    /// k_T, N/m. Stiffer feels crisper and asks more damping of the handle (Colgate–Schenkel: b > k_T·h/2). Default 1000.
    pub k_t_n_per_m: f32,
    /// b_T, N s/m. Default 20.
    pub b_t: f32,
    /// k_R, N m/rad. Default 0.5.
    pub k_r: f32,
    /// b_R, N m s/rad. Default 0.01.
    pub b_r: f32,
    /// The coupling slips beyond this force, N: the object lags and the handle feels no more. Default 10.
    pub force_max_n: f32,
    /// The coupling slips beyond this torque, N m. Default 0.3.
    pub torque_max_nm: f32,
}

/// Contact between points of one part and the field of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSettings {
    /// k of one point, N/m. The implicit step carries 20 kN/m to 2 MN/m and more. Default 200 kN/m.
    pub stiffness_n_per_m: f32,
    /// Cap on the sum of k over all points that touch, N/m: with more points each gets less. It bounds the condition number of the step's
    /// matrix (h²·cap/mass) and is better left high, since a part that lies on many points shares it with the one point at its side.
    /// Default 20 MN/m: a hundred points at the default stiffness.
    pub total_stiffness_n_per_m: f32,
    /// Damping on approach as a ratio of stiffness, s: λ = k·(depth + damping_s · approach speed). Default 0.5 ms.
    pub damping_s: f32,
    /// Points that come this near in a tick, by twice the motion so far or without contacts, are taken into the step, m. Default 5 µm.
    pub margin_m: f32,
    /// Most work a tick, in field look-ups of about 190 instructions: a tree node asked counts 1½, a point out of reach 1, one within the margin 1¾,
    /// one that may touch 3⅛, a solve 8 and 5 more for each target ([`crate::cost`]). Default 520: of the motions measured with up to four targets
    /// none takes more than 125,000 instructions a tick (121,580 with four targets, 123,900 guided and 115,700 unguided into a fit of 0.02 mm).
    pub point_budget: u32,
    /// How far points of the held part are moved inward along their normals before voxmaps are asked, in voxels of that part: the textbook's
    /// pointshell shrinking. Distance fields know no shrinking. Default 0.
    pub shrinking: f32,
}

impl ContactSettings {
    /// Stiffness of each of `touching` points, N/m: that of one, or its share of the total.
    pub(crate) fn shared_stiffness(&self, touching: f32) -> f32 {
        let share = self.total_stiffness_n_per_m / touching;
        if share < self.stiffness_n_per_m {
            share
        } else {
            self.stiffness_n_per_m
        }
    }
}

/// Dry friction at contacts; see `dynamics::friction` in the sources. Off by default: the force law of a fit is smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionSettings {
    /// μ_k, kinetic coefficient. Default 0.
    pub kinetic: f32,
    /// μ_s, static coefficient, at least the kinetic one. Default 0.
    pub fixed: f32,
    /// s_S, speed over which the coefficient falls from static to kinetic, m/s: well above the creep speed. Default 10 mm/s.
    pub stribeck_m_per_s: f32,
    /// ε, speed below which friction is viscous, m/s. Smaller holds better and takes more solves. Default 0.1 mm/s.
    pub creep_m_per_s: f32,
}

impl FrictionSettings {
    /// Whether contacts have no friction.
    pub fn is_off(&self) -> bool {
        self.kinetic == 0.0 && self.fixed == 0.0
    }
}

/// The simulated object: its mass is chosen for the feel, not taken from the CAD part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectSettings {
    /// kg. Default 0.1.
    pub mass_kg: f32,
    /// Lower bound of its radius of gyration, m: keeps slivers from spinning. Default 3 mm.
    pub gyration_min_m: f32,
    /// Upper bound of its largest radius of gyration, m: the inertia of a larger part is scaled down as a whole, so that the rotational
    /// coupling stays as well damped as with a part that fits the hand. Default 20 mm.
    pub gyration_max_m: f32,
    /// No point of the object moves faster, m/s: the object lags a faster handle instead of outrunning the look-ahead. Default 1.
    pub speed_max_m_per_s: f32,
}

/// How constraint targets guide; see `guidance` in the sources.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuidanceSettings {
    /// Default [`GuidanceMethod::Capped`].
    pub method: GuidanceMethod,
    /// Room that contact between guided faces makes, m. Default 0.1 mm.
    pub allowance_m: f32,
    /// τ: time in which the way left falls to 1/e, s. Default 20 ms.
    pub time_s: f32,
    /// Whether mating faces that an engaged target keeps apart leave the work: nothing is felt of it. Default yes.
    pub exclusions: bool,
}

/// How a target pulls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuidanceMethod {
    /// Not at all: what was engaged fades.
    Off,
    /// Stiff up to a cap.
    Capped,
    /// The blend of Faas 2010, for comparison.
    Thesis,
}

/// What the coupling may make of nothing; see `passivity` in the sources.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassivitySettings {
    /// Most energy that the coupling may make and not have dissipated, J; from half of it on the wrench is turned down. 0 switches observer and valve
    /// off. Default 0.5 mJ: a tap of 0.1 kg at 0.1 m/s.
    pub tank_j: f32,
    /// E₀: what targets may give the hand beyond what it has credit_j, J. Infinite: as much as they like, for comparison. Default 8 µJ: of the 10 µJ
    /// that the hand is promised the rest is for what encoders and the coupling make.
    pub initial_budget_j: f32,
    /// The handle's own viscous friction, N s/m, as far as it is certain: what it dissipates may be made. Default 0.
    pub damping: f32,
    /// The same in rotation, N m s/rad. Default 0.
    pub angular_damping: f32,
    /// Whole ticks from a wrench to the motors that give it, at most 4. Default 0: they give it within the period.
    pub delay_ticks: u32,
    /// Counts of the encoders at the handle, m: its position is told within half of this. Default 0: told exactly, or not known.
    pub position_count_m: f32,
    /// The same of its orientation, rad.
    pub angle_count_rad: f32,
}

/// Largest [`PassivitySettings::delay_ticks`].
pub const MAX_DELAY_TICKS: usize = 4;

/// Last limits before the mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitSettings {
    /// Length of the force vector, N. Default 12.
    pub force_n: f32,
    /// Length of the torque vector about the handle's origin, N m. Default 0.5.
    pub torque_nm: f32,
    /// Change of force, N/s. Default 5000 (5 N a tick at 1 kHz).
    pub force_slew_n_per_s: f32,
    /// Change of torque, N m/s. Default 200.
    pub torque_slew_nm_per_s: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            coupling: CouplingSettings {
                k_t_n_per_m: 1000.0,
                b_t: 20.0,
                k_r: 0.5,
                b_r: 0.01,
                force_max_n: 10.0,
                torque_max_nm: 0.3,
            },
            contact: ContactSettings {
                stiffness_n_per_m: 200e3,
                total_stiffness_n_per_m: 20e6,
                damping_s: 0.5e-3,
                margin_m: 5e-6,
                point_budget: 520,
                shrinking: 0.0,
            },
            friction: FrictionSettings {
                kinetic: 0.0,
                fixed: 0.0,
                stribeck_m_per_s: 10e-3,
                creep_m_per_s: 1e-4,
            },
            object: ObjectSettings {
                mass_kg: 0.1,
                gyration_min_m: 3e-3,
                gyration_max_m: 20e-3,
                speed_max_m_per_s: 1.0,
            },
            guidance: GuidanceSettings {
                method: GuidanceMethod::Capped,
                allowance_m: 0.1e-3,
                time_s: 20e-3,
                exclusions: true,
            },
            passivity: PassivitySettings {
                tank_j: 0.5e-3,
                initial_budget_j: 8e-6,
                damping: 0.0,
                angular_damping: 0.0,
                delay_ticks: 0,
                position_count_m: 0.0,
                angle_count_rad: 0.0,
            },
            limits: LimitSettings {
                force_n: 12.0,
                torque_nm: 0.5,
                force_slew_n_per_s: 5000.0,
                torque_slew_nm_per_s: 200.0,
            },
            period_s: 1e-3,
            integrator: Integrator::Implicit,
        }
    }
}

/// Inclusive range of a setting, in the setting's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest value accepted.
    pub min: f32,
    /// Largest value accepted.
    pub max: f32,
}

/// Range of each setting: where the law was tried, not where it would break.
pub mod ranges {
    use super::Range;

    /// [`super::CouplingSettings::k_t_n_per_m`].
    pub const K_T_N_PER_M: Range = Range { min: 0.0, max: 20e3 };
    /// [`super::CouplingSettings::b_t`].
    pub const B_T: Range = Range { min: 0.0, max: 500.0 };
    /// [`super::CouplingSettings::k_r`].
    pub const K_R: Range = Range { min: 0.0, max: 50.0 };
    /// [`super::CouplingSettings::b_r`].
    pub const B_R: Range = Range { min: 0.0, max: 5.0 };
    /// [`super::CouplingSettings::force_max_n`].
    pub const COUPLING_FORCE_MAX_N: Range = Range { min: 0.1, max: 100.0 };
    /// [`super::CouplingSettings::torque_max_nm`].
    pub const COUPLING_TORQUE_MAX_NM: Range = Range {
        min: 0.001,
        max: 10.0,
    };
    /// [`super::ContactSettings::stiffness_n_per_m`].
    pub const STIFFNESS_N_PER_M: Range = Range {
        min: 100.0,
        max: 10e6,
    };
    /// [`super::ContactSettings::total_stiffness_n_per_m`].
    pub const TOTAL_STIFFNESS_N_PER_M: Range = Range {
        min: 1000.0,
        max: 1e9,
    };
    /// [`super::ContactSettings::damping_s`].
    pub const DAMPING_S: Range = Range { min: 0.0, max: 0.01 };
    /// [`super::ContactSettings::margin_m`].
    pub const MARGIN_M: Range = Range { min: 1e-6, max: 1e-3 };
    /// [`super::ContactSettings::point_budget`].
    pub const POINT_BUDGET: Range = Range {
        min: 16.0,
        max: 100_000.0,
    };
    /// [`super::ContactSettings::shrinking`]: beyond a voxel points lie outside of their own voxels, on the wrong side.
    pub const SHRINKING: Range = Range { min: 0.0, max: 1.0 };
    /// [`super::FrictionSettings::kinetic`] and [`super::FrictionSettings::fixed`]; the first must not exceed the second.
    pub const FRICTION: Range = Range { min: 0.0, max: 2.0 };
    /// [`super::FrictionSettings::stribeck_m_per_s`].
    pub const STRIBECK_M_PER_S: Range = Range { min: 1e-4, max: 1.0 };
    /// [`super::FrictionSettings::creep_m_per_s`].
    pub const CREEP_M_PER_S: Range = Range { min: 1e-5, max: 0.01 };
    /// [`super::ObjectSettings::mass_kg`].
    pub const MASS_KG: Range = Range { min: 0.01, max: 10.0 };
    /// [`super::ObjectSettings::gyration_min_m`] and [`super::ObjectSettings::gyration_max_m`]; the first must not exceed the second.
    pub const GYRATION_M: Range = Range { min: 1e-3, max: 1.0 };
    /// [`super::ObjectSettings::speed_max_m_per_s`].
    pub const SPEED_MAX_M_PER_S: Range = Range { min: 0.01, max: 10.0 };
    /// [`super::GuidanceSettings::allowance_m`].
    pub const ALLOWANCE_M: Range = Range { min: 0.0, max: 1e-3 };
    /// [`super::GuidanceSettings::time_s`].
    pub const GUIDANCE_TIME_S: Range = Range { min: 1e-3, max: 1.0 };
    /// [`super::PassivitySettings::tank_j`].
    pub const TANK_J: Range = Range { min: 0.0, max: 0.1 };
    /// [`super::PassivitySettings::damping`].
    pub const HANDLE_DAMPING: Range = Range { min: 0.0, max: 20.0 };
    /// [`super::PassivitySettings::angular_damping`].
    pub const HANDLE_ANGULAR_DAMPING: Range = Range { min: 0.0, max: 0.1 };
    /// [`super::PassivitySettings::delay_ticks`].
    pub const DELAY_TICKS: Range = Range {
        min: 0.0,
        max: super::MAX_DELAY_TICKS as f32,
    };
    /// [`super::PassivitySettings::position_count_m`].
    pub const POSITION_COUNT_M: Range = Range { min: 0.0, max: 1e-3 };
    /// [`super::PassivitySettings::angle_count_rad`].
    pub const ANGLE_COUNT_RAD: Range = Range { min: 0.0, max: 0.1 };
    /// [`super::LimitSettings::force_n`].
    pub const FORCE_N: Range = Range { min: 0.0, max: 100.0 };
    /// [`super::LimitSettings::torque_nm`].
    pub const TORQUE_NM: Range = Range { min: 0.0, max: 10.0 };
    /// [`super::LimitSettings::force_slew_n_per_s`].
    pub const FORCE_SLEW_N_PER_S: Range = Range { min: 1.0, max: 1e6 };
    /// [`super::LimitSettings::torque_slew_nm_per_s`].
    pub const TORQUE_SLEW_NM_PER_S: Range = Range { min: 0.01, max: 1e5 };
    /// [`super::Settings::period_s`].
    pub const PERIOD_S: Range = Range { min: 1e-4, max: 0.02 };
}

/// A setting that was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettingsError {
    /// Its path in [`Settings`], e.g. `coupling.k_t_n_per_m`.
    pub name: &'static str,
    /// The value refused.
    pub value: f32,
    /// What would be accepted.
    pub range: Range,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is {}: choose a value from {} to {}",
            self.name, self.value, self.range.min, self.range.max
        )
    }
}

impl core::error::Error for SettingsError {}

impl Settings {
    /// Checks every number against its range; the first that is outside (or not a number) is named.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let Self {
            coupling,
            contact,
            friction,
            object,
            guidance,
            passivity,
            limits,
            period_s,
            integrator: Integrator::Implicit | Integrator::Explicit,
        } = self;
        let gyration_max = Range {
            min: object.gyration_min_m,
            ..ranges::GYRATION_M
        };
        let fixed = Range {
            min: friction.kinetic,
            ..ranges::FRICTION
        };
        let checks = [
            ("coupling.k_t_n_per_m", coupling.k_t_n_per_m, ranges::K_T_N_PER_M),
            ("coupling.b_t", coupling.b_t, ranges::B_T),
            ("coupling.k_r", coupling.k_r, ranges::K_R),
            ("coupling.b_r", coupling.b_r, ranges::B_R),
            (
                "coupling.force_max_n",
                coupling.force_max_n,
                ranges::COUPLING_FORCE_MAX_N,
            ),
            (
                "coupling.torque_max_nm",
                coupling.torque_max_nm,
                ranges::COUPLING_TORQUE_MAX_NM,
            ),
            (
                "contact.stiffness_n_per_m",
                contact.stiffness_n_per_m,
                ranges::STIFFNESS_N_PER_M,
            ),
            (
                "contact.total_stiffness_n_per_m",
                contact.total_stiffness_n_per_m,
                ranges::TOTAL_STIFFNESS_N_PER_M,
            ),
            ("contact.damping_s", contact.damping_s, ranges::DAMPING_S),
            ("contact.margin_m", contact.margin_m, ranges::MARGIN_M),
            (
                "contact.point_budget",
                contact.point_budget as f32,
                ranges::POINT_BUDGET,
            ),
            ("contact.shrinking", contact.shrinking, ranges::SHRINKING),
            ("friction.kinetic", friction.kinetic, ranges::FRICTION),
            ("friction.fixed", friction.fixed, fixed),
            (
                "friction.stribeck_m_per_s",
                friction.stribeck_m_per_s,
                ranges::STRIBECK_M_PER_S,
            ),
            (
                "friction.creep_m_per_s",
                friction.creep_m_per_s,
                ranges::CREEP_M_PER_S,
            ),
            ("object.mass_kg", object.mass_kg, ranges::MASS_KG),
            ("object.gyration_min_m", object.gyration_min_m, ranges::GYRATION_M),
            ("object.gyration_max_m", object.gyration_max_m, gyration_max),
            (
                "object.speed_max_m_per_s",
                object.speed_max_m_per_s,
                ranges::SPEED_MAX_M_PER_S,
            ),
            ("guidance.allowance_m", guidance.allowance_m, ranges::ALLOWANCE_M),
            ("guidance.time_s", guidance.time_s, ranges::GUIDANCE_TIME_S),
            ("passivity.tank_j", passivity.tank_j, ranges::TANK_J),
            ("passivity.damping", passivity.damping, ranges::HANDLE_DAMPING),
            (
                "passivity.angular_damping",
                passivity.angular_damping,
                ranges::HANDLE_ANGULAR_DAMPING,
            ),
            (
                "passivity.delay_ticks",
                passivity.delay_ticks as f32,
                ranges::DELAY_TICKS,
            ),
            (
                "passivity.position_count_m",
                passivity.position_count_m,
                ranges::POSITION_COUNT_M,
            ),
            (
                "passivity.angle_count_rad",
                passivity.angle_count_rad,
                ranges::ANGLE_COUNT_RAD,
            ),
            ("limits.force_n", limits.force_n, ranges::FORCE_N),
            ("limits.torque_nm", limits.torque_nm, ranges::TORQUE_NM),
            (
                "limits.force_slew_n_per_s",
                limits.force_slew_n_per_s,
                ranges::FORCE_SLEW_N_PER_S,
            ),
            (
                "limits.torque_slew_nm_per_s",
                limits.torque_slew_nm_per_s,
                ranges::TORQUE_SLEW_NM_PER_S,
            ),
            ("period_s", *period_s, ranges::PERIOD_S),
        ];
        for (name, value, range) in checks {
            // NaN compares false and is refused with the rest.
            if !(value >= range.min && value <= range.max) {
                return Err(SettingsError { name, value, range });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_nan_is_not() {
        assert_eq!(Settings::default().validate(), Ok(()));
        let mut s = Settings::default();
        s.coupling.b_t = f32::NAN;
        assert_eq!(s.validate().map_err(|e| e.name), Err("coupling.b_t"));
        let mut s = Settings::default();
        s.object.gyration_max_m = 0.5 * s.object.gyration_min_m;
        assert_eq!(s.validate().map_err(|e| e.name), Err("object.gyration_max_m"));
    }
}

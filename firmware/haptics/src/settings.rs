//! Settings of the force law: each with its meaning, unit, default and range, and the parameter of the protocol that drives it, in one place.
//!
//! Made and checked at low priority, passed to the tick as finished values. A setting that a host can change names its row of the parameter table
//! ([`mortise_protocol::parameter`]) and has its default from there. The defaults suit a hand-held part and a handle of about 0.15 kg: an object of
//! 0.1 kg on a coupling of 1 kN/m is critically damped at b = 2·√(k·m) = 20 N s/m. Ranges cover the values tested, not the limits of stability.

use mortise_protocol::parameter::ParameterId;

use crate::settings_group;
use crate::settings_group::{FromParameter, Range, SettingsError};

/// All settings of the force law.
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
    /// How much energy the coupling may generate.
    pub passivity: PassivitySettings,
    /// Limits on the wrench to the motors.
    pub limits: LimitSettings,
    /// Time from tick to tick (h in the notation), s. Default 1 ms.
    pub period_s: f32,
    /// Integrator of the object's motion. Default [`Integrator::Implicit`].
    pub integrator: Integrator,
}

/// Integrator of the object's motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Backward Euler: stable at any contact stiffness.
    #[default]
    Implicit,
    /// Newton–Euler with forces of the tick's start, eqs. 11–12 of Faas 2010, with its speed limit and pre-contact braking, eqs. 5–6: the
    /// textbook's, which oscillates once h²·k/m of all touching points together comes near 4. [`ContactSettings::damping_s`] has no effect on it.
    Explicit,
}

impl FromParameter for Integrator {
    fn from_parameter(value: f32) -> Self {
        if value < 0.5 {
            Self::Implicit
        } else {
            Self::Explicit
        }
    }
}

settings_group! {
    /// Virtual coupling, eqs. 1–2 of Faas 2010: F = k_T·d − b_T·v, τ = k_R·θ − b_R·ω, with v and ω of the object relative to the handle.
    CouplingSettings: "coupling" {
        /// k_T, N/m. A stiffer coupling feels crisper and needs more damping of the handle (Colgate–Schenkel: b > k_T·h/2).
        k_t_n_per_m: f32 <- CouplingStiffness, 0.0 => 20e3;
        /// b_T, N s/m.
        b_t: f32 <- CouplingDamping, 0.0 => 500.0;
        /// k_R, N m/rad.
        k_r: f32 <- CouplingAngularStiffness, 0.0 => 50.0;
        /// b_R, N m s/rad.
        b_r: f32 <- CouplingAngularDamping, 0.0 => 5.0;
        /// Force at which the coupling saturates, N: beyond it the object lags and the handle feels no more.
        force_max_n: f32 <- CouplingForce, 0.1 => 100.0;
        /// Torque at which the coupling saturates, N m.
        torque_max_nm: f32 <- CouplingTorque, 0.001 => 10.0;
    }
}

settings_group! {
    /// Contact between points of one part and the field of another.
    ContactSettings: "contact" {
        /// k of one point, N/m. The implicit step carries 20 kN/m to 2 MN/m and more.
        stiffness_n_per_m: f32 <- ContactStiffness, 100.0 => 10e6;
        /// Limit of the sum of k over all points that touch, N/m: with more points each gets less. It bounds the condition number of the step's matrix
        /// (h²·limit/mass) and is better left high, because a part that lies on many points shares it with the one point at its side. The default is
        /// a hundred points at the default stiffness.
        total_stiffness_n_per_m: f32 = 20e6, 1000.0 => 1e9;
        /// Damping on approach as a ratio of stiffness, s: λ = k·(depth + damping_s · approach speed).
        damping_s: f32 <- ContactDamping, 0.0 => 0.01;
        /// Distance within which points enter the step, m: by the end of a tick with twice the motion so far, or twice the motion without contacts.
        margin_m: f32 = 5e-6, 1e-6 => 1e-3;
        /// Largest work of a tick, in field queries of about 190 instructions: a tree node queried counts 1½, a point out of reach 1, one within the margin
        /// 1¾, one that may touch 3⅛, a solve 8 and 2½ more for each target ([`crate::cost`]). With the default the ticks of
        /// `mortise-lab figures contact` take 120,000 instructions at most, and those of a crowded assembly (`figures plan`) 220,000.
        point_budget: u32 <- PointBudget, 16 => 100_000;
        /// Distance by which points of the held part are moved inward along their normals for voxmap queries, in voxels of that part: the textbook's
        /// pointshell shrinking. Distance fields have no shrinking. Beyond a voxel points lie outside of their own voxels, on the wrong side.
        shrinking: f32 <- Shrinking, 0.0 => 1.0;
    }
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

settings_group! {
    /// Dry friction at contacts; see `dynamics::friction` in the sources. Off by default: both coefficients are 0.
    FrictionSettings: "friction" {
        /// μ_k, kinetic coefficient.
        kinetic: f32 = 0.0, 0.0 => 2.0;
        /// μ_s, static coefficient, at least the kinetic one.
        fixed: f32 = 0.0, 0.0 => 2.0;
        /// s_S, speed over which the coefficient falls from static to kinetic, m/s: well above the creep speed.
        stribeck_m_per_s: f32 = 10e-3, 1e-4 => 1.0;
        /// ε, speed below which friction is viscous, m/s. A smaller one holds better and takes more solves.
        creep_m_per_s: f32 = 1e-4, 1e-5 => 0.01;
    }
}

impl FrictionSettings {
    /// Whether contacts have no friction.
    pub fn is_off(&self) -> bool {
        self.kinetic == 0.0 && self.fixed == 0.0
    }
}

settings_group! {
    /// The simulated object: its mass is chosen for the feel, not taken from the CAD part.
    ObjectSettings: "object" {
        /// Mass, kg.
        mass_kg: f32 <- ObjectMass, 0.01 => 10.0;
        /// Lower bound of its radius of gyration, m: keeps slivers from spinning. At most the upper one.
        gyration_min_m: f32 = 3e-3, 1e-3 => 1.0;
        /// Upper bound of its largest radius of gyration, m: the inertia of a larger part is scaled down as a whole, so that the rotational
        /// coupling stays as well damped as with a part that fits the hand.
        gyration_max_m: f32 = 20e-3, 1e-3 => 1.0;
        /// Speed limit of every point of the object, m/s: the object lags a faster handle instead of exceeding the look-ahead.
        speed_max_m_per_s: f32 = 1.0, 0.01 => 10.0;
    }
}

settings_group! {
    /// How constraint targets guide; see `constraints` in the sources.
    GuidanceSettings: "guidance" {
        /// Force law of targets.
        method: GuidanceMethod <- Guidance;
        /// Allowance added to gaps between guided faces, m.
        allowance_m: f32 = 0.1e-3, 0.0 => 1e-3;
        /// τ: time in which the remaining distance falls to 1/e, s.
        time_s: f32 = 20e-3, 1e-3 => 1.0;
        /// Whether mating faces that an engaged target keeps apart are excluded from contact: the forces are the same.
        exclusions: bool <- Joints;
        /// Largest force of a geometric energy, N: its depth in joules follows from it.
        geometric_force_n: f32 <- GeometricForce, 0.0 => 10.0;
    }
}

/// How a target pulls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuidanceMethod {
    /// No force: engaged targets fade.
    Off,
    /// Stiff up to a largest force.
    Capped,
    /// The blend of Faas 2010, for comparison.
    Thesis,
    /// The geometric energies of the scene, without targets (Behandish & Ilieş 2015); see `constraints::geometric_energy` in the sources.
    Energy,
}

impl FromParameter for GuidanceMethod {
    fn from_parameter(value: f32) -> Self {
        if value < 0.5 {
            Self::Off
        } else if value < 1.5 {
            Self::Capped
        } else if value < 2.5 {
            Self::Thesis
        } else {
            Self::Energy
        }
    }
}

settings_group! {
    /// How much energy the coupling may generate; see `passivity` in the sources.
    PassivitySettings: "passivity" {
        /// Largest generated energy of the coupling in excess of its dissipation, J; above half of it the wrench is reduced. 0 switches observer and
        /// valve off. The default is the kinetic energy of 0.1 kg at 0.1 m/s.
        tank_j: f32 = 0.5e-3, 0.0 => 0.1;
        /// E₀: energy that targets may deliver to the operator beyond the energy that the operator supplied, J. Infinite: no bound, for comparison. The
        /// rest of the guaranteed 10 µJ is for the energy that encoders and the coupling generate.
        initial_budget_j: f32 = 8e-6;
        /// Lower bound of the handle's own viscous friction, N s/m: the coupling may generate the energy that it dissipates.
        damping: f32 = 0.0, 0.0 => 20.0;
        /// The same in rotation, N m s/rad.
        angular_damping: f32 = 0.0, 0.0 => 0.1;
        /// Whole ticks of delay from a wrench to the motors. 0: they apply it within the period.
        delay_ticks: u32 = 0, 0 => MAX_DELAY_TICKS;
        /// Size of an encoder count at the handle, m: its position is measured within half of this. 0: exact, or unknown.
        position_count_m: f32 = 0.0, 0.0 => 1e-3;
        /// The same for its orientation, rad.
        angle_count_rad: f32 = 0.0, 0.0 => 0.1;
        /// How many times as far as the real handle the one of the tick moves: it may accelerate so many times as fast, and its mass is that of the real
        /// one over the square.
        position_scale: f32 <- PositionScale, 0.1 => 10.0;
    }
}

/// Largest [`PassivitySettings::delay_ticks`].
pub const MAX_DELAY_TICKS: usize = 4;

settings_group! {
    /// Last limits before the mechanism.
    LimitSettings: "limits" {
        /// Length of the force vector, N.
        force_n: f32 <- ForceLimit, 0.0 => 100.0;
        /// Length of the torque vector about the handle's origin, N m.
        torque_nm: f32 <- TorqueLimit, 0.0 => 10.0;
        /// Change of force, N/s.
        force_slew_n_per_s: f32 <- ForceSlew, 1.0 => 1e6;
        /// Change of torque, N m/s.
        torque_slew_nm_per_s: f32 <- TorqueSlew, 0.01 => 1e5;
    }
}

/// Range of [`Settings::period_s`].
const PERIOD_S: Range = Range { min: 1e-4, max: 0.02 };

impl Default for Settings {
    fn default() -> Self {
        Self {
            coupling: CouplingSettings::default(),
            contact: ContactSettings::default(),
            friction: FrictionSettings::default(),
            object: ObjectSettings::default(),
            guidance: GuidanceSettings::default(),
            passivity: PassivitySettings::default(),
            limits: LimitSettings::default(),
            period_s: 1e-3,
            integrator: FromParameter::from_parameter(ParameterId::Integrator.row().default),
        }
    }
}

impl Settings {
    /// Parameters that drive settings, group by group.
    pub const PARAMETERS: &'static [&'static [ParameterId]] = &[
        CouplingSettings::PARAMETERS,
        ContactSettings::PARAMETERS,
        FrictionSettings::PARAMETERS,
        ObjectSettings::PARAMETERS,
        GuidanceSettings::PARAMETERS,
        PassivitySettings::PARAMETERS,
        LimitSettings::PARAMETERS,
        &[ParameterId::Integrator],
    ];

    /// Sets every setting that a parameter drives to that parameter's value; the others stay.
    pub fn adopt(&mut self, value: &impl Fn(ParameterId) -> f32) {
        self.coupling.adopt(value);
        self.contact.adopt(value);
        self.friction.adopt(value);
        self.object.adopt(value);
        self.guidance.adopt(value);
        self.passivity.adopt(value);
        self.limits.adopt(value);
        self.integrator = FromParameter::from_parameter(value(ParameterId::Integrator));
    }

    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`SettingsError`] with the first that is outside its range or not a number.
    pub fn validate(&self) -> Result<(), SettingsError> {
        self.coupling.validate()?;
        self.contact.validate()?;
        self.friction.validate()?;
        self.object.validate()?;
        self.guidance.validate()?;
        self.passivity.validate()?;
        self.limits.validate()?;
        PERIOD_S.check("period_s", self.period_s)?;
        let at_least = |min: f32| Range {
            min,
            max: f32::INFINITY,
        };
        let (friction, object) = (&self.friction, &self.object);
        at_least(friction.kinetic).check("friction.fixed", friction.fixed)?;
        at_least(object.gyration_min_m).check("object.gyration_max_m", object.gyration_max_m)
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
    #[test]
    fn choices_are_the_nearest_number() {
        for (value, integrator) in [(0.4, Integrator::Implicit), (0.6, Integrator::Explicit)] {
            assert_eq!(Integrator::from_parameter(value), integrator);
        }
        for (value, method) in [
            (0.4, GuidanceMethod::Off),
            (0.6, GuidanceMethod::Capped),
            (1.4, GuidanceMethod::Capped),
            (1.6, GuidanceMethod::Thesis),
            (2.6, GuidanceMethod::Energy),
        ] {
            assert_eq!(GuidanceMethod::from_parameter(value), method);
        }
    }
}

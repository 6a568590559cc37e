//! Every adjustable number of the board: unit, range, default, meaning.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

macro_rules! parameters {
    ($($(#[doc = $doc:literal])+ $name:ident = $unit:literal, $min:expr, $max:expr, $default:expr $(, [$($choice:literal),+])?;)+) => {
        /// Names a parameter.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Schema)]
        pub enum ParameterId { $($(#[doc = $doc])+ $name,)+ }

        /// All parameters, in the order of [`ParameterId`].
        pub const PARAMETERS: &[Parameter] = &[$(Parameter {
            id: ParameterId::$name,
            name: stringify!($name),
            description: concat!($($doc),+),
            unit: $unit, min: $min, max: $max, default: $default, choices: &[$($($choice),+)?],
        },)+];
    };
}

/// One parameter's row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Which.
    pub id: ParameterId,
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub description: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Smallest accepted.
    pub min: f32,
    /// Largest accepted.
    pub max: f32,
    /// Value at start.
    pub default: f32,
    /// What 0, 1, … stand for, when it is a choice (the nearest counts); empty for a quantity.
    pub choices: &'static [&'static str],
}

impl Parameter {
    /// What `value` stands for, when it is a choice.
    pub fn choice(&self, value: f32) -> Option<&'static str> {
        // A float that is negative or not a number becomes 0, a huge one the largest number.
        self.choices.get((value + 0.5) as usize).copied()
    }
}

parameters! {
    /// Virtual coupling, translational stiffness k_T.
    CouplingStiffness = "N/m", 0.0, 5_000.0, 1_000.0;
    /// Virtual coupling, translational damping b_T.
    CouplingDamping = "N·s/m", 0.0, 50.0, 20.0;
    /// Virtual coupling, rotational stiffness k_R.
    CouplingAngularStiffness = "N·m/rad", 0.0, 20.0, 0.5;
    /// Virtual coupling, rotational damping b_R.
    CouplingAngularDamping = "N·m·s/rad", 0.0, 0.1, 0.01;
    /// Force at which the virtual coupling saturates.
    CouplingForce = "N", 0.1, 50.0, 10.0;
    /// Torque at which the virtual coupling saturates.
    CouplingTorque = "N·m", 0.01, 2.0, 0.3;
    /// Contact stiffness of one point.
    ContactStiffness = "N/m", 1e3, 5e6, 2e5;
    /// Contact damping over stiffness.
    ContactDamping = "s", 0.0, 0.01, 0.0005;
    /// Mass of the dynamic object.
    ObjectMass = "kg", 0.01, 5.0, 0.1;
    /// Largest force commanded to the handle.
    ForceLimit = "N", 0.0, 20.0, 12.0;
    /// Largest torque commanded to the handle.
    TorqueLimit = "N·m", 0.0, 1.0, 0.5;
    /// Largest change of force in a second.
    ForceSlew = "N/s", 10.0, 20_000.0, 5_000.0;
    /// Largest change of torque in a second.
    TorqueSlew = "N·m/s", 0.1, 1_000.0, 200.0;
    /// Handle speed that counts as a fault.
    SpeedLimit = "m/s", 0.1, 5.0, 2.0;
    /// Handle rotation speed that counts as a fault: that of a point 50 mm off the axis at the speeds of SpeedLimit.
    AngularSpeedLimit = "rad/s", 2.0, 100.0, 40.0;
    /// Largest mechanical power the motors may put into the handle, force and torque together.
    PowerLimit = "W", 0.1, 100.0, 10.0;
    /// Distance of the handle from the world's origin that counts as a fault; beyond it no force points outwards.
    WorkspaceRadius = "m", 0.01, 2.0, 1.0;
    /// Host silence while armed that counts as a fault.
    HostTimeout = "s", 0.05, 5.0, 0.5;
    /// Most work of a tick, in field look-ups; a point that may touch counts 4.
    PointBudget = "look-ups", 16.0, 65_535.0, 520.0;
    /// How the object is moved: 0 implicit, 1 explicit (the textbook's, which trembles on stiff contact).
    Integrator = "choice", 0.0, 1.0, 0.0, ["implicit", "explicit"];
    /// How constraint targets guide: 0 not at all, 1 stiff up to their cap, 2 the blend of the thesis.
    Guidance = "choice", 0.0, 2.0, 1.0, ["off", "capped", "thesis"];
    /// Whether mating faces that an engaged target keeps apart leave the work: 0 no, 1 yes. Nothing is felt of it; for comparing what ticks cost.
    Joints = "choice", 0.0, 1.0, 1.0, ["off", "on"];
    /// How far points of the part in hand are moved inward before voxmaps are looked up; the textbook's pointshell shrinking, for comparing.
    Shrinking = "voxels", 0.0, 1.0, 0.0;
}

impl ParameterId {
    /// The row of this parameter.
    pub const fn row(self) -> &'static Parameter {
        &PARAMETERS[self as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_told_by_the_nearest_number() {
        let row = ParameterId::Integrator.row();
        for (value, choice) in [
            (0.0, "implicit"),
            (0.4, "implicit"),
            (0.6, "explicit"),
            (1.0, "explicit"),
        ] {
            assert_eq!(row.choice(value), Some(choice));
        }
        assert_eq!(ParameterId::ForceLimit.row().choice(1.0), None);
    }

    #[test]
    fn every_default_lies_in_its_range() {
        for (i, p) in PARAMETERS.iter().enumerate() {
            assert_eq!(p.id as usize, i);
            assert!(
                p.min < p.max && p.min <= p.default && p.default <= p.max,
                "{}",
                p.name
            );
            let choices = p.choices.len();
            assert!(
                choices == 0 || (p.min == 0.0 && p.max == (choices - 1) as f32),
                "{}",
                p.name
            );
        }
    }
}

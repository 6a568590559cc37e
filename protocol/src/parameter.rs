//! All adjustable numbers of the board: unit, range, default, meaning.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

macro_rules! parameters {
    ($($(#[doc = $doc:literal])+ $name:ident = $unit:literal, $min:expr, $max:expr, $default:expr $(, [$($choice:literal),+])?;)+) => {
        /// Identifies a parameter.
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
    /// Identifier.
    pub id: ParameterId,
    /// Name.
    pub name: &'static str,
    /// Meaning.
    pub description: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Smallest accepted.
    pub min: f32,
    /// Largest accepted.
    pub max: f32,
    /// Value at start.
    pub default: f32,
    /// Names of the values 0, 1, … of a choice (a value is rounded to the nearest); empty for a quantity.
    pub choices: &'static [&'static str],
}

impl Parameter {
    /// Name of `value` if the parameter is a choice.
    pub fn choice(&self, value: f32) -> Option<&'static str> {
        // The cast turns a negative number or NaN into 0 and clamps a huge number.
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
    /// Largest change of force per second.
    ForceSlew = "N/s", 10.0, 20_000.0, 5_000.0;
    /// Largest change of torque per second.
    TorqueSlew = "N·m/s", 0.1, 1_000.0, 200.0;
    /// Handle speed above which a fault is raised.
    SpeedLimit = "m/s", 0.1, 5.0, 2.0;
    /// Angular speed of the handle above which a fault is raised: that of a point 50 mm off the axis at the speeds of SpeedLimit.
    AngularSpeedLimit = "rad/s", 2.0, 100.0, 40.0;
    /// Largest mechanical power that the motors may put into the handle, force and torque together.
    PowerLimit = "W", 0.1, 100.0, 10.0;
    /// Distance of the handle from the world's origin beyond which a fault is raised; no force points outward there.
    WorkspaceRadius = "m", 0.01, 2.0, 1.0;
    /// Time without a message from the host, while armed, after which a fault is raised.
    HostTimeout = "s", 0.05, 5.0, 0.5;
    /// Largest work of a tick, in field queries (look-ups); a point that may touch counts 3.
    PointBudget = "look-ups", 16.0, 65_535.0, 520.0;
    /// Integration of the object's motion; explicit is the textbook's, which trembles on stiff contact.
    Integrator = "choice", 0.0, 1.0, 0.0, ["implicit", "explicit"];
    /// Guidance: none; by constraint targets, stiff with limited force or the softer blend of the thesis; or by the scene's geometric energies.
    Guidance = "choice", 0.0, 3.0, 1.0, ["off", "force-limited", "Faas 2010", "geometric energy"];
    /// Whether mating faces that an engaged target keeps apart are excluded from contact. The forces are the same; for comparing tick costs.
    Joints = "choice", 0.0, 1.0, 1.0, ["off", "on"];
    /// Distance by which points of the held part are moved inward for voxmap queries; the textbook's pointshell shrinking, for comparison.
    Shrinking = "voxels", 0.0, 1.0, 0.0;
    /// Largest force of a geometric energy.
    GeometricForce = "N", 0.0, 10.0, 3.0;
    /// How many times as far as the handle the held part moves; a change holds from the next grab on. Forces are scaled alike, so that stiffness is felt times its square.
    PositionScale = "times", 0.1, 10.0, 1.0;
}

impl ParameterId {
    /// Table row of this parameter.
    pub const fn row(self) -> &'static Parameter {
        &PARAMETERS[self as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_named_by_the_nearest_number() {
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

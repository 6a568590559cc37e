//! All numbers of a rig's description: key in the file, unit there, range, meaning.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

macro_rules! rig_keys {
    ($($(#[doc = $doc:literal])+ $name:ident = $key:literal, $unit:literal, $si:expr, $min:expr, $max:expr;)+) => {
        /// Identifies a number of a description.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Schema)]
        pub enum RigKey { $($(#[doc = $doc])+ $name,)+ }

        /// All numbers, in the order of [`RigKey`].
        pub const RIG_KEYS: &[RigKeyRow] = &[$(RigKeyRow {
            id: RigKey::$name, key: $key, description: concat!($($doc),+), unit: $unit, si: $si, min: $min, max: $max,
        },)+];
    };
}

/// One number's row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigKeyRow {
    /// Identifier.
    pub id: RigKey,
    /// Key in the file, including its table.
    pub key: &'static str,
    /// Meaning.
    pub description: &'static str,
    /// Unit in the file.
    pub unit: &'static str,
    /// That unit expressed in SI units.
    pub si: f32,
    /// Smallest accepted, in the file's unit.
    pub min: f32,
    /// Largest accepted, in the file's unit.
    pub max: f32,
}

const MM: f32 = 1e-3;
const DEG: f32 = core::f32::consts::PI / 180.0;

rig_keys! {
    /// Paddle: distance of the handle from the joint's axis.
    PaddleRadius = "kinematics.radius_mm", "mm", MM, 5.0, 500.0;
    /// Pantograph: distance between the axes of its two motors; 0 if they coincide.
    PantographBase = "kinematics.base_mm", "mm", MM, 0.0, 500.0;
    /// Pantograph: lengths of the two links at the motors, left and right.
    PantographProximal = "kinematics.proximal_mm", "mm", MM, 10.0, 1_000.0;
    /// Pantograph: lengths of the two links at the handle, left and right.
    PantographDistal = "kinematics.distal_mm", "mm", MM, 10.0, 1_000.0;
    /// Serial arm: height of the shoulder above the base.
    ArmBaseHeight = "kinematics.base_height_mm", "mm", MM, 0.0, 1_000.0;
    /// Serial arm: length of the upper link.
    ArmUpper = "kinematics.upper_mm", "mm", MM, 10.0, 1_000.0;
    /// Serial arm: length of the lower link.
    ArmLower = "kinematics.lower_mm", "mm", MM, 10.0, 1_000.0;
    /// World origin, as a point in the mechanism's own frame.
    Origin = "mount.origin_mm", "mm", MM, -2_000.0, 2_000.0;
    /// Rotation of the mechanism's frame in the world: a rotation vector.
    Turn = "mount.turn_deg", "deg", DEG, -180.0, 180.0;
    /// Encoder counts, all four edges, per turn of the shaft that carries the encoder.
    Counts = "joint.counts_per_turn", "counts", 1.0, 16.0, 10_000_000.0;
    /// Motor turns per turn of the joint: drum over capstan.
    Gear = "joint.gear", "1", 1.0, 1.0, 1_000.0;
    /// Torque of the motor per ampere.
    TorqueConstant = "joint.torque_constant_n_m_per_a", "N·m/A", 1.0, 1e-4, 10.0;
    /// Largest current of the motor.
    CurrentLimit = "joint.current_limit_a", "A", 1.0, 0.01, 30.0;
    /// Smallest angle the joint can reach.
    RangeFrom = "joint.range_deg[0]", "deg", DEG, -360.0, 360.0;
    /// Largest angle the joint can reach.
    RangeTo = "joint.range_deg[1]", "deg", DEG, -360.0, 360.0;
    /// Angle of the joint in the pose in which the mechanism is held when its counters start.
    Home = "joint.home_deg", "deg", DEG, -360.0, 360.0;
    /// Largest speed of the joint: a faster reading is an encoder fault.
    Rate = "joint.rate_limit_deg_per_s", "deg/s", DEG, 10.0, 20_000.0;
    /// Coulomb friction at the joint.
    Coulomb = "joint.friction_n_m", "N·m", 1.0, 0.0, 1.0;
    /// Viscous friction at the joint.
    Viscous = "joint.viscous_n_m_s_per_rad", "N·m·s/rad", 1.0, 0.0, 1.0;
    /// Inertia at the joint, including rotor and gear, without the handle.
    Inertia = "joint.inertia_kg_m2", "kg·m²", 1.0, 1e-7, 1.0;
    /// Encoder counts per turn of a wrist axis.
    WristCounts = "wrist.counts_per_turn", "counts", 1.0, 16.0, 10_000_000.0;
    /// Angles of the wrist in the pose in which its counters start.
    WristHome = "wrist.home_deg", "deg", DEG, -360.0, 360.0;
    /// Unit vectors of the wrist's axes when all its angles are 0, in the frame of the link that carries it.
    WristAxis = "wrist.axes", "1", 1.0, -1.0, 1.0;
    /// Mass of the handle.
    HandleMass = "handle.mass_kg", "kg", 1.0, 0.001, 5.0;
    /// Largest force at the handle, regardless of the parameters.
    CeilingForce = "ceilings.force_n", "N", 1.0, 0.1, 20.0;
    /// Largest power into the handle.
    CeilingPower = "ceilings.power_w", "W", 1.0, 0.1, 50.0;
    /// Largest speed of the handle.
    CeilingSpeed = "ceilings.speed_m_per_s", "m/s", 1.0, 0.1, 5.0;
    /// Largest distance of the handle from the world's origin.
    CeilingWorkspace = "ceilings.workspace_mm", "mm", MM, 10.0, 2_000.0;
}

impl RigKey {
    /// Table row of this number.
    pub const fn row(self) -> &'static RigKeyRow {
        &RIG_KEYS[self as usize]
    }

    /// Whether `si` (SI unit) is in the range, up to the rounding of the conversion, 2⁻²² of the bound.
    pub fn holds(self, si: f32) -> bool {
        let row = self.row();
        let (min, max) = (row.min * row.si, row.max * row.si);
        let slack = |bound: f32| 3e-7 * bound.abs();
        // A comparison with NaN is false.
        si >= min - slack(min) && si <= max + slack(max)
    }
}

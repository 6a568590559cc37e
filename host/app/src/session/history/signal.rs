//! The signals of a sample that can be drawn and exported: names, units and values.

use super::sample::{Sample, length};

/// What a signal measures: signals of one quantity share an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// N.
    Force,
    /// mN·m.
    Torque,
    /// The board's unit.
    LoopTime,
    /// mm.
    Position,
    /// Degrees.
    Rotation,
    /// mm/s.
    Speed,
    /// µm.
    Depth,
    /// A number.
    Count,
    /// 0 to 1.
    Share,
}

impl Quantity {
    /// All of them, in the order of their plots.
    pub const ALL: [Self; 9] = [
        Self::Force,
        Self::Torque,
        Self::LoopTime,
        Self::Position,
        Self::Rotation,
        Self::Speed,
        Self::Depth,
        Self::Count,
        Self::Share,
    ];

    /// Name, as the plot's title.
    pub fn name(self) -> &'static str {
        match self {
            Self::Force => "Force",
            Self::Torque => "Torque",
            Self::LoopTime => "Loop time",
            Self::Position => "Position",
            Self::Rotation => "Rotation",
            Self::Speed => "Speed",
            Self::Depth => "Depth",
            Self::Count => "Count",
            Self::Share => "Share",
        }
    }

    /// Unit of the values; empty for numbers and for the loop time, whose unit is the board's.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Force => "N",
            Self::Torque => "mN·m",
            Self::Position => "mm",
            Self::Rotation => "°",
            Self::Speed => "mm/s",
            Self::Depth => "µm",
            Self::LoopTime | Self::Count | Self::Share => "",
        }
    }

    /// Smallest span of the axis, in the unit: noise of a signal at rest must not fill the plot.
    pub fn least_span(self) -> f64 {
        match self {
            Self::Force | Self::Position | Self::Rotation | Self::Share => 1.0,
            Self::Torque | Self::LoopTime | Self::Speed | Self::Depth => 10.0,
            Self::Count => 4.0,
        }
    }

    /// Whether the axis always contains zero; places are drawn where they are.
    pub fn has_zero(self) -> bool {
        !matches!(self, Self::Position | Self::Rotation)
    }
}

/// A signal.
#[derive(Debug)]
pub struct Signal {
    /// Name that files and settings keep, with the unit.
    pub key: &'static str,
    /// Name beside the plot's title.
    pub name: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    value: fn(&Sample) -> f32,
}

impl Signal {
    /// The value in the unit of [`Self::quantity`]; `None` where the sample has none.
    pub fn of(&self, sample: &Sample) -> Option<f32> {
        Some((self.value)(sample)).filter(|value| value.is_finite())
    }

    /// The signal that files call `key`.
    pub fn named(key: &str) -> Option<&'static Self> {
        SIGNALS.iter().find(|signal| signal.key == key)
    }
}

macro_rules! signals {
    ($($key:literal $name:literal $quantity:ident $value:expr;)*) => {
        &[$(Signal { key: $key, name: $name, quantity: Quantity::$quantity, value: $value }),*]
    };
}

/// Every signal, those of one quantity together.
pub const SIGNALS: &[Signal] = signals! {
    "contact_force_n" "contacts" Force |s| s.contact_n;
    "contact_force_x_n" "contacts x" Force |s| s.contact[0][0];
    "contact_force_y_n" "contacts y" Force |s| s.contact[0][1];
    "contact_force_z_n" "contacts z" Force |s| s.contact[0][2];
    "handle_force_n" "handle" Force |s| s.handle_n;
    "handle_force_x_n" "handle x" Force |s| s.handle[0][0];
    "handle_force_y_n" "handle y" Force |s| s.handle[0][1];
    "handle_force_z_n" "handle z" Force |s| s.handle[0][2];
    "guidance_force_n" "guidance" Force |s| length(s.guidance[0]);
    "guidance_force_x_n" "guidance x" Force |s| s.guidance[0][0];
    "guidance_force_y_n" "guidance y" Force |s| s.guidance[0][1];
    "guidance_force_z_n" "guidance z" Force |s| s.guidance[0][2];
    "hand_force_n" "hand" Force |s| length(s.hand[0]);
    "hand_force_x_n" "hand x" Force |s| s.hand[0][0];
    "hand_force_y_n" "hand y" Force |s| s.hand[0][1];
    "hand_force_z_n" "hand z" Force |s| s.hand[0][2];
    "contact_torque_mnm" "contacts" Torque |s| 1e3 * s.contact_nm;
    "contact_torque_x_mnm" "contacts x" Torque |s| 1e3 * s.contact[1][0];
    "contact_torque_y_mnm" "contacts y" Torque |s| 1e3 * s.contact[1][1];
    "contact_torque_z_mnm" "contacts z" Torque |s| 1e3 * s.contact[1][2];
    "handle_torque_mnm" "handle" Torque |s| 1e3 * s.handle_nm;
    "handle_torque_x_mnm" "handle x" Torque |s| 1e3 * s.handle[1][0];
    "handle_torque_y_mnm" "handle y" Torque |s| 1e3 * s.handle[1][1];
    "handle_torque_z_mnm" "handle z" Torque |s| 1e3 * s.handle[1][2];
    "guidance_torque_mnm" "guidance" Torque |s| 1e3 * length(s.guidance[1]);
    "hand_torque_mnm" "hand" Torque |s| 1e3 * length(s.hand[1]);
    "loop_cost" "loop" LoopTime |s| s.cost;
    "handle_x_mm" "handle x" Position |s| s.handle_pose[0][0];
    "handle_y_mm" "handle y" Position |s| s.handle_pose[0][1];
    "handle_z_mm" "handle z" Position |s| s.handle_pose[0][2];
    "object_x_mm" "part x" Position |s| s.object_pose[0][0];
    "object_y_mm" "part y" Position |s| s.object_pose[0][1];
    "object_z_mm" "part z" Position |s| s.object_pose[0][2];
    "insertion_mm" "insertion" Position |s| s.insertion_mm;
    "handle_turn_x_deg" "handle x" Rotation |s| s.handle_pose[1][0];
    "handle_turn_y_deg" "handle y" Rotation |s| s.handle_pose[1][1];
    "handle_turn_z_deg" "handle z" Rotation |s| s.handle_pose[1][2];
    "object_turn_x_deg" "part x" Rotation |s| s.object_pose[1][0];
    "object_turn_y_deg" "part y" Rotation |s| s.object_pose[1][1];
    "object_turn_z_deg" "part z" Rotation |s| s.object_pose[1][2];
    "handle_speed_mm_s" "handle" Speed |s| s.handle_mm_s;
    "object_speed_mm_s" "part" Speed |s| s.object_mm_s;
    "depth_um" "deepest" Depth |s| s.depth_um;
    "points" "points" Count |s| f32::from(s.points);
    "pairs" "touching pairs" Count |s| f32::from(s.pairs);
    "targets" "targets" Count |s| f32::from(s.targets);
    "overruns" "overruns" Count |s| s.late as f32;
    "dropped" "dropped messages" Count |s| s.dropped as f32;
    "engagement" "engagement" Share |s| s.engagement;
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_its_own_and_every_quantity_has_signals_in_one_run() {
        for (index, signal) in SIGNALS.iter().enumerate() {
            let named = Signal::named(signal.key).map(|found| found.name);
            assert_eq!(named, Some(signal.name));
            let first = SIGNALS.iter().position(|other| other.key == signal.key);
            assert_eq!(first, Some(index), "{}", signal.key);
        }
        assert!(SIGNALS.is_sorted_by_key(|signal| signal.quantity));
        for quantity in Quantity::ALL {
            assert!(SIGNALS.iter().any(|signal| signal.quantity == quantity));
        }
    }
}

//! What a run of a scenario measured, and whether its bounds hold.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Two-sided bounds: a figure that is too good is as suspicious as one that is too bad.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Smallest that holds.
    pub min: f64,
    /// Largest that holds.
    pub max: f64,
    /// Only on rigs whose written form starts so (`emulated`), because others do not measure it.
    pub only_on: Option<String>,
}

/// What a run measured. Serialised as it is for `mortise demo --headless --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// Scenario.
    pub scenario: String,
    /// Rig, as written.
    pub rig: String,
    /// Board's name.
    pub board: String,
    /// How far the moving part's farthest point lies beyond the hole's mouth, mm.
    pub inserted_mm: Option<f64>,
    /// Depth of the hole, mm.
    pub hole_mm: Option<f64>,
    /// Moving part's centre of mass off the hole's axis at the end, mm.
    pub lateral_mm: Option<f64>,
    /// Ticks run.
    pub ticks: u32,
    /// Ticks missed.
    pub missed_ticks: u32,
    /// Most instructions a tick took; `null` where the rig counts no instructions.
    pub instructions_per_tick_max: Option<u32>,
    /// Mean of the same.
    pub instructions_per_tick_mean: Option<f64>,
    /// Instructions in a tick's period; `null` where nothing is counted or due.
    pub instructions_per_tick_budget: Option<u32>,
    /// Most points a tick looked up.
    pub points_per_tick_max: u32,
    /// Largest force commanded to the handle, N.
    pub peak_force_n: f64,
    /// Largest torque commanded to the handle, N·m.
    pub peak_torque_nm: f64,
    /// Force on the handle along the press direction, mean of the settled part, N.
    pub press_handle_n: Option<f64>,
    /// The hand's force along the press direction, mean of the settled part, N.
    pub press_hand_n: Option<f64>,
    /// How much they differ, share of the hand's, percent.
    pub press_error_percent: Option<f64>,
    /// Deepest point of one part inside another by the exact surfaces, both ways, over all samples, mm; 0 when never inside.
    pub penetration_mm: f64,
    /// The same as the board saw it, mm.
    pub board_penetration_mm: f64,
    /// Integral of the amount of the contact force on the object, N·s.
    pub contact_impulse_ns: f64,
    /// Largest contact force on the object, N.
    pub peak_contact_n: f64,
    /// Amount of the integral of the forces on the object by contacts and targets less that on the handle, N·s: what of it the hand did not feel.
    pub impulse_lost_ns: f64,
    /// Most work of the device on the handle over any interval beyond what was stored at its start, mJ: energy that nobody put in. Stored are the
    /// coupling's springs and the object's motion, as far as they are known: only where `energy_exact`, else nothing counts as stored.
    pub energy_given_mj: f64,
    /// Work that went through the handle either way, mJ.
    pub energy_passed_mj: f64,
    /// Whether both are of the handle's true motion, which takes every tick's sample of a simulated handle. Else they are of its encoders' readings,
    /// whose rounding (5 µm) makes them too large by some 10 µW on each axis that moves.
    pub energy_exact: bool,
    /// Most work of contacts on the object over any interval, mJ, nothing counted as stored; exact where each tick is heard, else trapezoids between
    /// samples.
    pub contact_given_mj: f64,
    /// The same of contacts and targets together: what came through the port between the object and what constrains it.
    pub constraint_given_mj: f64,
    /// Telemetry samples taken.
    pub samples: u32,
    /// Telemetry the board dropped because the link was slower.
    pub dropped_samples: u32,
    /// Frames the board threw away.
    pub bad_frames: u32,
    /// Parameter messages sent while it ran.
    pub parameter_messages: u32,
    /// Telemetry flags seen, all together.
    pub flags: u16,
    /// Share of the samples whose tick left out points or contacts, %.
    pub degraded_percent: f64,
    /// The first fault the board told of, in words; only where the scenario lets its inputs fail, else a fault is an error.
    pub fault: Option<String>,
    /// When, ms after the hand began.
    pub fault_at_ms: Option<f64>,
    /// Largest force commanded from the second tick after the fault on, N.
    pub force_after_fault_n: Option<f64>,
    /// Bytes of the scene image.
    pub image_bytes: usize,
    /// Deepest stack seen, bytes; 0 where not measured.
    pub stack_bytes_max: u32,
    /// Hash over every tick's state, hexadecimal: equal hashes, equal runs.
    pub state_hash: String,
}

/// One bound and whether it holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Quantity.
    pub what: String,
    /// Measured; `None` when this rig does not measure it.
    pub value: Option<f64>,
    /// Smallest that holds.
    pub min: f64,
    /// Largest that holds.
    pub max: f64,
    /// Whether it holds.
    pub holds: bool,
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mark = if self.holds { "ok  " } else { "FAIL" };
        let bounds = if self.min == self.max {
            format!("{}", self.min)
        } else {
            format!("{} to {}", self.min, self.max)
        };
        match self.value {
            Some(value) => write!(f, "{mark} {} = {value:.6} ({bounds})", self.what),
            None => write!(f, "{mark} {} was not measured ({bounds})", self.what),
        }
    }
}

macro_rules! quantities {
    ($($name:ident => $get:expr;)+) => {
        impl Outcome {
            /// Names that [`Outcome::quantity`] knows and a scenario's `[holds]` may use.
            pub const QUANTITIES: &'static [&'static str] = &[$(stringify!($name)),+];

            /// A measured quantity by its field's name; `None` when there is none of that name or this run did not measure it.
            pub fn quantity(&self, name: &str) -> Option<f64> {
                match name {
                    $(stringify!($name) => { let get: fn(&Self) -> Option<f64> = $get; get(self) })+
                    _ => None,
                }
            }
        }
    };
}

quantities! {
    inserted_mm => |o| o.inserted_mm;
    hole_mm => |o| o.hole_mm;
    lateral_mm => |o| o.lateral_mm;
    ticks => |o| Some(f64::from(o.ticks));
    missed_ticks => |o| Some(f64::from(o.missed_ticks));
    instructions_per_tick_max => |o| o.instructions_per_tick_max.map(f64::from);
    instructions_per_tick_mean => |o| o.instructions_per_tick_mean;
    points_per_tick_max => |o| Some(f64::from(o.points_per_tick_max));
    peak_force_n => |o| Some(o.peak_force_n);
    peak_torque_nm => |o| Some(o.peak_torque_nm);
    press_handle_n => |o| o.press_handle_n;
    press_hand_n => |o| o.press_hand_n;
    press_error_percent => |o| o.press_error_percent;
    penetration_mm => |o| Some(o.penetration_mm);
    board_penetration_mm => |o| Some(o.board_penetration_mm);
    contact_impulse_ns => |o| Some(o.contact_impulse_ns);
    peak_contact_n => |o| Some(o.peak_contact_n);
    impulse_lost_ns => |o| Some(o.impulse_lost_ns);
    energy_given_mj => |o| Some(o.energy_given_mj);
    energy_passed_mj => |o| Some(o.energy_passed_mj);
    contact_given_mj => |o| Some(o.contact_given_mj);
    constraint_given_mj => |o| Some(o.constraint_given_mj);
    samples => |o| Some(f64::from(o.samples));
    dropped_samples => |o| Some(f64::from(o.dropped_samples));
    bad_frames => |o| Some(f64::from(o.bad_frames));
    parameter_messages => |o| Some(f64::from(o.parameter_messages));
    flags => |o| Some(f64::from(o.flags));
    degraded_percent => |o| Some(o.degraded_percent);
    fault_at_ms => |o| o.fault_at_ms;
    force_after_fault_n => |o| o.force_after_fault_n;
}

impl Outcome {
    pub(crate) fn knows(quantity: &str) -> bool {
        Self::QUANTITIES.contains(&quantity)
    }

    /// Every bound of a scenario's `[holds]` that concerns this rig. A quantity that was not measured does not hold.
    pub fn verdicts(&self, holds: &BTreeMap<String, Bounds>) -> Vec<Verdict> {
        holds
            .iter()
            .filter(|(_, bounds)| {
                bounds
                    .only_on
                    .as_ref()
                    .is_none_or(|rig| self.rig.starts_with(rig.as_str()))
            })
            .map(|(what, bounds)| {
                let value = self.quantity(what);
                Verdict {
                    what: what.clone(),
                    value,
                    min: bounds.min,
                    max: bounds.max,
                    holds: value.is_some_and(|value| (bounds.min..=bounds.max).contains(&value)),
                }
            })
            .collect()
    }
}

//! Measurements of a run of a scenario, and whether its bounds hold.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

/// Two-sided bounds: an implausibly good figure fails as well as a bad one.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Smallest accepted value.
    pub min: f64,
    /// Largest accepted value.
    pub max: f64,
    /// Prefix of the rigs to which the bounds apply (`emulated`), where others do not measure the figure.
    pub only_on: Option<String>,
}

/// Measurements of a run. Serialised unchanged for `mortise demo --headless --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// Scenario.
    pub scenario: String,
    /// Rig, in its written form.
    pub rig: String,
    /// Board's name.
    pub board: String,
    /// Distance of the moving part's farthest point beyond the hole's mouth, mm.
    pub inserted_mm: Option<f64>,
    /// Depth of the hole, mm.
    pub hole_mm: Option<f64>,
    /// Distance of the moving part's centre of mass from the hole's axis at the end, mm.
    pub lateral_mm: Option<f64>,
    /// Ticks run.
    pub ticks: u32,
    /// Ticks missed.
    pub missed_ticks: u32,
    /// Largest number of instructions of a tick; `null` where the rig counts no instructions.
    pub instructions_per_tick_max: Option<u32>,
    /// Mean number of instructions of a tick.
    pub instructions_per_tick_mean: Option<f64>,
    /// Instructions in a tick's period; `null` on rigs without instruction counts or deadlines.
    pub instructions_per_tick_budget: Option<u32>,
    /// Largest number of points queried in a tick.
    pub points_per_tick_max: u32,
    /// Largest force commanded to the handle, N.
    pub peak_force_n: f64,
    /// Largest torque commanded to the handle, N·m.
    pub peak_torque_nm: f64,
    /// Force on the handle along the press direction, mean over the settled part, N.
    pub press_handle_n: Option<f64>,
    /// The hand's force along the press direction, mean over the settled part, N.
    pub press_hand_n: Option<f64>,
    /// Difference of the two as a share of the hand's, percent.
    pub press_error_percent: Option<f64>,
    /// Deepest point of one part inside another on the exact surfaces, in both directions, over all samples, mm; 0 without overlap.
    pub penetration_mm: f64,
    /// The same as reported by the board, mm.
    pub board_penetration_mm: f64,
    /// Integral of the magnitude of the contact force on the object, N·s.
    pub contact_impulse_ns: f64,
    /// Largest contact force on the object, N.
    pub peak_contact_n: f64,
    /// Magnitude of the integral of the contact and target forces on the object minus the force on the handle, N·s: the impulse that the hand did not
    /// receive.
    pub impulse_lost_ns: f64,
    /// Largest work of the device on the handle over any interval beyond what was stored at its start, mJ: generated energy. Stored are the
    /// coupling's springs and the object's kinetic energy, as far as they are known, which is only where `energy_exact`; else nothing counts as
    /// stored.
    pub energy_given_mj: f64,
    /// Work that passed through the handle in either direction, mJ.
    pub energy_passed_mj: f64,
    /// True if both are computed from the handle's true motion, which takes every tick's sample of a simulated handle. Otherwise they use its encoder
    /// readings, whose rounding (5 µm) makes them too large by about 10 µW on each moving axis.
    pub energy_exact: bool,
    /// Largest work of contacts on the object over any interval, mJ, with nothing counted as stored; exact if each tick's sample is received, else
    /// trapezoids between samples.
    pub contact_given_mj: f64,
    /// The same work of contacts and targets together: through the port between the object and its constraints.
    pub constraint_given_mj: f64,
    /// Telemetry samples received.
    pub samples: u32,
    /// Telemetry the board dropped because the link was slower.
    pub dropped_samples: u32,
    /// Frames that the board discarded.
    pub bad_frames: u32,
    /// Parameter messages sent while it ran.
    pub parameter_messages: u32,
    /// Union of the telemetry flags.
    pub flags: u16,
    /// Share of the samples whose tick decimated points or contacts, %.
    pub degraded_percent: f64,
    /// The first fault that the board reported, in words; only where the scenario makes inputs fail, otherwise a fault is an error.
    pub fault: Option<String>,
    /// Time of that fault, ms after the hand began.
    pub fault_at_ms: Option<f64>,
    /// Largest force commanded from the second tick after the fault onwards, N.
    pub force_after_fault_n: Option<f64>,
    /// Bytes of the scene image.
    pub image_bytes: usize,
    /// Largest stack use, bytes; 0 where not measured.
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
    /// Smallest accepted value.
    pub min: f64,
    /// Largest accepted value.
    pub max: f64,
    /// Whether it holds.
    pub holds: bool,
}

impl Verdict {
    /// The bound in words, without its unit.
    pub fn bound(&self) -> String {
        if self.min == self.max {
            format!("exactly {}", self.min)
        } else if self.min == 0.0 {
            format!("at most {}", self.max)
        } else if self.max == f64::INFINITY {
            format!("at least {}", self.min)
        } else {
            format!("{} to {}", self.min, self.max)
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = if self.holds { "ok  " } else { "FAIL" };
        let known = Quantity::named(&self.what);
        let (what, unit) = known.map_or((self.what.as_str(), ""), |known| (known.what, known.unit));
        write!(f, "{mark} {what}: ")?;
        match self.value {
            Some(value) => write!(f, "{} {unit}", three_digits(value))?,
            None => write!(f, "not measured")?,
        }
        write!(f, " ({} {unit})", self.bound())
    }
}

/// A measured quantity.
pub struct Quantity {
    /// Field name, as used in a scenario's `[holds]`.
    pub name: &'static str,
    /// Description for people.
    pub what: &'static str,
    /// Its unit.
    pub unit: &'static str,
    get: fn(&Outcome) -> Option<f64>,
}

macro_rules! quantities {
    ($($name:ident, $what:literal, $unit:literal, $get:expr;)+) => {
        /// Every quantity that a run may measure.
        pub const QUANTITIES: &[Quantity] = &[
            $(Quantity { name: stringify!($name), what: $what, unit: $unit, get: $get }),+
        ];
    };
}

quantities! {
    inserted_mm, "depth in the hole", "mm", |o| o.inserted_mm;
    hole_mm, "length of the hole", "mm", |o| o.hole_mm;
    lateral_mm, "distance from the hole's axis", "mm", |o| o.lateral_mm;
    penetration_mm, "deepest penetration by the exact surfaces", "mm", |o| Some(o.penetration_mm);
    board_penetration_mm, "deepest penetration as the board has it", "mm", |o| Some(o.board_penetration_mm);
    peak_force_n, "largest force on the handle", "N", |o| Some(o.peak_force_n);
    peak_torque_nm, "largest torque on the handle", "N·m", |o| Some(o.peak_torque_nm);
    press_handle_n, "force on the handle along the press", "N", |o| o.press_handle_n;
    press_hand_n, "force of the hand along the press", "N", |o| o.press_hand_n;
    press_error_percent, "difference of the two", "%", |o| o.press_error_percent;
    peak_contact_n, "largest contact force", "N", |o| Some(o.peak_contact_n);
    contact_impulse_ns, "impulse of contacts", "N·s", |o| Some(o.contact_impulse_ns);
    impulse_lost_ns, "impulse that the hand did not feel", "N·s", |o| Some(o.impulse_lost_ns);
    energy_given_mj, "energy generated at the handle", "mJ", |o| Some(o.energy_given_mj);
    energy_passed_mj, "energy through the handle", "mJ", |o| Some(o.energy_passed_mj);
    contact_given_mj, "energy generated by contacts", "mJ", |o| Some(o.contact_given_mj);
    constraint_given_mj, "energy generated by contacts and targets", "mJ", |o| Some(o.constraint_given_mj);
    ticks, "ticks", "", |o| Some(f64::from(o.ticks));
    missed_ticks, "loop overruns", "ticks", |o| Some(f64::from(o.missed_ticks));
    instructions_per_tick_max, "longest tick", "instructions", |o| o.instructions_per_tick_max.map(f64::from);
    instructions_per_tick_mean, "mean tick", "instructions", |o| o.instructions_per_tick_mean;
    points_per_tick_max, "most points queried in a tick", "", |o| Some(f64::from(o.points_per_tick_max));
    degraded_percent, "ticks that left points out", "%", |o| Some(o.degraded_percent);
    samples, "telemetry received", "messages", |o| Some(f64::from(o.samples));
    dropped_samples, "telemetry dropped by the board", "messages", |o| Some(f64::from(o.dropped_samples));
    bad_frames, "damaged frames", "", |o| Some(f64::from(o.bad_frames));
    parameter_messages, "parameters sent", "messages", |o| Some(f64::from(o.parameter_messages));
    flags, "telemetry flags, all together", "", |o| Some(f64::from(o.flags));
    fault_at_ms, "time of the fault", "ms", |o| o.fault_at_ms;
    force_after_fault_n, "largest force after the fault", "N", |o| o.force_after_fault_n;
}

impl Quantity {
    /// The quantity with this field name.
    pub fn named(name: &str) -> Option<&'static Self> {
        QUANTITIES.iter().find(|quantity| quantity.name == name)
    }
}

/// `value` to three significant digits, integers in full; thousands separated.
pub fn three_digits(value: f64) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    let decimals = if value == value.trunc() {
        0
    } else {
        // Digits before the point; rounding may add one, as from 9.996 to 10.0.
        let magnitude = format!("{value:.2e}");
        let exponent = magnitude
            .split_once('e')
            .and_then(|(_, exponent)| exponent.parse().ok());
        (2 - exponent.unwrap_or(0i32)).max(0) as usize
    };
    let text = format!("{value:.decimals$}");
    let (sign, digits) = text
        .strip_prefix('-')
        .map_or(("", text.as_str()), |rest| ("-", rest));
    let (whole, part) = digits.split_at(digits.find('.').unwrap_or(digits.len()));
    let groups: Vec<&str> = (whole.as_bytes().rchunks(3).rev())
        .filter_map(|group| std::str::from_utf8(group).ok())
        .collect();
    format!("{sign}{}{part}", groups.join(","))
}

impl Outcome {
    /// A measured quantity by its field name; `None` for an unknown name or a quantity that this run did not measure.
    pub fn quantity(&self, name: &str) -> Option<f64> {
        Quantity::named(name).and_then(|quantity| (quantity.get)(self))
    }

    /// Verdicts on every bound of a scenario's `[holds]` that applies to this rig. A quantity that was not measured fails.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_integers_are_whole() {
        for (value, text) in [
            (42.080978, "42.1"),
            (0.209712, "0.210"),
            (9.996, "10.0"),
            (0.0123456, "0.0123"),
            (33820.0, "33,820"),
            (1234567.0, "1,234,567"),
            (-1234.56, "-1,235"),
            (0.0, "0"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(three_digits(value), text, "{value}");
        }
    }

    #[test]
    fn a_verdict_has_words_and_units() {
        let verdict = |what: &str, value, min, max, holds| {
            let what = what.into();
            let verdict = Verdict {
                what,
                value,
                min,
                max,
                holds,
            };
            verdict.to_string()
        };
        assert_eq!(
            verdict("inserted_mm", Some(42.08), 40.0, 43.0, true),
            "ok   depth in the hole: 42.1 mm (40 to 43 mm)"
        );
        assert_eq!(
            verdict("press_hand_n", None, 0.0, 3.0, false),
            "FAIL force of the hand along the press: not measured (at most 3 N)"
        );
    }
}

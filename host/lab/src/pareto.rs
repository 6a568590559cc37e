//! Accuracy against cost for several models: the effect of a finer cell, a wider number format or a denser shell.
//!
//! Accuracy is the largest error over scene P's poses ([`crate::scene_p`]) of the field's own distance, on which a tick acts, and for a few models
//! the smallest clearance that assembles ([`crate::clearance`]). Cost is the longest tick of the emulated board, in instructions, while a peg with
//! 0.2 mm clearance is pressed to the wall of its hole and slid along it; nanoseconds of a query on this computer; and bytes of the image.

use std::fmt;

use mortise_bake::SampleFormat;
use mortise_protocol::message::Refusal;
use mortise_rig::{EmulatedMode, RigError, RigSpec};
use mortise_scenario::ScenarioError;
use serde::Serialize;

use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::clearance::{CELLS_MM, CLEARANCES_MM, smallest};
use crate::error::LabError;
use crate::experiment::{Experiment, Findings, Form, Report};
use crate::fit::Fit;
use crate::motion::{Motion, play};
use crate::peer;
use crate::scene_p::{self, By};
use crate::table::rounded;
use crate::variant::Variant;

/// Clearance of the peg whose ticks are measured, mm.
const COUNTED_MM: f64 = 0.2;
/// Its slide along the wall, mm/s.
const SLIDE_MM_PER_S: f64 = 10.0;
/// Depth of the fields, mm: as deep as scene P penetrates, so that the band causes no error.
const REACH_MM: f64 = 1.0;
/// Bounds on the shell's error, as shares of the cell.
const EPSILONS: [f64; 2] = [0.1, 0.01];
/// Largest deviation of the peer's meshes from the surfaces, mm.
const PEER_DEFLECTIONS_MM: [f64; 4] = [0.1, 0.03, 0.01, 0.003];

/// One model with its accuracy and cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// Method and number format, or the peer.
    pub kind: String,
    /// Cell edge, mm.
    pub cell_mm: Option<f64>,
    /// Bound on the shell's error, or on the peer's meshes, mm.
    pub epsilon_mm: Option<f64>,
    /// Largest error of a gap on scene P, µm.
    pub gap_error_um: f64,
    /// Largest error of a penetration on scene P, µm.
    pub penetration_error_um: f64,
    /// Smallest clearance that assembles, µm, where it was determined.
    pub smallest_clearance_um: Option<f64>,
    /// Instructions of the longest tick on the emulated board.
    pub instructions: Option<u32>,
    /// Ticks of that motion that left out points, %.
    pub left_out_percent: Option<f64>,
    /// Median query on scene P on this computer, ns.
    pub query_ns: f64,
    /// Bytes of scene P's image.
    pub image_bytes: Option<usize>,
    /// True if no other model of the sweep is both more accurate and cheaper in instructions.
    pub on_frontier: bool,
}

impl Entry {
    /// The larger of the two errors, µm.
    pub fn error_um(&self) -> f64 {
        self.gap_error_um.max(self.penetration_error_um)
    }
}

/// The models to compare, each with whether its smallest clearance is determined.
fn variants(quick: bool) -> Vec<(Variant, bool)> {
    let cells: &[f64] = if quick { &[1.0] } else { &CELLS_MM };
    let mut variants: Vec<(Variant, bool)> = (cells.iter())
        .map(|&cell| (Variant::textbook(cell), !quick))
        .collect();
    for &cell in cells {
        for format in [SampleFormat::Int16, SampleFormat::Int8] {
            for share in EPSILONS {
                let variant = (Variant::field(cell).format(format))
                    .epsilon_mm(share * cell)
                    .reach_mm(REACH_MM);
                let fine = share == EPSILONS[1] && format == SampleFormat::Int16;
                variants.push((variant, fine && !quick));
            }
        }
    }
    variants
}

/// Measures every model; passes each to `out` as soon as it is known. Returns all of them, the frontier marked.
///
/// # Errors
/// Anything that prevents a model from being measured.
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Entry)) -> Result<Vec<Entry>, LabError> {
    let mut entries = Vec::new();
    let mut tell = |entry: Entry| {
        out(&entry);
        entries.push(entry);
    };
    for (variant, looked_for) in variants(quick) {
        tell(measure(&variant, looked_for)?);
    }
    for &deflection in &PEER_DEFLECTIONS_MM[..if quick { 1 } else { PEER_DEFLECTIONS_MM.len() }] {
        let answers = peer::ask(deflection)?;
        tell(Entry {
            kind: "parry3d, triangle meshes".into(),
            cell_mm: None,
            epsilon_mm: Some(deflection),
            gap_error_um: 1e3 * answers.gap_error_mm,
            penetration_error_um: 1e3 * answers.depth_error_mm,
            smallest_clearance_um: None,
            instructions: None,
            left_out_percent: None,
            query_ns: answers.median_ns,
            image_bytes: None,
            on_frontier: false,
        });
    }
    mark(&mut entries);
    Ok(entries)
}

fn measure(variant: &Variant, looked_for: bool) -> Result<Entry, LabError> {
    let asked = scene_p::ask(variant)?;
    let board = RigSpec::Emulated {
        mode: EmulatedMode::Lockstep,
        firmware: None,
    };
    let pressed = Motion::Pressed {
        mm_per_s: SLIDE_MM_PER_S,
    };
    let outcome = match play(variant, &Fit::thesis(COUNTED_MM), pressed, None, &board) {
        Ok((outcome, _)) => Some(outcome),
        // A model too coarse for the fit pushes until the board faults: it has no cost.
        Err(LabError::Scenario(ScenarioError::Fault { .. })) => None,
        // A model too large for the board has no cost either.
        Err(LabError::Scenario(ScenarioError::Rig(RigError::Refused {
            reason: Refusal::SceneTooLarge { .. },
            ..
        }))) => None,
        Err(error) => return Err(error),
    };
    let smallest = if looked_for {
        smallest(variant, &CLEARANCES_MM, &mut |_| {})?
    } else {
        None
    };
    Ok(Entry {
        kind: variant.kind().into(),
        cell_mm: Some(variant.cell_mm),
        epsilon_mm: variant.epsilon_mm,
        gap_error_um: 1e3 * asked.worst(By::Field, true).0,
        penetration_error_um: 1e3 * asked.worst(By::Field, false).0,
        smallest_clearance_um: smallest.map(|clearance| 1e3 * clearance),
        instructions: (outcome.as_ref()).and_then(|outcome| outcome.instructions_per_tick_max),
        left_out_percent: (outcome.as_ref()).map(|outcome| rounded(outcome.degraded_percent, 1)),
        query_ns: asked.median_ns(),
        image_bytes: Some(asked.image_bytes),
        on_frontier: false,
    })
}

/// Marks the entries that no other entry beats in both error and instructions.
fn mark(entries: &mut [Entry]) {
    let cost = |entry: &Entry| Some((entry.error_um(), f64::from(entry.instructions?)));
    let costs: Vec<Option<(f64, f64)>> = entries.iter().map(cost).collect();
    for (entry, own) in entries.iter_mut().zip(&costs) {
        entry.on_frontier = own.is_some_and(|(error, dear)| {
            !costs
                .iter()
                .flatten()
                .any(|&(e, d)| e <= error && d <= dear && (e < error || d < dear))
        });
    }
}

/// Error over instructions, the frontier as a staircase.
pub fn ticks_chart(entries: &[Entry]) -> Chart {
    let instructions = |entry: &Entry| entry.instructions.map_or(f64::NAN, f64::from);
    let mut chart = Chart {
        title: "Accuracy against the cost of a tick on the board".into(),
        note: format!(
            "Longest tick of an emulated Cortex-M7, peg with {COUNTED_MM} mm clearance pressed to the wall with 5 N and slid. \
             Labels: cell and image. Down and left is better."
        ),
        x: Axis::new("instructions in the longest tick"),
        y: Axis::new("largest error on scene P, µm"),
        series: series(entries, instructions, true),
    };
    let mut frontier: Vec<&Entry> = entries.iter().filter(|entry| entry.on_frontier).collect();
    frontier.sort_by(|a, b| instructions(a).total_cmp(&instructions(b)));
    let points = frontier.iter().map(|entry| Point {
        x: instructions(entry),
        y: entry.error_um(),
        ..Point::default()
    });
    chart.series.insert(
        0,
        Series {
            name: "frontier".into(),
            look: Look::Black,
            line: Line::Stair,
            points: points.collect(),
        },
    );
    chart
}

/// Error over query time on this computer, beside the peer's.
pub fn time_chart(entries: &[Entry]) -> Chart {
    Chart {
        title: "Accuracy against the time of a query on a PC".into(),
        note: "Median over scene P's poses: gap, depth and all contacts for ours, one distance or depth for parry3d. Down and left is better.".into(),
        x: Axis::new("median query, µs"),
        y: Axis::new("largest error on scene P, µm"),
        series: series(entries, |entry| 1e-3 * entry.query_ns, false),
    }
}

fn series(entries: &[Entry], x: impl Fn(&Entry) -> f64, bytes: bool) -> Vec<Series> {
    let mut series: Vec<Series> = Vec::new();
    for entry in entries {
        let place = series.iter().position(|series| series.name == entry.kind);
        let place = place.unwrap_or_else(|| {
            series.push(Series {
                name: entry.kind.clone(),
                look: Look::nth(series.len()),
                line: Line::None,
                points: Vec::new(),
            });
            series.len() - 1
        });
        let label = match (entry.cell_mm, entry.epsilon_mm, entry.image_bytes) {
            (Some(cell), _, Some(size)) if bytes && entry.on_frontier => {
                format!("{cell} mm, {} KiB", (size as f64 / 1024.0).round())
            }
            // The textbook's error bound adds nothing to a label: its error is the same at every cell.
            (Some(cell), ..) if !bytes || entry.epsilon_mm.is_none() => format!("{cell} mm"),
            (None, Some(deflection), _) => format!("{} µm mesh", 1e3 * deflection),
            _ => String::new(),
        };
        series[place].points.push(Point {
            x: x(entry),
            y: entry.error_um(),
            label,
            at_least: false,
        });
    }
    // A kind without a value on this axis is not listed in the legend.
    series.retain(|series| series.points.iter().any(|point| point.x.is_finite()));
    series
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.kind)?;
        if let Some(cell) = self.cell_mm {
            write!(f, ", {cell} mm cells")?;
        }
        if let Some(epsilon) = self.epsilon_mm {
            write!(f, ", ε = {:.1} µm", 1e3 * epsilon)?;
        }
        write!(
            f,
            ": gap {:.1} µm, penetration {:.1} µm off; {:.1} µs a query",
            self.gap_error_um,
            self.penetration_error_um,
            1e-3 * self.query_ns
        )?;
        if let Some(instructions) = self.instructions {
            write!(f, "; {instructions} instructions")?;
        }
        if let Some(percent) = self.left_out_percent {
            write!(f, ", {percent} % of ticks left out points")?;
        }
        if let Some(bytes) = self.image_bytes {
            write!(f, "; {bytes} bytes")?;
        }
        if let Some(smallest) = self.smallest_clearance_um {
            write!(f, "; assembles down to {smallest} µm")?;
        }
        Ok(())
    }
}

/// The experiment `pareto`.
pub struct Pareto;

impl Experiment for Pareto {
    fn name(&self) -> &'static str {
        "pareto"
    }

    fn about(&self) -> &'static str {
        "Hold accuracy against cost: error, smallest clearance, instructions, nanoseconds, bytes"
    }

    fn quick(&self) -> &'static str {
        "fewer models"
    }

    fn rows(&self) -> Vec<String> {
        ["pareto"].map(String::from).into()
    }

    fn charts(&self) -> Vec<String> {
        ["pareto-ticks", "pareto-time"].map(String::from).into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let entries = sweep(form.quick, &mut |entry| report(entry))?;
        Ok(Findings::default()
            .rows("pareto", &entries)?
            .chart("pareto-ticks", ticks_chart(&entries))
            .chart("pareto-time", time_chart(&entries)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_swept_once() {
        let all: Vec<Variant> = variants(false).into_iter().map(|(variant, _)| variant).collect();
        let mut wanted = Vec::new();
        for cell in CELLS_MM {
            wanted.push(Variant::textbook(cell));
            for format in [SampleFormat::Int8, SampleFormat::Int16] {
                for epsilon in [0.1 * cell, 0.01 * cell] {
                    wanted.push(
                        (Variant::field(cell).format(format))
                            .epsilon_mm(epsilon)
                            .reach_mm(REACH_MM),
                    );
                }
            }
        }
        assert_eq!(all.len(), wanted.len());
        for variant in wanted {
            assert_eq!(
                all.iter().filter(|&&other| other == variant).count(),
                1,
                "{variant}"
            );
        }
    }

    #[test]
    fn only_what_nothing_beats_is_on_the_frontier() {
        let entry = |error: f64, instructions| Entry {
            kind: "kind".into(),
            cell_mm: Some(1.0),
            epsilon_mm: None,
            gap_error_um: error,
            penetration_error_um: 0.5 * error,
            smallest_clearance_um: None,
            instructions,
            left_out_percent: instructions.map(|_| 0.0),
            query_ns: 1.0,
            image_bytes: Some(1),
            on_frontier: false,
        };
        let mut entries = [
            entry(1.0, Some(100)),
            entry(2.0, Some(50)),
            entry(2.0, Some(60)),
            entry(3.0, Some(70)),
            entry(0.5, None),
        ];
        mark(&mut entries);
        let marked: Vec<bool> = entries.iter().map(|entry| entry.on_frontier).collect();
        assert_eq!(marked, [true, true, false, false, false]);
        let chart = ticks_chart(&entries);
        assert_eq!(chart.series[0].points.len(), 2);
    }
}

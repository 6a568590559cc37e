//! The smallest clearance that assembles: a peg pushed into its hole by a trembling hand, without constraints.
//!
//! The scenario is `host/lab/data/tight_insertion.toml`. For each model of the scene, bisection finds the limit between success and failure, assuming
//! that a model that succeeds at one clearance succeeds at all larger ones. The hand is 0.3 mm off the axis and leans by 2°, so that the peg is
//! pressed against both sides of its hole all the way. A trial succeeds when the peg reaches the hand's end position, no surface lies deeper in
//! another in any tick than the radial clearance (closed form, see `exact_fit`: else it went through the wall, not the hole), and the force on the
//! handle stays within 3 N.

use std::fmt;

use mortise_bake::{Grabbable, SampleFormat};
use mortise_rig::RigSpec;
use mortise_scenario::{Bounds, Outcome, PreparedScene, Scenario, ScenarioError, connect, record};
use serde::Serialize;

use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::error::LabError;
use crate::exact_fit::made_from;
use crate::experiment::{Experiment, Findings, Form, Report};
use crate::fit::Fit;
use crate::variant::Variant;

const SCENARIO: &str = include_str!("../data/tight_insertion.toml");

/// Diametral clearances tried, mm, descending.
pub const CLEARANCES_MM: [f64; 12] = [10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002];
/// Cells tried, mm, descending.
pub const CELLS_MM: [f64; 5] = [4.0, 2.0, 1.0, 0.5, 0.25];

/// One insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Method and number format.
    pub kind: &'static str,
    /// Cell edge, mm.
    pub cell_mm: f64,
    /// Hole's diameter less the peg's, mm.
    pub clearance_mm: f64,
    /// True if the trial succeeds.
    pub goes: bool,
    /// The condition that fails, if one does; empty otherwise.
    pub why: String,
    /// Depth that the peg reached, mm; the hole is 40 mm deep.
    pub inserted_mm: Option<f64>,
    /// Deepest penetration in any tick, closed form, mm.
    pub penetration_mm: Option<f64>,
    /// Largest force on the handle, N.
    pub peak_force_n: Option<f64>,
    /// Ticks with decimated points, %.
    pub left_out_percent: Option<f64>,
    /// Bytes of the scene image.
    pub image_bytes: Option<usize>,
}

/// Plays one insertion on the rig `spec`.
///
/// # Errors
/// Anything that prevents playing the insertion, except a fault of the board, which only makes the trial fail.
pub fn trial(variant: &Variant, fit: &Fit, spec: &RigSpec) -> Result<(Trial, Option<Outcome>), LabError> {
    let file = fit.file()?;
    let mut scenario = Scenario::parse(SCENARIO, "tight_insertion")?;
    scenario.scene.step = file.path().to_owned();
    let deepest = Bounds {
        min: 0.0,
        max: 0.5 * fit.clearance_mm(),
        only_on: None,
    };
    scenario.holds.insert("penetration_mm".into(), deepest);
    let options = variant.options(Grabbable::Named(vec![scenario.scene.part.clone()]));
    let scene = made_from(PreparedScene::with(&scenario, &options)?, *fit);
    let mut trial = Trial {
        kind: variant.kind(),
        cell_mm: variant.cell_mm,
        clearance_mm: fit.clearance_mm(),
        goes: false,
        why: String::new(),
        inserted_mm: None,
        penetration_mm: None,
        peak_force_n: None,
        left_out_percent: None,
        image_bytes: Some(scene.image.len()),
    };
    let recording = match record(&connect(&scenario, spec)?, &scenario, &scene, None) {
        Ok(recording) => recording,
        Err(fault @ ScenarioError::Fault { .. }) => {
            trial.why = fault.to_string();
            return Ok((trial, None));
        }
        Err(error) => return Err(error.into()),
    };
    let outcome = recording.outcome;
    let verdicts = outcome.verdicts(&scenario.holds);
    let broken: Vec<String> = (verdicts.iter().filter(|verdict| !verdict.holds))
        .map(|verdict| verdict.what.clone())
        .collect();
    trial.goes = broken.is_empty();
    trial.why = broken.join(" ");
    trial.inserted_mm = outcome.inserted_mm;
    trial.penetration_mm = Some(outcome.penetration_mm);
    trial.peak_force_n = Some(outcome.peak_force_n);
    trial.left_out_percent = Some(outcome.degraded_percent);
    Ok((trial, Some(outcome)))
}

/// Bisects `clearances_mm` (descending) on the in-process rig; passes each trial to `out`. Returns the smallest clearance that succeeds, mm: the next
/// smaller one, if there is one, was tried and fails.
///
/// # Errors
/// As [`trial`].
pub fn smallest(
    variant: &Variant,
    clearances_mm: &[f64],
    out: &mut dyn FnMut(Trial),
) -> Result<Option<f64>, LabError> {
    let simulated = RigSpec::Simulated { realtime: false };
    let (mut goes, mut stuck) = (0, clearances_mm.len());
    // All indices before `goes` succeed, all from `stuck` on fail.
    while goes < stuck {
        let middle = usize::midpoint(goes, stuck);
        let (trial, _) = trial(variant, &Fit::thesis(clearances_mm[middle]), &simulated)?;
        if trial.goes {
            goes = middle + 1;
        } else {
            stuck = middle;
        }
        out(trial);
    }
    Ok(goes.checked_sub(1).map(|last| clearances_mm[last]))
}

/// The models of the scene that the chart compares; `quick` has one cell of each kind.
pub fn variants(quick: bool) -> Vec<Variant> {
    let cells: &[f64] = if quick { &[1.0] } else { &CELLS_MM };
    let kinds: [fn(f64) -> Variant; 3] = [Variant::textbook, Variant::field, |cell| {
        Variant::field(cell).format(SampleFormat::Int8)
    }];
    (kinds.iter())
        .flat_map(|kind| cells.iter().map(|&cell| kind(cell)))
        .collect()
}

/// Smallest clearance over cell size, one line for each kind.
pub fn chart(trials: &[Trial]) -> Chart {
    let mut series: Vec<Series> = Vec::new();
    for trial in trials {
        let place = series.iter().position(|series| series.name == trial.kind);
        let place = place.unwrap_or_else(|| {
            series.push(Series {
                name: trial.kind.to_owned(),
                look: Look::nth(series.len()),
                line: Line::Solid,
                points: Vec::new(),
            });
            series.len() - 1
        });
        let points = &mut series[place].points;
        let at = points.iter().position(|point| point.x == trial.cell_mm);
        let at = at.unwrap_or_else(|| {
            points.push(Point {
                x: trial.cell_mm,
                at_least: true,
                ..Point::default()
            });
            points.len() - 1
        });
        let (point, um) = (&mut points[at], 1e3 * trial.clearance_mm);
        if trial.goes && (point.at_least || um < point.y) {
            point.y = um;
            point.label = format!("{} µm", (um * 10.0).round() / 10.0);
            point.at_least = false;
        } else if !trial.goes && point.at_least && um > point.y {
            // Start from the largest clearance tried, a lower bound until a trial succeeds.
            point.y = um;
            point.label = format!("not even {} mm", trial.clearance_mm);
        }
    }
    Chart {
        title: "Smallest clearance that assembles, by method and cell".into(),
        note: "Peg ø18.75 mm, 1 mm engaged, no chamfer, no guidance; hand 0.3 mm and 2° off with 0.1 mm tremor at 10 Hz. Lower is better.".into(),
        x: Axis::new("cell edge, mm").with_ticks(&CELLS_MM),
        y: Axis::new("smallest diametral clearance, µm"),
        series,
    }
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = if self.goes { "goes" } else { "does not go" };
        write!(
            f,
            "{}, {} mm cells, clearance {} mm: {verdict}",
            self.kind, self.cell_mm, self.clearance_mm
        )?;
        if let (Some(inserted), Some(penetration), Some(force)) =
            (self.inserted_mm, self.penetration_mm, self.peak_force_n)
        {
            write!(
                f,
                "; {inserted:.2} mm in, {:.1} µm deep, {force:.2} N",
                1e3 * penetration
            )?;
        }
        if self.why.is_empty() {
            Ok(())
        } else {
            write!(f, " ({})", self.why)
        }
    }
}

/// The experiment `clearance`.
pub struct Clearance;

impl Experiment for Clearance {
    fn name(&self) -> &'static str {
        "clearance"
    }

    fn about(&self) -> &'static str {
        "Find the smallest clearance that assembles, by method and cell"
    }

    fn quick(&self) -> &'static str {
        "one cell of each kind"
    }

    fn rows(&self) -> Vec<String> {
        ["clearance"].map(String::from).into()
    }

    fn charts(&self) -> Vec<String> {
        ["clearance"].map(String::from).into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let mut trials = Vec::new();
        for variant in variants(form.quick) {
            smallest(&variant, &CLEARANCES_MM, &mut |trial| {
                report(&trial);
                trials.push(trial);
            })?;
        }
        Ok(Findings::default()
            .rows("clearance", &trials)?
            .chart("clearance", chart(&trials)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The textbook's voxels are wider than the gap, whatever the hand does; analytic faces do not depend on the cell.
    #[test]
    fn a_field_goes_where_voxels_stick() {
        let simulated = RigSpec::Simulated { realtime: false };
        let goes = |variant: Variant| {
            let (trial, _) = trial(&variant, &Fit::thesis(0.2), &simulated).expect("played");
            trial
        };
        let field = goes(Variant::field(0.5));
        assert!(field.goes, "{field}");
        let voxels = goes(Variant::textbook(0.5));
        assert!(!voxels.goes && !voxels.why.is_empty(), "{voxels}");
    }

    /// A leaning peg leaves its hole with one side pressed against the rim. It once hooked behind the rim and stopped 40.05 mm deep of 42, because
    /// the samples of the rim stood 0.2 µm, the depth of its side in the wall, in front of the peg's end.
    #[test]
    fn a_leaning_peg_does_not_hook_behind_the_rim() {
        let simulated = RigSpec::Simulated { realtime: false };
        for (cell_mm, clearance_mm) in [(0.5, 0.1), (0.5, 0.02)] {
            let fit = Fit::thesis(clearance_mm);
            let (trial, _) = trial(&Variant::field(cell_mm), &fit, &simulated).expect("played");
            println!("{trial}");
            assert!(
                trial.inserted_mm.is_some_and(|inserted| inserted > 41.5),
                "{trial}"
            );
            // Where a leaning peg is wedged between both rims their spans bear several newtons, 2.5 µm each.
            assert!(trial.penetration_mm.is_some_and(|deep| deep < 7e-3), "{trial}");
        }
    }

    #[test]
    fn the_chart_marks_what_never_goes() {
        let trial = |cell_mm, clearance_mm, goes| Trial {
            kind: "kind",
            cell_mm,
            clearance_mm,
            goes,
            why: String::new(),
            inserted_mm: None,
            penetration_mm: None,
            peak_force_n: None,
            left_out_percent: None,
            image_bytes: None,
        };
        // In the order in which bisection tries them.
        let trials = [
            trial(2.0, 0.5, false),
            trial(2.0, 1.0, false),
            trial(1.0, 0.5, true),
            trial(1.0, 0.2, false),
            trial(1.0, 1.0, true),
        ];
        let chart = chart(&trials);
        assert_eq!(chart.series.len(), 1);
        let points: Vec<(f64, f64, bool)> = (chart.series[0].points.iter())
            .map(|point| (point.x, point.y, point.at_least))
            .collect();
        assert_eq!(points, [(2.0, 1000.0, true), (1.0, 500.0, false)]);
    }
}

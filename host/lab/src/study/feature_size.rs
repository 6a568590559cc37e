//! The effect of a feature's size, and the voxel that a fit requires: the second study of Faas 2010, chapter 7, repeated.
//!
//! 62 trials with pegs of 15 to 95 mm, hole diameters drawn at random, points shrunk by half a voxel (table 2); voxels of 2.0 and 0.4 mm, the same
//! for peg and hole as in the thesis' formula (section 7.3). As in the thesis, the voxel size of the successful trials is then fitted by least
//! squares with the two diameters as terms: tables 4 and 5, eq. 20. The thesis does not state how holes were drawn; here they are wider than the peg
//! by up to [`WIDEST_MM`]. Peg and block scale with the hole: the block 3 × 3 × 1.5 diameters, the peg 2 diameters long (own choice).

use std::fmt;

use serde::Serialize;

use super::faas::{EQ_20, R_SQUARED, TABLE_4, TABLE_4_F, TABLE_5};
use super::operator::{Hand, Task};
use super::statistics::{Logistic, Regression, Term};
use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::experiment::{Experiment, Findings, Form, Report};
use crate::fit::Fit;
use crate::table::rounded;

/// Diameters of the pegs, mm.
pub const PEGS_MM: [f64; 5] = [15.0, 35.0, 55.0, 75.0, 95.0];
/// Voxels, mm.
pub const VOXELS_MM: [f64; 2] = [2.0, 0.4];
/// Distance by which points are moved inward, voxels.
pub const SHRINKING: f64 = 0.5;
/// Largest diametral clearance drawn, mm: two of the larger voxels.
pub const WIDEST_MM: f64 = 4.0;
/// Trials of a combination, and of those with the smallest peg.
const TRIALS: usize = 6;
const TRIALS_SMALLEST: usize = 7;
/// Largest peg of the shorter form, mm.
const QUICK_MM: f64 = 35.0;

/// One insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Diameter of the peg, mm.
    pub peg_mm: f64,
    /// Diameter of the hole, mm.
    pub hole_mm: f64,
    /// Edge of a voxel, mm.
    pub voxel_mm: f64,
    /// True if the peg came through.
    pub through: bool,
    /// Depth that it reached, as a share of the hole's depth.
    pub share_inserted: Option<f64>,
    /// Largest force on the handle, N.
    pub peak_n: Option<f64>,
    /// Share of ticks with decimated points, %.
    pub degraded_percent: Option<f64>,
}

/// A number of tables 4 and 5 or eq. 20, in the thesis and here.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    /// Table or equation.
    pub of: &'static str,
    /// Quantity.
    pub what: String,
    /// As printed.
    pub faas: f64,
    /// Own value; absent where it cannot be computed.
    pub ours: Option<f64>,
}

/// Results of the study.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Study {
    /// 62 trials, fewer in the quick form.
    pub trials: Vec<Trial>,
    /// Tables 4 and 5, eq. 20.
    pub table: Vec<Compared>,
    /// Effect of peg, clearance and voxel on success: the logistic model of the first study.
    pub terms: Vec<Term>,
}

/// A result of the study.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
pub enum Found<'s> {
    /// A trial.
    Trial(&'s Trial),
    /// A number of a table.
    Compared(&'s Compared),
    /// The effect of a term.
    Term(&'s Term),
}

/// The peg of this diameter in its hole.
fn fit(peg_mm: f64, clearance_mm: f64) -> Fit {
    Fit {
        width_mm: 3.0 * peg_mm,
        height_mm: 1.5 * peg_mm,
        hole_mm: peg_mm + clearance_mm,
        peg_mm,
        length_mm: 2.0 * peg_mm,
        engaged_mm: 0.0,
    }
}

/// Runs the study; `quick` uses the two smallest pegs only. Passes each result to `out`.
///
/// # Errors
/// Anything that prevents a trial from being played.
pub fn study(quick: bool, out: &mut dyn FnMut(Found<'_>)) -> Result<Study, LabError> {
    let mut study = Study::default();
    let mut random = fastrand::Rng::with_seed(2010);
    for peg in PEGS_MM.into_iter().filter(|&peg| !quick || peg <= QUICK_MM) {
        for voxel in VOXELS_MM {
            let count = if peg == PEGS_MM[0] {
                TRIALS_SMALLEST
            } else {
                TRIALS
            };
            for _ in 0..count {
                let fit = fit(peg, rounded(WIDEST_MM * (1.0 - random.f64()), 3).max(0.001));
                let task = Task::voxels(&fit, voxel, voxel)?;
                let went = task.tried(&Hand::of(study.trials.len() as u64), SHRINKING)?;
                let trial = Trial {
                    peg_mm: peg,
                    hole_mm: fit.hole_mm,
                    voxel_mm: voxel,
                    through: went.through,
                    share_inserted: (went.inserted_mm).map(|deep| rounded(deep / fit.height_mm, 4)),
                    peak_n: went.peak_n.map(|force| rounded(force, 3)),
                    degraded_percent: went.degraded_percent.map(|share| rounded(share, 1)),
                };
                out(Found::Trial(&trial));
                study.trials.push(trial);
            }
        }
    }
    study.table = compared(&study.trials);
    study.table.iter().for_each(|row| out(Found::Compared(row)));
    let (values, went): (Vec<Vec<f64>>, Vec<bool>) = (study.trials.iter())
        .map(|t| (vec![t.peg_mm, t.hole_mm - t.peg_mm, t.voxel_mm], t.through))
        .unzip();
    let names = ["peg, mm", "clearance, mm", "voxel, mm"];
    study.terms = Logistic::terms(&names, &values, &went).unwrap_or_default();
    study.terms.iter().for_each(|term| out(Found::Term(term)));
    Ok(study)
}

/// Tables 4 and 5 and eq. 20 from the successful trials, voxel sizes in mm.
fn compared(trials: &[Trial]) -> Vec<Compared> {
    let (x, y): (Vec<Vec<f64>>, Vec<f64>) = (trials.iter().filter(|trial| trial.through))
        .map(|t| (vec![t.peg_mm, t.hole_mm], t.voxel_mm))
        .unzip();
    let found = Regression::fit(&x, &y);
    let ours = |of: fn(&Regression) -> f64, digits| found.as_ref().map(|found| rounded(of(found), digits));
    let row = |of, what: &str, faas, ours| Compared {
        of,
        what: what.to_owned(),
        faas,
        ours,
    };
    let [model, error, total] = TABLE_4;
    let [peg, hole] = TABLE_5;
    vec![
        row(
            "table 4",
            "trials that went",
            (total.1 + 1) as f64,
            Some(y.len() as f64),
        ),
        row("table 4", "sum of squares, model", model.2, ours(|r| r.model, 4)),
        row("table 4", "sum of squares, error", error.2, ours(|r| r.error, 4)),
        row("table 4", "F ratio", TABLE_4_F, ours(Regression::f_ratio, 3)),
        row("table 4", "R²", R_SQUARED, ours(Regression::r_squared, 4)),
        row(
            "table 5",
            "F of the peg's diameter",
            peg.statistic,
            ours(|r| r.effects[0][1], 3),
        ),
        row(
            "table 5",
            "p of the peg's diameter (hers: below)",
            peg.p,
            ours(|r| r.effects[0][2], 6),
        ),
        row(
            "table 5",
            "F of the hole's diameter",
            hole.statistic,
            ours(|r| r.effects[1][1], 3),
        ),
        row(
            "table 5",
            "p of the hole's diameter (hers: below)",
            hole.p,
            ours(|r| r.effects[1][2], 6),
        ),
        row(
            "eq. 20",
            "voxel per mm of the hole's diameter",
            EQ_20.0,
            ours(|r| r.coefficients[2], 4),
        ),
        row(
            "eq. 20",
            "voxel per mm of the peg's diameter",
            -EQ_20.0,
            ours(|r| r.coefficients[1], 4),
        ),
        row("eq. 20", "constant", EQ_20.1, ours(|r| r.coefficients[0], 4)),
    ]
}

/// Success of trials over diameter of the peg and clearance.
pub fn chart(study: &Study) -> Chart {
    let kinds = [(2.0, true), (2.0, false), (0.4, true), (0.4, false)];
    let looks = [
        Look::VermilionSquare,
        Look::OrangeCross,
        Look::BlueDisc,
        Look::SkyRing,
    ];
    Chart {
        title: "Does a feature's size matter? Trials by peg, clearance and voxel".into(),
        note: format!(
            "{} trials, textbook voxmap, points shrunk by {SHRINKING} voxels, unguided; hand off by up to half the play and 0.5°.",
            study.trials.len()
        ),
        x: Axis::new("diameter of the peg, mm").linear().with_ticks(&PEGS_MM),
        y: Axis::new("diametral clearance, mm").linear(),
        series: (kinds.iter().zip(looks))
            .map(|(&(voxel, through), look)| Series {
                name: format!(
                    "voxels of {voxel} mm, {}",
                    if through { "through" } else { "stuck" }
                ),
                look,
                line: Line::None,
                points: (study.trials.iter())
                    .filter(|trial| trial.voxel_mm == voxel && trial.through == through)
                    .map(|trial| Point {
                        x: trial.peg_mm,
                        y: trial.hole_mm - trial.peg_mm,
                        ..Point::default()
                    })
                    .collect(),
            })
            .collect(),
    }
}

impl fmt::Display for Found<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Trial(t) => {
                write!(
                    f,
                    "peg {} mm, hole {} mm, voxel {} mm: ",
                    t.peg_mm, t.hole_mm, t.voxel_mm
                )?;
                write!(f, "{}", if t.through { "through" } else { "stuck" })?;
                match (t.share_inserted, t.peak_n) {
                    (Some(share), Some(force)) => {
                        write!(f, ", {:.0} % of the hole, at most {force:.2} N", 100.0 * share)?;
                    }
                    _ => write!(f, ", the board gave up")?,
                }
                match t.degraded_percent {
                    Some(share) if share > 0.0 => write!(f, ", points left out in {share} % of ticks"),
                    _ => Ok(()),
                }
            }
            Self::Compared(row) => match row.ours {
                Some(ours) => write!(f, "{}, {}: Faas {}, ours {ours}", row.of, row.what, row.faas),
                None => write!(
                    f,
                    "{}, {}: Faas {}, ours not to be had",
                    row.of, row.what, row.faas
                ),
            },
            Self::Term(term) => write!(f, "{term}"),
        }
    }
}

/// The experiment `feature-size`.
pub struct FeatureSize;

impl Experiment for FeatureSize {
    fn name(&self) -> &'static str {
        "feature-size"
    }

    fn about(&self) -> &'static str {
        "Whether a feature's size matters: 62 trials by a simulated operator, beside tables 4 and 5 of the thesis"
    }

    fn quick(&self) -> &'static str {
        "the two smallest pegs"
    }

    fn rows(&self) -> Vec<String> {
        ["feature-size", "feature-size-model", "feature-size-tables-4-5"]
            .map(String::from)
            .into()
    }

    fn charts(&self) -> Vec<String> {
        ["feature-size"].map(String::from).into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let study = study(form.quick, &mut |found| report(&found))?;
        Ok(Findings::default()
            .rows("feature-size", &study.trials)?
            .rows("feature-size-tables-4-5", &study.table)?
            .rows("feature-size-model", &study.terms)?
            .chart("feature-size", chart(&study)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_62_trials() {
        let all = PEGS_MM.len() * TRIALS + TRIALS_SMALLEST - TRIALS;
        assert_eq!(VOXELS_MM.len() * all, 62);
    }
}

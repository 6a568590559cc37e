//! Which voxels let a peg into its hole, and what shrinking the pointshell does: 27 trials, and the rule for a voxel's size.
//!
//! Chapter 7 of Faas 2010 varies voxel, clearance (2.5, 1.4, 1.0 mm) and shrinking in 27 trials and fits a rule for the voxel's size by least squares
//! (eq. 20). The trials here are all combinations of three of each, by the textbook's voxmap and pointshell; voxels and shares shrunk are ours.
//! The rule comes from the largest voxel that goes in at each clearance, with the operator's worst hand.

use std::fmt;

use serde::Serialize;

use super::operator::{Hand, Task};
use super::statistics::{LeastSquares, Logistic, Term};
use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::fit::Fit;
use crate::table::rounded;
use crate::variant::Variant;

/// Diametral clearances, mm.
pub const CLEARANCES_MM: [f64; 3] = [2.5, 1.4, 1.0];
/// Voxels, mm.
const VOXELS_MM: [f64; 3] = [2.0, 1.0, 0.5];
/// How far points are moved inward, percent of a voxel.
const SHRINKS_PERCENT: [f64; 3] = [0.0, 50.0, 100.0];
/// Those the rule is looked for with.
const RULES_PERCENT: [f64; 2] = [0.0, 100.0];
/// Voxels over clearance that the rule is looked for among, descending.
const LADDER: [f64; 12] = [2.0, 1.7, 1.4, 1.2, 1.0, 0.85, 0.7, 0.6, 0.5, 0.4, 0.3, 0.25];

/// Eq. 20 of Faas 2010 as printed: voxel over clearance.
const EQ_20: LeastSquares = LeastSquares {
    slope: 0.027,
    intercept: -0.001,
    r_squared: f64::NAN,
};
/// Its units are not said with it: a centimetre, should it give centimetres for millimetres.
const MM_PER_CM: f64 = 10.0;

/// One insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Method.
    pub method: &'static str,
    /// Edge of voxels or cells, mm.
    pub voxel_mm: f64,
    /// Hole's diameter less the peg's, mm.
    pub clearance_mm: f64,
    /// How far points were moved inward, percent of a voxel; absent where points lie on the exact surface.
    pub shrink_percent: Option<f64>,
    /// Whether the peg came through.
    pub through: bool,
    /// How far it came, mm; the hole is 40 mm deep.
    pub inserted_mm: Option<f64>,
    /// Largest force on the handle, N.
    pub peak_n: Option<f64>,
    /// Share of ticks that left out points, %.
    pub degraded_percent: Option<f64>,
}

/// The largest voxel that goes in.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Largest {
    /// Percent of a voxel.
    pub shrink_percent: f64,
    /// Hole's diameter less the peg's, mm.
    pub clearance_mm: f64,
    /// The voxel, mm; absent when none of the ladder does.
    pub voxel_mm: Option<f64>,
}

/// The rule for a voxel's size: voxel = slope·clearance + intercept.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rule {
    /// Percent of a voxel.
    pub shrink_percent: f64,
    /// Voxel over clearance, mm/mm, and mm.
    #[serde(flatten)]
    pub line: LeastSquares,
}

/// What the study found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Study {
    /// By the textbook, 27 unless quick.
    pub trials: Vec<Trial>,
    /// By the distance field, one for each voxel and clearance.
    pub ours: Vec<Trial>,
    /// What voxel, clearance and shrinking explain.
    pub terms: Vec<Term>,
    /// What the rules are made of.
    pub largest: Vec<Largest>,
    /// One for each share shrunk.
    pub rules: Vec<Rule>,
}

/// Makes the study; `quick` has one clearance only and no rule. What is found goes to `out` as words and rows.
///
/// # Errors
/// Anything that keeps a trial from being played.
pub fn study(quick: bool, out: &mut dyn FnMut(Found<'_>)) -> Result<Study, LabError> {
    let clearances = &CLEARANCES_MM[..if quick { 1 } else { CLEARANCES_MM.len() }];
    let mut study = Study::default();
    for &clearance in clearances {
        for voxel in VOXELS_MM {
            for shrink in SHRINKS_PERCENT {
                let hand = Hand::of(study.trials.len() as u64);
                let trial = trial(&Variant::shrunk(voxel, shrink), clearance, Some(shrink), &hand)?;
                out(Found::Trial(&trial));
                study.trials.push(trial);
            }
            let trial = trial(&Variant::field(voxel), clearance, None, &Hand::WORST)?;
            out(Found::Trial(&trial));
            study.ours.push(trial);
        }
    }
    let (values, went): (Vec<Vec<f64>>, Vec<bool>) = (study.trials.iter())
        .map(|t| {
            (
                vec![t.voxel_mm, t.clearance_mm, t.shrink_percent.unwrap_or(0.0)],
                t.through,
            )
        })
        .unzip();
    if !quick {
        let names = ["voxel, mm", "clearance, mm", "shrinking, %"];
        study.terms = Logistic::terms(&names, &values, &went).unwrap_or_default();
        study.terms.iter().for_each(|term| out(Found::Term(term)));
        for shrink in RULES_PERCENT {
            let rule = rule(shrink, &mut study.largest, out)?;
            study.rules.extend(rule);
        }
        study.rules.iter().for_each(|rule| out(Found::Rule(rule)));
    }
    Ok(study)
}

fn trial(variant: &Variant, clearance: f64, shrink: Option<f64>, hand: &Hand) -> Result<Trial, LabError> {
    let went = Task::new(&Fit::thesis(clearance), variant)?.tried(hand)?;
    Ok(Trial {
        method: variant.kind(),
        voxel_mm: variant.cell_mm,
        clearance_mm: clearance,
        shrink_percent: shrink,
        through: went.through,
        inserted_mm: went.inserted_mm.map(|deep| rounded(deep, 3)),
        peak_n: went.peak_n.map(|force| rounded(force, 3)),
        degraded_percent: went.degraded_percent.map(|share| rounded(share, 1)),
    })
}

/// The largest voxel of the ladder at each clearance, and the line through them.
fn rule(
    shrink: f64,
    largest: &mut Vec<Largest>,
    out: &mut dyn FnMut(Found<'_>),
) -> Result<Option<Rule>, LabError> {
    let mut points = Vec::new();
    for clearance in CLEARANCES_MM {
        let mut found = Largest {
            shrink_percent: shrink,
            clearance_mm: clearance,
            voxel_mm: None,
        };
        for ratio in LADDER {
            let voxel = rounded(ratio * clearance, 3);
            if trial(
                &Variant::shrunk(voxel, shrink),
                clearance,
                Some(shrink),
                &Hand::WORST,
            )?
            .through
            {
                found.voxel_mm = Some(voxel);
                points.push((clearance, voxel));
                break;
            }
        }
        out(Found::Largest(&found));
        largest.push(found);
    }
    Ok(LeastSquares::through(&points).map(|line| Rule {
        shrink_percent: shrink,
        line,
    }))
}

/// Something the study found.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
pub enum Found<'s> {
    /// A trial.
    Trial(&'s Trial),
    /// What a term explains.
    Term(&'s Term),
    /// The largest voxel that goes in.
    Largest(&'s Largest),
    /// A rule.
    Rule(&'s Rule),
}

/// Largest voxel over clearance, with the lines through them, beside eq. 20.
pub fn chart(study: &Study) -> Chart {
    let looks = [Look::VermilionSquare, Look::BlueDisc];
    let span = [CLEARANCES_MM[2], CLEARANCES_MM[0]];
    let mut series: Vec<Series> = (study.rules.iter().zip(looks))
        .map(|(rule, look)| Series {
            name: format!(
                "shrunk by {} %: {:.2}·C {} {:.2}",
                rule.shrink_percent,
                rule.line.slope,
                if rule.line.intercept < 0.0 { '−' } else { '+' },
                rule.line.intercept.abs()
            ),
            look,
            line: Line::None,
            points: (study.largest.iter())
                .filter(|largest| largest.shrink_percent == rule.shrink_percent)
                .filter_map(|largest| {
                    let voxel = largest.voxel_mm?;
                    Some(Point {
                        x: largest.clearance_mm,
                        y: voxel,
                        label: format!("{voxel} mm"),
                        // None larger was tried.
                        at_least: voxel > 0.999 * LADDER[0] * largest.clearance_mm,
                    })
                })
                .collect(),
        })
        .collect();
    let line = |of: &LeastSquares, unit: f64, name: &str, look, line| Series {
        name: name.to_owned(),
        look,
        line,
        points: span
            .map(|x| Point {
                x,
                y: unit * of.at(x),
                ..Point::default()
            })
            .to_vec(),
    };
    for (rule, look) in study.rules.iter().zip(looks) {
        series.push(line(&rule.line, 1.0, "", look, Line::Trace));
    }
    let printed = "Faas 2010, eq. 20: 0.027·C − 0.001";
    series.push(line(&EQ_20, 1.0, printed, Look::Black, Line::DashedTrace));
    series.push(line(
        &EQ_20,
        MM_PER_CM,
        "the same, read as centimetres for millimetres",
        Look::PurpleDiamond,
        Line::DashedTrace,
    ));
    Chart {
        title: "Largest voxel that lets a peg through its hole, textbook voxmap".into(),
        note: "Peg in ø18.75 mm × 40 mm, unguided; hand off by half the play and 0.5° tilted, 0.1 mm tremor. Lines: least squares.".into(),
        x: Axis::new("diametral clearance C, mm").with_ticks(&[1.0, 1.4, 2.5]),
        y: Axis::new("voxel, mm"),
        series,
    }
}

impl fmt::Display for Found<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Trial(trial) => {
                write!(
                    f,
                    "{}, voxel {} mm, clearance {} mm",
                    trial.method, trial.voxel_mm, trial.clearance_mm
                )?;
                if let Some(shrink) = trial.shrink_percent {
                    write!(f, ", shrunk by {shrink} %")?;
                }
                write!(f, ": {}", if trial.through { "through" } else { "stuck" })?;
                match (trial.inserted_mm, trial.peak_n) {
                    (Some(deep), Some(force)) => write!(f, ", {deep:.1} mm in, at most {force:.2} N"),
                    _ => write!(f, ", the board gave up"),
                }
            }
            Self::Term(term) => write!(f, "{term}"),
            Self::Largest(largest) => {
                write!(
                    f,
                    "shrunk by {} %, clearance {} mm: ",
                    largest.shrink_percent, largest.clearance_mm
                )?;
                match largest.voxel_mm {
                    Some(voxel) => write!(f, "the largest voxel that goes is {voxel} mm"),
                    None => write!(
                        f,
                        "no voxel down to {} of the clearance goes",
                        LADDER[LADDER.len() - 1]
                    ),
                }
            }
            Self::Rule(rule) => write!(
                f,
                "shrunk by {} %: voxel = {:.3}·C {} {:.3} mm (R² = {:.3}); eq. 20 of the thesis: 0.027·C − 0.001, its units not said",
                rule.shrink_percent,
                rule.line.slope,
                if rule.line.intercept < 0.0 { '−' } else { '+' },
                rule.line.intercept.abs(),
                rule.line.r_squared
            ),
        }
    }
}

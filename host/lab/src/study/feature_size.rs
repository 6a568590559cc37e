//! Whether a feature's size matters: 62 trials with pegs of 15 to 95 mm, voxels of 2.0 and 0.4 mm.
//!
//! Chapter 7 of Faas 2010 has 62 trials over these diameters and voxels. Here each combination is tried six times, with a hand drawn anew, and the
//! smallest peg a seventh time with each voxel. Peg and block are as large as their hole: the block 3 × 3 × 1.5 diameters, the peg 2 diameters long,
//! 1 mm clearance (ours). Contact is the textbook's, its points moved inward by [`SHRINK_PERCENT`] unless said otherwise: where they are not, no
//! trial goes.

use std::fmt;

use serde::Serialize;

use super::operator::{Hand, Task};
use super::statistics::{Logistic, Term};
use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::fit::Fit;
use crate::table::rounded;
use crate::variant::Variant;

/// Diameters of the pegs, mm.
pub const PEGS_MM: [f64; 5] = [15.0, 35.0, 55.0, 75.0, 95.0];
/// Voxels, mm.
pub const VOXELS_MM: [f64; 2] = [2.0, 0.4];
/// How far points are moved inward, percent of a voxel.
pub const SHRINK_PERCENT: f64 = 100.0;
/// Diametral clearance, mm.
const CLEARANCE_MM: f64 = 1.0;
/// Trials of a combination, and of those with the smallest peg.
const TRIALS: usize = 6;
const TRIALS_SMALLEST: usize = 7;
/// The shorter form leaves out pegs beyond this, mm.
const QUICK_MM: f64 = 35.0;

/// One insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Diameter of the peg, mm.
    pub peg_mm: f64,
    /// Edge of a voxel, mm.
    pub voxel_mm: f64,
    /// Counted from 0.
    pub trial: usize,
    /// Whether the peg came through.
    pub through: bool,
    /// How far it came, as a share of the hole's depth.
    pub share_inserted: Option<f64>,
    /// Largest force on the handle, N.
    pub peak_n: Option<f64>,
    /// Share of ticks that left out points, %.
    pub degraded_percent: Option<f64>,
    /// Bytes of the scene image.
    pub image_bytes: usize,
}

/// What the study found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Study {
    /// How far points were moved inward, percent of a voxel.
    pub shrink_percent: f64,
    /// 62 unless quick.
    pub trials: Vec<Trial>,
    /// What peg and voxel explain.
    pub terms: Vec<Term>,
}

/// Something the study found.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
pub enum Found<'s> {
    /// A trial.
    Trial(&'s Trial),
    /// What a term explains.
    Term(&'s Term),
}

/// A peg of the family.
fn fit(peg_mm: f64) -> Fit {
    Fit {
        width_mm: 3.0 * peg_mm,
        height_mm: 1.5 * peg_mm,
        hole_mm: peg_mm + CLEARANCE_MM,
        peg_mm,
        length_mm: 2.0 * peg_mm,
        engaged_mm: 0.0,
    }
}

/// Makes the study, points moved inward by `shrink_percent` of a voxel; `quick` has the two smallest pegs only. What is found goes to `out`.
///
/// # Errors
/// Anything that keeps a trial from being played.
pub fn study(quick: bool, shrink_percent: f64, out: &mut dyn FnMut(Found<'_>)) -> Result<Study, LabError> {
    let mut study = Study {
        shrink_percent,
        ..Study::default()
    };
    for peg in PEGS_MM.into_iter().filter(|&peg| !quick || peg <= QUICK_MM) {
        for voxel in VOXELS_MM {
            let task = Task::new(&fit(peg), &Variant::shrunk(voxel, shrink_percent))?;
            let count = if peg == PEGS_MM[0] {
                TRIALS_SMALLEST
            } else {
                TRIALS
            };
            for number in 0..count {
                let went = task.tried(&Hand::of(study.trials.len() as u64))?;
                let trial = Trial {
                    peg_mm: peg,
                    voxel_mm: voxel,
                    trial: number,
                    through: went.through,
                    share_inserted: (went.inserted_mm).map(|deep| rounded(deep / fit(peg).height_mm, 4)),
                    peak_n: went.peak_n.map(|force| rounded(force, 3)),
                    degraded_percent: went.degraded_percent.map(|share| rounded(share, 1)),
                    image_bytes: task.image_bytes(),
                };
                out(Found::Trial(&trial));
                study.trials.push(trial);
            }
        }
    }
    let (values, went): (Vec<Vec<f64>>, Vec<bool>) = (study.trials.iter())
        .map(|trial| (vec![trial.peg_mm, trial.voxel_mm], trial.through))
        .unzip();
    study.terms = Logistic::terms(&["peg, mm", "voxel, mm"], &values, &went).unwrap_or_default();
    study.terms.iter().for_each(|term| out(Found::Term(term)));
    Ok(study)
}

/// Share of the trials that went, and how far they came, over the peg's diameter.
pub fn chart(study: &Study) -> Chart {
    let looks = [Look::VermilionSquare, Look::BlueDisc];
    Chart {
        title: "Does a feature's size matter? Trials that went through, by peg and voxel".into(),
        note: format!(
            "{} trials, {CLEARANCE_MM} mm clearance, textbook voxmap, points shrunk by {} %, unguided; hand off by up to half the play and 0.5°.",
            study.trials.len(),
            study.shrink_percent
        ),
        x: Axis::new("diameter of the peg, mm").linear().with_ticks(&PEGS_MM),
        y: Axis::new("share of trials that went through")
            .linear()
            .with_ticks(&[0.0, 0.25, 0.5, 0.75, 1.0]),
        series: (VOXELS_MM.iter().zip(looks))
            .map(|(&voxel, look)| Series {
                name: format!("voxels of {voxel} mm"),
                look,
                line: Line::Solid,
                points: (PEGS_MM.iter())
                    .filter_map(|&peg| {
                        let of: Vec<&Trial> = (study.trials.iter())
                            .filter(|trial| trial.peg_mm == peg && trial.voxel_mm == voxel)
                            .collect();
                        let went = of.iter().filter(|trial| trial.through).count();
                        (!of.is_empty()).then(|| Point {
                            x: peg,
                            y: went as f64 / of.len() as f64,
                            label: format!("{went} of {}", of.len()),
                            at_least: false,
                        })
                    })
                    .collect(),
            })
            .collect(),
    }
}

impl fmt::Display for Found<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Trial(trial) => {
                write!(
                    f,
                    "peg {} mm, voxel {} mm, trial {}: ",
                    trial.peg_mm, trial.voxel_mm, trial.trial
                )?;
                write!(f, "{}", if trial.through { "through" } else { "stuck" })?;
                match (trial.share_inserted, trial.peak_n) {
                    (Some(share), Some(force)) => {
                        write!(f, ", {:.0} % of the hole, at most {force:.2} N", 100.0 * share)?;
                    }
                    _ => write!(f, ", the board gave up")?,
                }
                match trial.degraded_percent {
                    Some(share) if share > 0.0 => write!(f, ", points left out in {share} % of ticks"),
                    _ => Ok(()),
                }
            }
            Self::Term(term) => write!(f, "{term}"),
        }
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

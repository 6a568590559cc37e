//! Which voxels let a peg into its hole, and the effect of shrinking the pointshell: the first study of Faas 2010, chapter 7, repeated.
//!
//! The thesis' factors and levels (table 1), 27 trials a design, its model (logistic, one linear term a factor) and its test (χ² of each term's
//! likelihood ratio). The thesis does not state which design its software drew. Here designs are space-filling, which use all of the named levels,
//! and D-optimal, each drawn from several seeds, so that the χ² of one design of 27 can be compared with a spread. The peg and the hole have separate
//! voxel sizes; shrinking is a parameter of the running board. Each trial draws a hand of its own ([`super::operator`]).
//!
//! The causes of differences are found by changing one thing at a time: [`VARIATIONS`].

use std::fmt;

use serde::Serialize;

use super::design::Design;
use super::faas::TABLE_3;
use super::operator::{Hand, Task};
use super::statistics::{Logistic, Term};
use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::experiment::{Experiment, Findings, Form, Report};
use crate::fit::Fit;
use crate::table::rounded;

/// Diametral clearances, mm.
pub const CLEARANCES_MM: [f64; 3] = [2.5, 1.4, 1.0];
/// Names of the factors, in the order of a trial's levels.
pub const FACTORS: [&str; 4] = [
    "peg voxel, mm",
    "hole voxel, mm",
    "clearance, mm",
    "shrinking, voxels",
];
/// Numbers of levels of the factors: 10 voxels from 0.25 to 2.0 mm at equal intervals, twice; the clearances; 0 to 1 by tenths.
const LEVELS: [usize; 4] = [10, 10, 3, 11];
/// Trials of a design.
const RUNS: usize = 27;
/// Designs drawn for each variation.
const SEEDS: u64 = 4;
/// Number of baked scenes kept: a D-optimal design reuses the same eight.
const KEPT: usize = 8;

/// A variation of the study; all but the first change one thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Variation {
    /// Description.
    pub name: &'static str,
    /// Kind of design.
    pub design: Design,
    /// Number of hands that try before a trial counts as stuck: the thesis' operator had unlimited time.
    pub hands: u64,
}

/// The baseline, then one change at a time.
pub const VARIATIONS: [Variation; 3] = [
    Variation {
        name: "space-filling",
        design: Design::SpaceFilling,
        hands: 1,
    },
    Variation {
        name: "space-filling, five hands may try",
        design: Design::SpaceFilling,
        hands: 5,
    },
    Variation {
        name: "D-optimal",
        design: Design::DOptimal,
        hands: 1,
    },
];

/// One insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Name in [`VARIATIONS`].
    pub variation: &'static str,
    /// Seed of the design.
    pub seed: u64,
    /// Edge of the peg's voxels, mm.
    pub peg_voxel_mm: f64,
    /// Edge of the hole's voxels, mm.
    pub hole_voxel_mm: f64,
    /// Hole's diameter minus the peg's, mm.
    pub clearance_mm: f64,
    /// Distance by which points were moved inward, in voxels of the peg.
    pub shrinking: f64,
    /// True if the peg came through: the thesis' “1”.
    pub through: bool,
    /// Number of hands that tried.
    pub hands: u64,
    /// Depth that the last one reached, mm; the hole is 40 mm deep.
    pub inserted_mm: Option<f64>,
    /// Largest force on its handle, N.
    pub peak_n: Option<f64>,
    /// Share of ticks with decimated points, %.
    pub degraded_percent: Option<f64>,
}

/// A term of table 3, in the thesis and here.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    /// Name in [`VARIATIONS`].
    pub variation: &'static str,
    /// Factor.
    pub source: &'static str,
    /// χ² of table 3.
    pub faas_chi_squared: f64,
    /// p of table 3.
    pub faas_p: f64,
    /// Median χ² over the designs of 27.
    pub median_chi_squared: f64,
    /// Least χ² over the designs.
    pub least_chi_squared: f64,
    /// Largest χ² over the designs.
    pub most_chi_squared: f64,
    /// p of the median.
    pub median_p: f64,
    /// Number of designs in which the term has p ≤ 0.05, of `designs`.
    pub significant: usize,
    /// Number of designs.
    pub designs: usize,
    /// Number of designs whose terms separate all 27 trials.
    pub separated: usize,
    /// χ² of the trials of all designs together.
    pub pooled_chi_squared: f64,
    /// p of the pooled χ².
    pub pooled_p: f64,
    /// Coefficient of the pooled model, per unit of the factor; absent where there is no finite one.
    pub pooled_coefficient: Option<f64>,
    /// Its standard error.
    pub pooled_error: Option<f64>,
    /// Share of all trials that came through.
    pub share_through: f64,
}

/// Results of the study.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Study {
    /// All trials.
    pub trials: Vec<Trial>,
    /// Table 3.
    pub table: Vec<Compared>,
}

/// A result of the study.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
pub enum Found<'s> {
    /// A trial.
    Trial(&'s Trial),
    /// A term.
    Term(&'s Compared),
}

/// Runs the study; `quick` draws one space-filling design. Passes each result to `out` as text and rows.
///
/// # Errors
/// Anything that prevents a trial from being played.
pub fn study(quick: bool, out: &mut dyn FnMut(Found<'_>)) -> Result<Study, LabError> {
    let mut study = Study::default();
    let (variations, seeds) = if quick {
        (&VARIATIONS[..1], 1)
    } else {
        (&VARIATIONS[..], SEEDS)
    };
    for variation in variations {
        let first = study.trials.len();
        let mut tasks = Tasks::default();
        for seed in 0..seeds {
            for (run, levels) in variation.design.drawn(&LEVELS, RUNS, seed).iter().enumerate() {
                let hands = 1000 * seed + variation.hands * run as u64;
                let trial = trial(variation, seed, levels, hands, &mut tasks)?;
                out(Found::Trial(&trial));
                study.trials.push(trial);
            }
        }
        let rows = compared(variation, &study.trials[first..]);
        rows.iter().for_each(|row| out(Found::Term(row)));
        study.table.extend(rows);
    }
    Ok(study)
}

/// Values of the levels, in the order of [`FACTORS`].
fn values(levels: &[usize]) -> [f64; 4] {
    let voxel = |level: usize| rounded(0.25 + 1.75 / 9.0 * level as f64, 4);
    [
        voxel(levels[0]),
        voxel(levels[1]),
        CLEARANCES_MM[levels[2]],
        rounded(0.1 * levels[3] as f64, 1),
    ]
}

/// Cache of recently baked scenes.
#[derive(Default)]
struct Tasks(Vec<([f64; 3], Task)>);

impl Tasks {
    fn of(&mut self, peg: f64, hole: f64, clearance: f64) -> Result<&Task, LabError> {
        let key = [peg, hole, clearance];
        if let Some(place) = self.0.iter().position(|(known, _)| *known == key) {
            return Ok(&self.0[place].1);
        }
        if self.0.len() == KEPT {
            self.0.remove(0);
        }
        self.0
            .push((key, Task::voxels(&Fit::thesis(clearance), peg, hole)?));
        Ok(&self.0[self.0.len() - 1].1)
    }
}

/// Plays one trial of these levels; hands are drawn from the seed `first` on.
fn trial(
    variation: &Variation,
    seed: u64,
    levels: &[usize],
    first: u64,
    tasks: &mut Tasks,
) -> Result<Trial, LabError> {
    let [peg, hole, clearance, shrinking] = values(levels);
    let task = tasks.of(peg, hole, clearance)?;
    let mut hands = 1;
    let mut went = task.tried(&Hand::of(first), shrinking)?;
    while !went.through && hands < variation.hands {
        went = task.tried(&Hand::of(first + hands), shrinking)?;
        hands += 1;
    }
    Ok(Trial {
        variation: variation.name,
        seed,
        peg_voxel_mm: peg,
        hole_voxel_mm: hole,
        clearance_mm: clearance,
        shrinking,
        through: went.through,
        hands,
        inserted_mm: went.inserted_mm.map(|deep| rounded(deep, 3)),
        peak_n: went.peak_n.map(|force| rounded(force, 3)),
        degraded_percent: went.degraded_percent.map(|share| rounded(share, 1)),
    })
}

/// Effect of each factor on these trials, and whether they are separated.
fn terms(trials: &[&Trial]) -> Option<(Vec<Term>, bool)> {
    let (x, went): (Vec<Vec<f64>>, Vec<bool>) = (trials.iter())
        .map(|t| {
            let x = vec![t.peg_voxel_mm, t.hole_voxel_mm, t.clearance_mm, t.shrinking];
            (x, t.through)
        })
        .unzip();
    let separated = Logistic::fit(&x, &went)?.separated;
    Some((Logistic::terms(&FACTORS, &x, &went)?, separated))
}

/// Table 3 of one variation. Designs whose trials all had the same result carry no information and count as χ² = 0.
fn compared(variation: &Variation, trials: &[Trial]) -> Vec<Compared> {
    let seeds = trials.iter().map(|trial| trial.seed + 1).max().unwrap_or(0);
    let each: Vec<Option<(Vec<Term>, bool)>> = (0..seeds)
        .map(|seed| {
            terms(
                &trials
                    .iter()
                    .filter(|trial| trial.seed == seed)
                    .collect::<Vec<_>>(),
            )
        })
        .collect();
    let pooled = terms(&trials.iter().collect::<Vec<_>>());
    let through = trials.iter().filter(|trial| trial.through).count();
    (TABLE_3.iter().enumerate())
        .map(|(factor, printed)| {
            let mut found: Vec<(f64, f64)> = (each.iter())
                .map(|design| {
                    design.as_ref().map_or((0.0, 1.0), |(terms, _)| {
                        (terms[factor].chi_squared, terms[factor].p)
                    })
                })
                .collect();
            found.sort_by(|a, b| a.0.total_cmp(&b.0));
            let median = found
                .get(found.len() / 2)
                .copied()
                .unwrap_or((f64::NAN, f64::NAN));
            let pooled = pooled.as_ref().map(|(terms, _)| &terms[factor]);
            Compared {
                variation: variation.name,
                source: printed.source,
                faas_chi_squared: printed.statistic,
                faas_p: printed.p,
                median_chi_squared: rounded(median.0, 3),
                least_chi_squared: rounded(found.first().map_or(f64::NAN, |found| found.0), 3),
                most_chi_squared: rounded(found.last().map_or(f64::NAN, |found| found.0), 3),
                median_p: rounded(median.1, 4),
                significant: found.iter().filter(|found| found.1 <= 0.05).count(),
                designs: found.len(),
                separated: each.iter().flatten().filter(|(_, separated)| *separated).count(),
                pooled_chi_squared: pooled.map_or(f64::NAN, |term| rounded(term.chi_squared, 3)),
                pooled_p: pooled.map_or(f64::NAN, |term| term.p),
                pooled_coefficient: pooled.and_then(|term| term.coefficient).map(|b| rounded(b, 3)),
                pooled_error: pooled.and_then(|term| term.error).map(|e| rounded(e, 3)),
                share_through: rounded(through as f64 / trials.len().max(1) as f64, 3),
            }
        })
        .collect()
}

/// Share of the first variation's trials that came through over shrinking, a line for each clearance.
pub fn chart(study: &Study) -> Chart {
    const STEPS: [(f64, f64); 4] = [(0.0, 0.2), (0.3, 0.5), (0.6, 0.7), (0.8, 1.0)];
    let of: Vec<&Trial> = (study.trials.iter())
        .filter(|trial| trial.variation == VARIATIONS[0].name)
        .collect();
    Chart {
        title: "Which pegs go in? Shrinking and clearance, textbook voxmap".into(),
        note: format!(
            "{} trials in her factors' levels, voxels of 0.25 to 2.0 mm each for peg and hole, ø18.75 mm × 40 mm, one hand a trial.",
            of.len()
        ),
        x: Axis::new("pointshell shrinking, voxels of the peg").linear(),
        y: Axis::new("share of trials that went through")
            .linear()
            .with_ticks(&[0.0, 0.25, 0.5, 0.75, 1.0]),
        series: (CLEARANCES_MM.iter().enumerate())
            .map(|(number, &clearance)| Series {
                name: format!("{clearance} mm clearance"),
                look: Look::nth(number),
                line: Line::Solid,
                points: (STEPS.iter())
                    .filter_map(|&(from, to)| {
                        let in_step = |t: &&&Trial| {
                            t.clearance_mm == clearance
                                && t.shrinking >= from - 0.01
                                && t.shrinking <= to + 0.01
                        };
                        let all = of.iter().filter(in_step).count();
                        let went = of.iter().filter(in_step).filter(|t| t.through).count();
                        (all > 0).then(|| Point {
                            x: 0.5 * (from + to),
                            y: went as f64 / all as f64,
                            label: format!("{went} of {all}"),
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
            Self::Trial(t) => {
                write!(
                    f,
                    "{}, design {}: voxels of {} mm (peg) and {} mm (hole), clearance {} mm, shrunk by {}: {}",
                    t.variation,
                    t.seed,
                    t.peg_voxel_mm,
                    t.hole_voxel_mm,
                    t.clearance_mm,
                    t.shrinking,
                    if t.through { "through" } else { "stuck" }
                )?;
                match (t.inserted_mm, t.peak_n) {
                    (Some(deep), Some(force)) => write!(f, ", {deep:.1} mm in, at most {force:.2} N"),
                    _ => write!(f, ", the board gave up"),
                }
            }
            Self::Term(row) => write!(
                f,
                "{}, {}: Faas χ² {} (p {}); ours median {} ({} to {}; p {}), p ≤ 0.05 in {} of {} designs; pooled {} (p {:.1e})",
                row.variation,
                row.source,
                row.faas_chi_squared,
                row.faas_p,
                row.median_chi_squared,
                row.least_chi_squared,
                row.most_chi_squared,
                row.median_p,
                row.significant,
                row.designs,
                row.pooled_chi_squared,
                row.pooled_p
            ),
        }
    }
}

/// The experiment `shrink`.
pub struct Shrink;

impl Experiment for Shrink {
    fn name(&self) -> &'static str {
        "shrink"
    }

    fn about(&self) -> &'static str {
        "Which voxels let a peg into its hole, and what shrinking does: designs of 27 trials by a simulated operator, beside table 3 of the thesis"
    }

    fn quick(&self) -> &'static str {
        "one space-filling design"
    }

    fn rows(&self) -> Vec<String> {
        ["shrink", "shrink-table-3"].map(String::from).into()
    }

    fn charts(&self) -> Vec<String> {
        ["shrink"].map(String::from).into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let study = study(form.quick, &mut |found| report(&found))?;
        Ok(Findings::default()
            .rows("shrink", &study.trials)?
            .rows("shrink-table-3", &study.table)?
            .chart("shrink", chart(&study)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 1.
    #[test]
    fn levels_are_those_of_table_1() {
        let last: Vec<usize> = LEVELS.iter().map(|count| count - 1).collect();
        assert_eq!(values(&[0; 4]), [0.25, 0.25, 2.5, 0.0]);
        assert_eq!(values(&last), [2.0, 2.0, 1.0, 1.0]);
    }
}

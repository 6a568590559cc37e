//! Measurement of the board's cost table ([`mortise_haptics::cost`]): a regression of instructions on counts of work, tick by tick.
//!
//! Each motion is played twice: on the emulated board, which counts the instructions of each tick, and in-process, where each tick's work can be read.
//! Both compute the same bits, which is checked, so that tick i of one is tick i of the other. The counts are those of [`Work`]. Work that it does not
//! count apart (leaves, nodes passed over, cached faces, points within the margin, edges) is in the coefficients of what it comes with; while that is more
//! than [`UNEXPLAINED`] of a tick, the numbers are no costs of single rows and are not written.
//! The method is that of `docs/notes/2026-11-22-what-a-touching-point-costs.md`.

mod motions;
mod regression;
mod table;

use std::fmt;
use std::sync::mpsc::Receiver;

use mortise_haptics::Work;
use mortise_haptics::cost::TABLE;
use mortise_protocol::message::Telemetry;
use mortise_rig::{Client, Flash, Patience, TickWork, simulate_counted};
use mortise_scenario::{connect_with_scene, record};
use serde::Serialize;

use self::motions::Course;
use self::regression::{Coefficient, Regression};
pub use self::table::rewrite;
use crate::LabError;
use crate::guided::emulated;

/// Largest standard error, as a share of the value, of a number that may stand in the table.
const CERTAIN: f64 = 0.1;
/// Largest standard deviation of a tick's instructions about the regression, as a share of the mean tick, with which its numbers may stand in the table.
pub const UNEXPLAINED: f64 = 0.02;

/// A count of work in a tick.
struct Count {
    what: &'static str,
    /// Row of the table that its coefficient measures; `None`: several rows together, or none.
    row: Option<&'static str>,
    of: fn(&Tick) -> f64,
}

/// Counts, those that exist in every motion first.
const COUNTS: [Count; 8] = [
    count("a tick without other work", None, |_| 1.0),
    count(
        "point queried, with its share of leaf and near points",
        None,
        |tick| f64::from(tick.work.points),
    ),
    count("node queried", Some("NODE"), |tick| f64::from(tick.work.nodes)),
    count("candidate, with up to three solves", Some("CANDIDATE"), |tick| {
        f64::from(tick.work.candidates)
    }),
    count(
        "candidate in each solve past the third",
        Some("CANDIDATE_IN_SOLVE"),
        |tick| f64::from(tick.work.candidates) * f64::from(tick.work.solves.saturating_sub(3)),
    ),
    count("solve", Some("SOLVE"), |tick| f64::from(tick.work.solves)),
    count("target", Some("SPRING"), |tick| f64::from(tick.targets)),
    count("target in each solve", Some("SPRING_IN_SOLVE"), |tick| {
        f64::from(tick.targets) * f64::from(tick.work.solves)
    }),
];

const fn count(what: &'static str, row: Option<&'static str>, of: fn(&Tick) -> f64) -> Count {
    Count { what, row, of }
}

/// A tick: instructions on the emulated board, and work in-process.
struct Tick {
    instructions: f64,
    work: Work,
    targets: u8,
}

/// A measured cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// What was counted.
    pub what: &'static str,
    /// Row of the table; `None`: it has none.
    pub row: Option<&'static str>,
    /// Instructions in the table.
    pub table: Option<u32>,
    /// Instructions by the regression; `None` where the motions do not tell it from other counts.
    pub instructions: Option<f64>,
    /// Standard error, instructions.
    pub error: Option<f64>,
}

impl Measured {
    /// The number for the table: positive, and certain to a tenth.
    fn certain(&self) -> Option<(&'static str, u32)> {
        let (row, value, error) = (self.row?, self.instructions?, self.error?);
        (value >= 1.0 && error <= CERTAIN * value).then(|| (row, value.round() as u32))
    }
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<18} {}: ", self.row.unwrap_or("-"), self.what)?;
        match (self.instructions, self.error) {
            (Some(value), Some(error)) => write!(f, "{value:.0} ± {error:.0} instructions")?,
            _ => write!(f, "not separable by these motions")?,
        }
        match self.table {
            Some(table) => write!(f, ", {table} in the table"),
            None => Ok(()),
        }
    }
}

/// All costs that the motions measure.
#[derive(Clone, Debug, Serialize)]
pub struct Costs {
    /// One for each count.
    pub measured: Vec<Measured>,
    /// Rows of the table that are not counted apart.
    pub unmeasured: Vec<&'static str>,
    /// Ticks measured, and instructions of the mean one.
    pub ticks: usize,
    /// See [`Self::ticks`].
    pub mean: f64,
    /// Standard deviation of a tick's instructions about the regression.
    pub residual: f64,
}

impl Costs {
    /// Numbers for the table.
    ///
    /// # Errors
    /// `Input`: the counts do not explain the ticks.
    pub fn for_the_table(&self) -> Result<Vec<(&'static str, u32)>, LabError> {
        if self.residual > UNEXPLAINED * self.mean {
            let (residual, mean) = (self.residual, self.mean);
            return Err(input(
                "costs",
                &format!(
                    "the counts leave {residual:.0} of {mean:.0} instructions a tick unexplained, so that a number is not one row's cost: let the tick's Work count {} too",
                    self.unmeasured.join(", ")
                ),
            ));
        }
        Ok(self.measured.iter().filter_map(Measured::certain).collect())
    }
}

/// Plays the motions (`quick`: the first few) and fits; passes each motion's name and number of ticks to `out`.
///
/// # Errors
/// Anything that prevents a motion from being played, and `Input` when the two rigs differ in a bit or count too few ticks.
pub fn measure(quick: bool, out: &mut dyn FnMut(&str, usize)) -> Result<Costs, LabError> {
    let mut ticks = Vec::new();
    for index in 0..if quick { motions::QUICK } else { motions::COUNT } {
        let course = motions::prepare(index)?;
        let played = play(&course)?;
        out(&course.name, played.len());
        ticks.extend(played);
    }
    let counts: Vec<Vec<f64>> = (ticks.iter())
        .map(|tick| COUNTS.iter().map(|count| (count.of)(tick)).collect())
        .collect();
    let observed: Vec<f64> = ticks.iter().map(|tick| tick.instructions).collect();
    let fitted =
        regression::fit(&counts, &observed).ok_or_else(|| input("costs", "too few ticks were counted"))?;
    let mean = observed.iter().sum::<f64>() / observed.len() as f64;
    Ok(costs(&fitted, ticks.len(), mean))
}

fn costs(fitted: &Regression, ticks: usize, mean: f64) -> Costs {
    let in_table = |row: &str| {
        TABLE
            .iter()
            .find(|cost| cost.name == row)
            .map(|cost| cost.instructions)
    };
    let measured = COUNTS
        .iter()
        .zip(&fitted.coefficients)
        .map(|(count, found)| Measured {
            what: count.what,
            row: count.row,
            table: count.row.and_then(in_table),
            instructions: found.map(|Coefficient { value, .. }| value),
            error: found.map(|Coefficient { error, .. }| error),
        });
    let counted = |name| COUNTS.iter().any(|count| count.row == Some(name));
    Costs {
        measured: measured.collect(),
        unmeasured: TABLE
            .iter()
            .map(|cost| cost.name)
            .filter(|name| !counted(name))
            .collect(),
        ticks,
        mean,
        residual: fitted.residual,
    }
}

/// Plays a motion on both rigs.
fn play(course: &Course) -> Result<Vec<Tick>, LabError> {
    let Course { scenario, scene, .. } = course;
    let board = connect_with_scene(scenario, &emulated(), scene)?;
    let counted = record(&board, scenario, scene, Some(&mut *course.listener()?))?.samples;
    drop(board);
    let (transport, works) = simulate_counted(&Flash::default())?;
    let rig = Client::over(transport, "sim-fast", Patience::long(), None)?;
    rig.set_lockstep(true)?;
    let watched = record(&rig, scenario, scene, Some(&mut *course.listener()?))?.samples;
    drop(rig);
    paired(&course.name, &counted, &watched, &works)
}

/// Ticks of the two recordings, whose bits must agree.
fn paired(
    name: &str,
    counted: &[Telemetry],
    watched: &[Telemetry],
    works: &Receiver<TickWork>,
) -> Result<Vec<Tick>, LabError> {
    let same = |a: &Telemetry, b: &Telemetry| {
        (&a.handle, &a.object, &a.wrench, &a.points) == (&b.handle, &b.object, &b.wrench, &b.points)
    };
    let equal = counted.iter().zip(watched).all(|(a, b)| same(a, b));
    if counted.len() != watched.len() || !equal {
        return Err(input(name, "the emulated board and the in-process rig differ"));
    }
    let mut works = works.iter();
    let ticks = counted.iter().zip(watched).filter_map(|(counted, watched)| {
        let (_, work) = works.by_ref().find(|(tick, _)| *tick == watched.tick)?;
        Some(Tick {
            instructions: f64::from(counted.cost),
            work: work?,
            targets: counted.guidance.active,
        })
    });
    Ok(ticks.collect())
}

fn input(name: &str, what: &str) -> LabError {
    LabError::Input {
        name: name.to_owned(),
        what: what.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_counted_row_is_a_row_of_the_table() {
        for row in COUNTS.iter().filter_map(|count| count.row) {
            assert!(TABLE.iter().any(|cost| cost.name == row), "{row}");
        }
    }

    #[test]
    fn only_certain_numbers_may_stand_in_the_table() {
        let with = |instructions, error| {
            let measured = Measured {
                what: "node",
                row: Some("NODE"),
                table: Some(275),
                instructions: Some(instructions),
                error: Some(error),
            };
            measured.certain()
        };
        assert_eq!(with(281.4, 20.0), Some(("NODE", 281)));
        assert_eq!(with(281.4, 30.0), None);
        assert_eq!(with(-281.4, 2.0), None);
        assert_eq!(with(0.2, 0.0), None);
    }

    #[test]
    fn nothing_is_written_while_ticks_are_unexplained() {
        let with = |residual| {
            let coefficients = vec![
                Some(Coefficient {
                    value: 100.0,
                    error: 1.0
                });
                COUNTS.len()
            ];
            let fitted = Regression {
                coefficients,
                residual,
            };
            costs(&fitted, 1000, 50_000.0).for_the_table()
        };
        assert_eq!(
            with(900.0).unwrap().len(),
            COUNTS.iter().filter(|count| count.row.is_some()).count()
        );
        let refused = with(1_100.0).unwrap_err().to_string();
        let names = |row: &str| refused.split([' ', ',']).any(|word| word == row);
        assert!(names("LOOKUP") && !names("NODE"), "{refused}");
    }
}

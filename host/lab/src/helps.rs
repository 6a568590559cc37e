//! What each help does for a close fit: contact alone, the geometric energy, and the way held, from the same random starts.
//!
//! The thesis pair with 20 µm clearance is put in by a trembling hand that is 1 mm aside and 2° off at the mouth, in directions that a seed draws, and goes
//! on to 2 mm beyond the fit. Recognition of faces is off. Over time: the share of starts that are in; over the largest force at the handle: the share of starts
//! that never felt more.

use std::fmt;

use serde::Serialize;

use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::experiment::{Experiment, Findings, Form, Report};
use crate::followed::{Followed, Help, Seen, off};
use crate::guided::{SIM, file};
use crate::parallel::trials;
use crate::table::rounded;

const THESIS_PAIR: &str = include_str!("../data/pair_d18.75_clear0.02.step");
/// The hand at the mouth: aside, mm, and turned, degrees.
const ASIDE_MM: f64 = 1.0;
const TURNED_DEG: f64 = 2.0;
/// Starts: in full and in the quick form.
const STARTS: [usize; 2] = [100, 10];

/// Every help, with its name.
const HELPS: [(Help, &str); 3] = [
    (Help::Nothing, "contact alone"),
    (Help::Energy, "geometric energy"),
    (Help::Way, "way held"),
];

/// What a help did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// Help.
    pub help: &'static str,
    /// Starts.
    pub starts: usize,
    /// Of them those that went in.
    pub inserted: usize,
    /// Median time until these were in, s; absent where none was.
    pub median_s: Option<f64>,
    /// Median over all starts of the largest force at the handle, N.
    pub median_peak_n: f64,
    /// Largest force at the handle, N.
    pub largest_peak_n: f64,
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: {} of {} in, force at most {:.2} N, in the median {:.2} N",
            self.help, self.inserted, self.starts, self.largest_peak_n, self.median_peak_n
        )?;
        match self.median_s {
            Some(median) => write!(f, ", after {median:.3} s"),
            None => Ok(()),
        }
    }
}

/// Values in ascending order, without those that are none.
fn ascending(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// The middle one of ascending values, of two the upper.
fn median(values: &[f64]) -> Option<f64> {
    values.get(values.len() / 2).copied()
}

/// The share of `all`, %, that ascending values reach, as a staircase from 0 to `end`.
fn stairs(values: &[f64], all: usize, end: f64) -> Vec<Point> {
    let share = |count: usize| 100.0 * count as f64 / all.max(1) as f64;
    let steps =
        (values.iter().enumerate()).flat_map(|(count, &x)| [(x, share(count)), (x, share(count + 1))]);
    let points = std::iter::once((0.0, 0.0))
        .chain(steps)
        .chain([(end, share(values.len()))]);
    points
        .map(|(x, y)| Point {
            x,
            y,
            ..Point::default()
        })
        .collect()
}

fn chart(title: String, x: &str, y: &str, series: Vec<Series>) -> Chart {
    Chart {
        title,
        note: format!(
            "thesis pair, 20 µm clearance, hand {ASIDE_MM} mm aside and {TURNED_DEG}° off with tremor"
        ),
        x: Axis::new(x).linear(),
        y: Axis::new(y).linear(),
        series,
    }
}

/// The experiment `helps`.
pub struct Helps;

impl Experiment for Helps {
    fn name(&self) -> &'static str {
        "helps"
    }

    fn about(&self) -> &'static str {
        "Insert a close fit from random starts by contact alone, with the geometric energy, and with its way held: shares over time and force"
    }

    fn quick(&self) -> &'static str {
        "10 starts"
    }

    fn rows(&self) -> Vec<String> {
        vec!["helps".into()]
    }

    fn charts(&self) -> Vec<String> {
        vec!["helps".into(), "helps-force".into()]
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let starts = STARTS[usize::from(form.quick)];
        let file = file(THESIS_PAIR)?;
        let (followed, _) = Followed::new(file.path(), ["peg", "block"])?.with_energy()?;
        let (mut entries, mut tried) = (Vec::new(), Vec::new());
        for (help, name) in HELPS {
            let seen = trials(starts, |seed| {
                let mut random = fastrand::Rng::with_seed(seed as u64);
                followed.insert(&off(&mut random, ASIDE_MM, TURNED_DEG), help, &SIM)
            })?;
            let entry = entry(name, &seen);
            report(&entry);
            entries.push(entry);
            tried.push(seen);
        }
        let largest = |of: fn(&Seen) -> f64| tried.iter().flatten().map(of).fold(0.0, f64::max);
        let series = |of: fn(&Seen) -> f64, end: f64| {
            let series = HELPS
                .iter()
                .zip(&tried)
                .enumerate()
                .map(|(k, ((_, name), seen))| Series {
                    name: (*name).to_owned(),
                    look: Look::nth(k),
                    line: Line::Trace,
                    points: stairs(&ascending(seen.iter().map(of)), starts, end),
                });
            series.collect()
        };
        let times = chart(
            format!("Share of {starts} starts that are in"),
            "time, s",
            "in, %",
            series(|seen| seen.after_s, largest(|seen| seen.run_s)),
        );
        let forces = chart(
            format!("Share of {starts} starts without more force than this"),
            "largest force at the handle, N",
            "starts, %",
            series(|seen| seen.peak_n, largest(|seen| seen.peak_n)),
        );
        Ok(Findings::default()
            .rows("helps", &entries)?
            .chart("helps", times)
            .chart("helps-force", forces))
    }
}

fn entry(help: &'static str, seen: &[Seen]) -> Entry {
    let peaks = ascending(seen.iter().map(|seen| seen.peak_n));
    let times = ascending(seen.iter().map(|seen| seen.after_s));
    Entry {
        help,
        starts: seen.len(),
        inserted: seen.iter().filter(|seen| seen.is_in).count(),
        median_s: median(&times).map(|median| rounded(median, 3)),
        median_peak_n: rounded(median(&peaks).unwrap_or(f64::NAN), 3),
        largest_peak_n: rounded(peaks.last().copied().unwrap_or(f64::NAN), 3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stairs_rise_at_each_value_and_stay_to_the_end() {
        let values = ascending([2.0, f64::NAN, 1.0].into_iter());
        assert_eq!(median(&values), Some(2.0));
        assert_eq!(median(&[]), None);
        let points: Vec<(f64, f64)> = (stairs(&values, 4, 5.0).iter())
            .map(|point| (point.x, point.y))
            .collect();
        assert_eq!(
            points,
            [
                (0.0, 0.0),
                (1.0, 0.0),
                (1.0, 25.0),
                (2.0, 25.0),
                (2.0, 50.0),
                (5.0, 50.0)
            ]
        );
    }
}

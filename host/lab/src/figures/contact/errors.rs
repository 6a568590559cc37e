//! Largest errors of probed distances, gaps and depths apart.

use mortise_scenario::probe::{ProbeRow, Resolution};

use crate::figures::Row;

/// Contact is wrong where the parts are farther apart, mm: the permitted error of gaps.
const CLEAR_MM: f64 = 0.005;
/// Largest error of a distance called exact, mm.
const EXACT_MM: f64 = 1e-3;

/// Largest errors, and wrong answers.
#[derive(Clone, Debug, Default)]
pub(super) struct Errors {
    /// Poses.
    pub poses: usize,
    /// Largest error of a gap, mm, and its place.
    pub gap: Worst,
    /// Largest error of a depth, mm, and its place.
    pub depth: Worst,
    /// Distances called exact: how many, how many are off, and the worst.
    pub exact: usize,
    pub inexact: usize,
    pub worst_exact: Worst,
    /// Contact reported of poses that are free.
    pub ghosts: usize,
    /// Errors above what the plan states.
    pub unstated: usize,
}

/// A largest value, mm, and where it is.
#[derive(Clone, Debug, Default)]
pub(super) struct Worst {
    pub mm: f64,
    pub place: String,
}

impl Worst {
    fn see(&mut self, mm: f64, place: impl Fn() -> String) {
        // NaN replaces everything and stays, so that it fails the bound.
        if mm > self.mm || mm.is_nan() {
            *self = Self { mm, place: place() };
        }
    }

    fn join(&mut self, other: Self) {
        if other.mm > self.mm || other.mm.is_nan() {
            *self = other;
        }
    }

    /// The value and its place, as a remark.
    pub fn remark(&self) -> String {
        if self.place.is_empty() {
            return String::new();
        }
        format!(" (at {})", self.place)
    }
}

impl Errors {
    /// Books one answer. A lower bound beyond the field's range is off by as much as it exceeds the truth.
    pub fn see(&mut self, pair: &str, truth_mm: f64, truth_error_mm: f64, stated_mm: f64, row: &ProbeRow) {
        let off = row.distance_mm - truth_mm;
        let bound = row.resolution == Resolution::Bound;
        let error = match (bound, truth_mm >= 0.0) {
            (true, true) => off.max(0.0),
            (true, false) => (-off).max(0.0),
            (false, _) => off.abs(),
        };
        let error = (error - truth_error_mm).max(0.0);
        let place = || format!("{pair}, {}", row.name);
        self.poses += 1;
        if truth_mm >= 0.0 {
            self.gap.see(error, place);
        } else {
            self.depth.see(error, place);
        }
        if row.resolution == Resolution::Exact {
            self.exact += 1;
            self.inexact += usize::from(error > EXACT_MM);
            self.worst_exact.see(error, place);
        }
        self.ghosts += usize::from(truth_mm > CLEAR_MM && row.contacts > 0);
        self.unstated += usize::from(error > stated_mm);
    }

    /// Those of all.
    pub fn of(all: Vec<Self>) -> Self {
        all.into_iter().fold(Self::default(), |mut sum, other| {
            sum.poses += other.poses;
            sum.gap.join(other.gap);
            sum.depth.join(other.depth);
            sum.exact += other.exact;
            sum.inexact += other.inexact;
            sum.worst_exact.join(other.worst_exact);
            sum.ghosts += other.ghosts;
            sum.unstated += other.unstated;
            sum
        })
    }

    /// Rows of a planned accuracy.
    pub fn planned_rows(&self, what: &str, out: &mut dyn FnMut(Row)) {
        let gap = format!("{what}: largest gap error{}", self.gap.remark());
        out(Row::at_most(gap, 1e3 * self.gap.mm, "µm", 5.0));
        let depth = format!("{what}: largest penetration error{}", self.depth.remark());
        out(Row::at_most(depth, 1e3 * self.depth.mm, "µm", 10.0));
        let count =
            |of: &str, value: usize| Row::exactly(format!("{what}: {of}"), value as f64, "poses", 0.0);
        out(count("errors above what the plan states", self.unstated));
        out(count(
            "contact reported where they are over 5 µm apart",
            self.ghosts,
        ));
    }
}

//! Progress of a reading, from the progress of its phases.

use std::cell::Cell;
use std::ops::Range;
use std::time::{Duration, Instant};

/// Least time between two reports: 20 a second.
const INTERVAL: Duration = Duration::from_millis(50);

/// Reports a fraction of the whole reading, 0 to 1, that only rises: while a phase is repeated, the fraction stays.
pub struct Progress<'a> {
    report: &'a dyn Fn(f64),
    /// The present phase, as a part of the whole.
    phase: Cell<(f64, f64)>,
    /// The last report and its time.
    last: Cell<Option<(f64, Instant)>>,
}

impl<'a> Progress<'a> {
    /// Progress that calls `report` at most 20 times a second.
    pub fn new(report: &'a dyn Fn(f64)) -> Self {
        Self {
            report,
            phase: Cell::new((0.0, 0.0)),
            last: Cell::new(None),
        }
    }

    /// Begins a phase, which is this part of the whole.
    pub fn begin(&self, phase: Range<f64>) {
        self.phase.set((phase.start, phase.end));
        self.advance(0.0);
    }

    /// States how much of the present phase is done, 0 to 1.
    pub fn advance(&self, done: f64) {
        let (start, end) = self.phase.get();
        let reached = start + (end - start) * done.clamp(0.0, 1.0);
        let now = Instant::now();
        let due = |(before, at): (f64, Instant)| reached > before && now.duration_since(at) >= INTERVAL;
        if self.last.get().is_none_or(due) {
            self.last.set(Some((reached, now)));
            (self.report)(reached);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    #[test]
    fn phases_add_up_to_a_fraction_that_only_rises() {
        let seen = RefCell::new(Vec::new());
        let report = |fraction| seen.borrow_mut().push(fraction);
        let progress = Progress::new(&report);
        // A clock that never waits.
        let advance = |done: f64| {
            if let Some((before, at)) = progress.last.get() {
                progress.last.set(at.checked_sub(INTERVAL).map(|at| (before, at)));
            }
            progress.advance(done);
        };
        progress.begin(0.0..0.5);
        advance(0.5);
        advance(f64::NAN);
        advance(7.0);
        // Repeated.
        progress.begin(0.0..0.5);
        advance(0.9);
        progress.begin(0.5..1.0);
        advance(0.5);
        // Too soon.
        progress.advance(0.6);
        assert_eq!(*seen.borrow(), [0.0, 0.25, 0.5, 0.75]);
    }
}

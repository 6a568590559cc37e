//! Two searches at the same time, of which the one that needs less work wins: work is counted in visited samples and spheres, not in seconds, so that the
//! result does not depend on the computer.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::way::Budget;
use crate::work::worked;

/// The end of a search: by time, or because the other one has found something with less work.
pub(crate) struct Clock<'a> {
    pub budget: &'a Budget,
    found_at: &'a AtomicU64,
    /// Work of this thread at the start.
    from: u64,
}

impl<'a> Clock<'a> {
    /// Starts to count in the calling thread, whose searches alone may ask it.
    pub fn new(budget: &'a Budget, found_at: &'a AtomicU64) -> Self {
        Self {
            budget,
            found_at,
            from: worked(),
        }
    }

    fn so_far(&self) -> u64 {
        worked() - self.from
    }

    pub fn is_over(&self) -> bool {
        self.budget.is_over() || self.so_far() > self.found_at.load(Ordering::Relaxed)
    }

    /// Notes that something is found; the work it took.
    pub fn found(&self) -> u64 {
        let at = self.so_far();
        self.found_at.fetch_min(at, Ordering::Relaxed);
        at
    }
}

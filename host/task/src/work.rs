//! Count of the work of a thread, in visited samples and spheres.

use std::cell::Cell;

thread_local! {
    static WORK: Cell<u64> = const { Cell::new(0) };
}

/// Counts work of this thread.
pub(crate) fn work(visited: u64) {
    WORK.with(|w| w.set(w.get() + visited));
}

/// Work of this thread so far.
pub(crate) fn worked() -> u64 {
    WORK.with(Cell::get)
}

//! The nodes above the one that is looked at: none of them is due before the first of those below it.
//!
//! Cost: some 20 instructions for each node passed.

use crate::collision::coherence::{Bound, Coherence};
use crate::collision::node_key::Key;

/// Deepest tree whose inner nodes all learn when they are due: 2¹⁶ leaves in two halves each time.
const DEEPEST: usize = 16;

/// The nodes above the one that is looked at, and when the first below each is due.
pub(crate) struct Ancestors {
    nodes: heapless::Vec<(Key, u32, Bound), DEEPEST>,
    /// Where the innermost ends.
    end: u32,
}

impl Ancestors {
    pub const fn new() -> Self {
        Self {
            nodes: heapless::Vec::new(),
            end: u32::MAX,
        }
    }

    /// What follows, up to node `end`, is below `key`. In a deeper tree the last above has it all.
    pub fn open(&mut self, key: Key, end: u32) {
        if self.nodes.push((key, end, Bound::NEVER)).is_ok() {
            self.end = end;
        }
    }

    /// Something below is due.
    #[inline]
    pub fn note(&mut self, due: Bound) {
        if let Some((_, _, first)) = self.nodes.last_mut()
            && due < *first
        {
            *first = due;
        }
    }

    /// All nodes before `index` were looked at or passed over.
    #[inline(always)]
    pub fn close(&mut self, index: u32, coherence: &mut Coherence) {
        while index >= self.end && self.close_last(coherence) {}
    }

    #[inline(always)]
    fn close_last(&mut self, coherence: &mut Coherence) -> bool {
        let Some((key, _, due)) = self.nodes.pop() else {
            return false;
        };
        if due != Bound::NOW {
            coherence.set_bound(key, due);
        }
        self.end = self.nodes.last().map_or(u32::MAX, |&(_, end, _)| end);
        self.note(due);
        true
    }
}

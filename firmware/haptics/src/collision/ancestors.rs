//! Ancestor stack of the node under evaluation: it passes the smallest advancement bound of the nodes below up to each ancestor.
//!
//! Cost: some 20 instructions for each node passed.

use crate::collision::coherence::{Bound, Coherence};
use crate::collision::node_key::Key;

/// Depth of the deepest tree whose inner nodes all get bounds: 2¹⁶ leaves with two children per node.
const DEEPEST: usize = 16;

/// Ancestors of the node under evaluation, each with the smallest bound found below it so far.
pub(crate) struct Ancestors {
    nodes: heapless::Vec<(Key, u32, Bound), DEEPEST>,
    /// End of the innermost ancestor's subtree.
    end: u32,
}

impl Ancestors {
    pub const fn new() -> Self {
        Self {
            nodes: heapless::Vec::new(),
            end: u32::MAX,
        }
    }

    /// Enters the subtree of `key`, which ends before node `end`. In a deeper tree the last ancestor on the stack stands for the ones that do not
    /// fit.
    pub fn open(&mut self, key: Key, end: u32) {
        if self.nodes.push((key, end, Bound::NEVER)).is_ok() {
            self.end = end;
        }
    }

    /// Records the bound of a node below.
    #[inline]
    pub fn note(&mut self, bound: Bound) {
        if let Some((_, _, earliest)) = self.nodes.last_mut()
            && bound < *earliest
        {
            *earliest = bound;
        }
    }

    /// Leaves the subtrees that end at or before `index`, and stores their bounds.
    #[inline(always)]
    pub fn close(&mut self, index: u32, coherence: &mut Coherence) {
        while index >= self.end && self.close_last(coherence) {}
    }

    #[inline(always)]
    fn close_last(&mut self, coherence: &mut Coherence) -> bool {
        let Some((key, _, bound)) = self.nodes.pop() else {
            return false;
        };
        if bound != Bound::NOW {
            coherence.set_bound(key, bound);
        }
        self.end = self.nodes.last().map_or(u32::MAX, |&(_, end, _)| end);
        self.note(bound);
        true
    }
}

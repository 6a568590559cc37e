//! The nodes above the one that is looked at: none of them is due before the first of those below it.
//!
//! Cost: some 20 instructions for each node passed.

use crate::coherence::{Coherence, Due, Key};

/// Deepest tree whose inner nodes all learn when they are due: 2¹⁶ leaves in two halves each time.
const DEEPEST: usize = 16;

/// The nodes above the one that is looked at, and when the first below each is due.
#[derive(Default)]
pub(crate) struct Above(heapless::Vec<(Key, u32, Due), DEEPEST>);

impl Above {
    /// What follows, up to node `end`, is below `key`. In a deeper tree the last above has it all.
    pub fn open(&mut self, key: Key, end: u32) {
        let _ = self.0.push((key, end, Due::NEVER));
    }

    /// Something below is due.
    #[inline]
    pub fn hear(&mut self, due: Due) {
        if let Some((_, _, first)) = self.0.last_mut()
            && due < *first
        {
            *first = due;
        }
    }

    /// All nodes before `index` were looked at or passed over.
    #[inline]
    pub fn close(&mut self, index: u32, coherence: &mut Coherence) {
        while let Some(&(key, end, due)) = self.0.last()
            && end <= index
        {
            self.0.pop();
            if due != Due::NOW {
                coherence.set_due(key, due);
            }
            self.hear(due);
        }
    }
}

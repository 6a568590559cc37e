//! Boxes of two shapes that are apart: nothing below the roots of their trees is looked at.
//!
//! The gap is the same in both directions, and for the edges: it is found once a tick for each part. Cost: some 250 instructions.

use crate::collision::coherence::{Bound, Known};
use crate::collision::cost::NODE;
use crate::collision::directed_pair::DirectedPair;
use crate::collision::node_key::Key;
use crate::collision::rules::FacePairRules;
use crate::collision::search::Traversal;

impl<R: FacePairRules> Traversal<'_, '_, '_, R> {
    /// The bound of a tree's root whose own is not known any more, where the boxes of the two shapes are apart: else all nodes below would be looked at.
    pub fn boxes_apart(&mut self, pair: &DirectedPair<'_>, root: Key, known: Known) -> Option<Bound> {
        if !matches!(known, Known::Expired | Known::Nothing) {
            return None;
        }
        // Counted each time: what the budget counts decides which points an overloaded tick leaves out.
        self.spent += NODE;
        let gap = match self.boxes {
            Some((part, gap)) if part == pair.index / 2 => gap,
            _ => pair.box_gap(),
        };
        self.boxes = Some((pair.index / 2, gap));
        (gap > self.search.margin).then(|| self.coherence.set_distance(root, gap))
    }
}

//! Pairs that are apart as a whole: nothing below the roots of their trees is looked at.
//!
//! Where the spheres about two parts are apart, or while the bounds of the roots hold, not even the shapes are. Then the boxes tell: their gap is the same
//! in both directions, and for the edges, and is found once a tick for each part. Cost: some 250 instructions.

use crate::collision::coherence::{Bound, Known};
use crate::collision::cost::{LOOKUP, NODE, PASSED_OVER};
use crate::collision::directed_pair::DirectedPair;
use crate::collision::edge_crossing::are_within;
use crate::collision::node_key::{Key, Keys};
use crate::collision::rules::FacePairRules;
use crate::collision::search::Traversal;

impl<R: FacePairRules> Traversal<'_, '_, '_, R> {
    /// Whether the bounding spheres of the two parts of directed pair `index` come within the margin of each other.
    #[inline]
    pub fn spheres_meet(&self, index: u16) -> bool {
        let (search, part) = (self.search, index / 2);
        let placed = |part: u16| search.parts.get(usize::from(part));
        let (Some(other), Some(held)) = (placed(part), placed(search.held)) else {
            return false;
        };
        let (sphere, reach) = ((search.middle, held.radius), search.margin + search.shrunk_m);
        part != search.held && are_within(sphere, (other.center, other.radius), reach)
    }

    /// Passes over directed pair `index` where the bounds of the roots of its trees still hold, without a look at its shapes. Returns whether it did.
    pub fn pass_over(&mut self, index: u16) -> bool {
        let (part, held) = (usize::from(index / 2), usize::from(self.search.held));
        let backward = !index.is_multiple_of(2);
        let scene = self.search.scene;
        if part.max(held) >= scene.parts().len() || self.spent >= LOOKUP.saturating_mul(self.search.budget) {
            return false;
        }
        let (tree, field) = if backward { (part, held) } else { (held, part) };
        let [nodes, edge_nodes] = scene.nodes_of_part(tree);
        let [_, field_edge_nodes] = scene.nodes_of_part(field);
        let keys = Keys::new(index, nodes + edge_nodes);
        let mut passed = PASSED_OVER;
        let mut far = matches!(
            self.coherence.query(keys.of(0), self.horizon, false),
            Known::Far(_)
        );
        if !backward && edge_nodes > 0 && field_edge_nodes > 0 {
            let known = self.coherence.query(keys.of(nodes as u32), self.horizon, false);
            let early = self.early_m();
            far &= matches!(known, Known::Far(bound) if !bound.expires_within(self.horizon, early));
            passed += PASSED_OVER;
        }
        if far {
            self.spent += passed;
        }
        far
    }

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

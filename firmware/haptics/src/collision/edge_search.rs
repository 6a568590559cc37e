//! Edges of the held part against edges of the other part.
//!
//! The tree of the held part's pieces is traversed as the pointshell's is: a node whose sphere the other part's field shows to be far is skipped, and
//! its advancement bound stored. A piece of a near leaf is compared with the pieces under the other part's edge tree. A leaf that lies on the other
//! part's surface but far from its edges, such as the rim of a peg in its bore, keeps that distance as its bound.
//!
//! Two edges that cross are offered as a contact at any gap within the margin, so a fast edge is stopped before it passes another. An overlap deeper
//! than [`DEPTH_SHARE`] of the thinner part is not taken for a contact unless the same edges crossed in the tick before: else the far edges of a
//! thin bar, which face the other part too, would pull it through. The same holds for edges at a flat angle, see [`DEPTH_PER_SINE_M`].

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::{EDGE_ERROR_CELLS, EdgeRecord, NodeRecord};

use crate::collision::ancestors::Ancestors;
use crate::collision::coherence::{Bound, Known};
use crate::collision::cost::{CROSSING, EDGE_BOUND, LOOKUP, MATING, NODE, PASSED_OVER};
use crate::collision::directed_pair::DirectedPair;
use crate::collision::edge_crossing::{Crossing, Piece, crossing, nearest, run_along};
use crate::collision::node_cursor::NodeCursor;
use crate::collision::rules::{FacePairRules, Mating};
use crate::collision::search::Traversal;
use crate::math::scalar::smaller;
use crate::math::vector::quick_length;

/// Deepest overlap of two edges that touch for the first time, as a share of the thinner part's thickness at them: at half of it the far sides are as
/// near as the near ones.
const DEPTH_SHARE: f32 = 0.45;
/// The same for edges that are nearly parallel, m, times the sine of their angle: where two rims cross at a flat angle, a peg that leans on the wall
/// of its hole lies below the mouth by any depth, and the wall pushes it, not the mouth.
const DEPTH_PER_SINE_M: f32 = 1e-3;
/// Edges that overlap by more than this are not found, m: their distance is that far too. A tick that stops a metre a second is a quarter of it deep.
const DEEPEST_M: f32 = 0.5e-3;
/// A leaf without near edges is searched this far, m, and as far as [`RESERVE_TICKS`] ticks of the last motion, for a bound that lasts.
const RESERVE_M: f32 = 1e-3;
/// See [`RESERVE_M`].
const RESERVE_TICKS: f32 = 32.0;

/// Pieces of the other part's edges near a leaf; more are compared in groups of this size.
type Near<'i> = Vec<Piece<'i>, 16>;

impl<R: FacePairRules> Traversal<'_, '_, '_, R> {
    /// Searches the edges of a forward pair; nodes are numbered on from the pointshell's. Returns where it stopped when the budget ran out.
    ///
    /// Terminates because every record's `skip` points forward (checked when the image was opened).
    pub fn edges(&mut self, pair: &DirectedPair<'_>, from: u32, to: u32) -> Option<NodeCursor> {
        if pair.backward || pair.field.is_occupancy() || pair.field_edges.nodes.is_empty() {
            return None;
        }
        let first = pair.nodes.len() as u32;
        let to = to.saturating_sub(first);
        let edge_error = EDGE_ERROR_CELLS * pair.field.record().cell;
        let limit = LOOKUP.saturating_mul(self.search.budget);
        let mut ancestors = Ancestors::new();
        let mut index = from.saturating_sub(first);
        while index < to {
            let Some(node) = pair.edges.nodes.get(index as usize) else {
                break;
            };
            let here = NodeCursor {
                pair: pair.index,
                node: first + index,
            };
            if self.spent >= limit {
                return Some(here);
            }
            ancestors.close(index, self.coherence);
            let key = pair.keys.of(here.node);
            match self.coherence.query(key, self.horizon, false) {
                Known::Far(bound) => {
                    self.spent += PASSED_OVER;
                    ancestors.note(bound);
                    index = node.skip;
                    continue;
                }
                Known::Near(_) | Known::Expired => self.spent += PASSED_OVER,
                Known::Nothing => {
                    self.spent += NODE;
                    self.work.nodes += 1;
                    let distance = pair.distance(node.center) - (node.radius + edge_error);
                    if distance > self.search.margin {
                        ancestors.note(self.coherence.set_distance(key, distance));
                        index = node.skip;
                        continue;
                    }
                    self.coherence.set_near(key);
                }
            }
            index += 1;
            if node.skip != index {
                ancestors.open(key, node.skip);
                continue;
            }
            let distance = self.edge_leaf(pair, here, node) - DEEPEST_M;
            ancestors.note(if distance > self.search.margin {
                self.coherence.set_distance(key, distance)
            } else {
                Bound::NOW
            });
        }
        ancestors.close(index, self.coherence);
        None
    }

    /// Compares the pieces of a leaf with the other part's edges. Returns a lower bound of their distance from those edges, m.
    #[inline(never)]
    fn edge_leaf(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, node: &NodeRecord) -> f32 {
        let reach = self.search.margin + DEEPEST_M;
        let sphere = (pair.to_field.apply(node.center), node.radius);
        let mut near = Near::new();
        let mut least = f32::INFINITY;
        self.near_edges(pair, sphere, reach, |search, other| {
            // Emptied when full, so there is space.
            let _ = near.push(other);
            if near.is_full() {
                least = smaller(least, search.cross(pair, leaf, node, &near));
                near.clear();
            }
        });
        if !near.is_empty() {
            least = smaller(least, self.cross(pair, leaf, node, &near));
        }
        if least < f32::INFINITY {
            return least;
        }
        // Nothing is near: the bound is to last for a while.
        let reserve = reach + RESERVE_M + RESERVE_TICKS * self.search.way;
        least = reserve;
        self.near_edges(pair, sphere, reserve, |_, other| {
            let (center, radius) = other.sphere();
            least = smaller(least, quick_length(center - sphere.0) - (radius + sphere.1));
        });
        least
    }

    /// Passes to `visit` every piece of the other part's edges whose sphere lies within `reach` (m) of a sphere.
    #[inline(always)]
    fn near_edges<'i>(
        &mut self,
        pair: &DirectedPair<'i>,
        (center, radius): (Vec3, f32),
        reach: f32,
        mut visit: impl FnMut(&mut Self, Piece<'i>),
    ) {
        let tree = pair.field_edges;
        let mut index = 0;
        while let Some(node) = tree.nodes.get(index as usize) {
            self.spent += EDGE_BOUND;
            let farthest = radius + node.radius + reach;
            if (Vec3::from_array(node.center) - center).length_squared() > farthest * farthest {
                index = node.skip;
                continue;
            }
            index += 1;
            if node.skip != index {
                continue;
            }
            for piece in node.points(tree.pieces).iter().map(Piece::fixed) {
                self.spent += EDGE_BOUND;
                if piece.is_within(center, radius, reach) {
                    visit(self, piece);
                }
            }
        }
    }

    /// Offers the crossings of the pieces of a leaf with `near` pieces of the other part. Returns a lower bound of their distance, m.
    fn cross(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        node: &NodeRecord,
        near: &[Piece<'_>],
    ) -> f32 {
        let rotation = pair.to_field.rotation();
        let reach = self.search.margin + DEEPEST_M;
        let mut least = f32::INFINITY;
        for record in node.points(pair.edges.pieces) {
            let own = Piece::placed(record, pair.to_field.apply(record.center), rotation);
            let (center, radius) = own.sphere();
            for other in near {
                if !other.is_within(center, radius, reach) {
                    least = smaller(least, reach);
                    continue;
                }
                self.spent += EDGE_BOUND;
                if run_along(&own, other) {
                    least = f32::NEG_INFINITY;
                    continue;
                }
                let (from, distance) = nearest(&own, other);
                least = smaller(least, distance);
                if distance > reach {
                    continue;
                }
                self.spent += CROSSING;
                if let Some(found) = crossing(&own, other, rotation, from) {
                    self.touch(pair, leaf, [record, other.record], &found);
                }
            }
        }
        least
    }

    /// Offers two edges that cross as a contact, unless they are too deep for a first touch.
    fn touch(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        [own, other]: [&EdgeRecord; 2],
        found: &Crossing,
    ) {
        let edges = [own.edge as u16, other.edge as u16];
        let thinner = smaller(own.thickness, other.thickness);
        let deepest = smaller(DEPTH_SHARE * thinner, DEPTH_PER_SINE_M * found.sine);
        let too_deep = found.gap < -deepest && !self.contacts.crossed(leaf.part(), edges);
        let excluded = || {
            let kept_apart = |of: &[u16; 2]| own.faces.contains(&of[0]) && other.faces.contains(&of[1]);
            pair.excluded.iter().any(kept_apart)
        };
        if found.gap >= self.search.margin || too_deep || excluded() {
            return;
        }
        let mating = if pair.guided {
            self.spent += MATING;
            self.mating_of(leaf, own.faces, other.faces)
        } else {
            Mating::NONE
        };
        let gap = found.gap + mating.allowance_m;
        let arm = pair.to_arm.apply(pair.in_tree(found.point));
        let Some(contact) = self.offer(gap, pair.to_push * found.normal, arm) else {
            return;
        };
        contact.guided = mating.guided;
        [contact.moving_face, contact.moving_edge_face] = own.faces;
        [contact.static_face, contact.static_edge_face] = other.faces;
        contact.edges = edges;
        contact.leaf = leaf;
    }
}

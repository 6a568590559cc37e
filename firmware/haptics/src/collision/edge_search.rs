//! Edges of the held part against edges of the other part.
//!
//! The tree of the held part's pieces is traversed as the pointshell's is: a node whose sphere the other part's field shows to be far is skipped, and
//! its advancement bound stored. A piece of a near leaf is compared with the pieces under the other part's edge tree. A leaf that lies on the other
//! part's surface but far from its edges, such as the rim of a peg in its bore, keeps that distance as its bound. Of a leaf that stays near edges, the pairs of
//! pieces that can come near are kept ([`super::edge_cache`]), each with the travel within which it cannot touch.
//!
//! Two edges that cross are offered as a contact at any gap within the margin, so a fast edge is stopped before it passes another. An overlap deeper
//! than [`DEPTH_SHARE`] of the thinner part is not taken for a contact unless the same edges crossed in the tick before: else the far edges of a
//! thin bar, which face the other part too, would pull it through. The same holds for edges at a flat angle, see [`DEPTH_PER_SINE_M`].

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::{EDGE_ERROR_CELLS, EdgeRecord, NodeRecord};

use crate::collision::ancestors::Ancestors;
use crate::collision::coherence::{Bound, Known};
use crate::collision::cost::{
    CIRCLE, CIRCLE_PAIR, CROSSING, EDGE_BOUND, EDGE_NODE, EDGE_PAIR, EDGE_TRAVEL, FEET_STEP, KEPT_PAIR,
    LOOKUP, MATING, NODE, PASSED_OVER, PIECE, PIECE_BOUND,
};
use crate::collision::directed_pair::DirectedPair;
use crate::collision::edge_cache::{CachedPairs, Entry};
use crate::collision::edge_crossing::{
    Circle, Crossing, Meeting, Piece, are_within, crossing, feet, feet_steps, nearest, run_along,
};
use crate::collision::node_cursor::NodeCursor;
use crate::collision::node_key::Key;
use crate::collision::rules::{FacePairRules, Mating};
use crate::collision::search::Traversal;
use crate::math::scalar::{larger, smaller};

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
const RESERVE_TICKS: f32 = 16.0;
/// Leaves whose bound expires within this travel, m, and twice [`EARLY_TICKS`] ticks of the last motion, are compared anew in turn, one tick in
/// [`EARLY_TICKS`] each: else all pieces of a rim would be compared in the same tick.
const EARLY_M: f32 = 0.25e-3;
/// See [`EARLY_M`]; a power of two.
const EARLY_TICKS: u32 = 8;

/// Near pairs of pieces are kept for this travel, m, and for [`KEPT_TICKS`] ticks of the last motion,
const KEPT_M: f32 = 0.25e-3;
/// See [`KEPT_M`].
const KEPT_TICKS: f32 = 16.0;
/// but for no more than this, m: the farther, the more pairs,
const MOST_KEPT_M: f32 = 0.75e-3;
/// and not where fewer ticks than this would use it up.
const LEAST_KEPT_TICKS: f32 = 4.0;

/// Pieces of the other part's edges near a leaf, and their numbers; more are compared in groups of this size. Records, since a piece is long to copy.
type Near<'i> = Vec<(u32, &'i EdgeRecord), NEAR_PIECES>;
/// See [`Near`].
const NEAR_PIECES: usize = 16;

/// Whether the sphere about a piece and another one (centre, radius, m) are at most `reach` apart.
#[inline]
fn is_within(piece: &EdgeRecord, center: Vec3, radius: f32, reach: f32) -> bool {
    are_within(
        (Vec3::from_array(piece.center), piece.radius),
        (center, radius),
        reach,
    )
}

/// What was found of two pieces, and what tells when they can touch.
#[derive(Clone, Copy)]
enum Compared {
    /// Farther apart than edges are compared: their distance, m.
    Far(f32),
    /// Rims that run along each other: their distance, m.
    Along(f32),
    /// Edges that cross: their gap, m.
    Crossing(f32),
    /// Edges that do not face each other before one turns by this angle, rad.
    Averted(f32),
    /// Edges that pass beside each other within this travel, m.
    Beside(f32),
}

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
        let early = self.early_m();
        // End of the subtree whose bound still holds although it is visited, and that bound.
        let (mut covered, mut cover) = (0, Bound::NOW);
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
            let leaf = node.skip == index + 1;
            let known = self.coherence.query(key, self.horizon, false);
            if index == 0
                && let Some(bound) = self.boxes_apart(pair, key, known)
            {
                ancestors.note(bound);
                index = node.skip;
                continue;
            }
            let mut distance = f32::NEG_INFINITY;
            match known {
                Known::Far(bound) if !self.due(key, bound, leaf, early) => {
                    self.spent += PASSED_OVER;
                    ancestors.note(bound);
                    index = node.skip;
                    continue;
                }
                Known::Nothing if index < covered && !self.coherence.is_turn_of(key, EARLY_TICKS) => {
                    self.spent += PASSED_OVER;
                    ancestors.note(cover);
                    index = node.skip;
                    continue;
                }
                Known::Far(bound) if !leaf => {
                    self.spent += PASSED_OVER;
                    if index >= covered {
                        (covered, cover) = (node.skip, bound);
                    }
                }
                Known::Near(_) | Known::Expired => self.spent += PASSED_OVER,
                Known::Far(_) | Known::Nothing => {
                    self.spent += NODE;
                    self.work.nodes += 1;
                    distance = pair.distance(node.center) - (node.radius + edge_error);
                    self.charge_surfaces(pair);
                    let far = if leaf {
                        self.search.margin + early
                    } else {
                        self.search.margin
                    };
                    if distance > far {
                        ancestors.note(self.coherence.set_distance(key, distance));
                        index = node.skip;
                        continue;
                    }
                    self.coherence.set_near(key);
                }
            }
            index += 1;
            if !leaf {
                ancestors.open(key, node.skip);
                continue;
            }
            // As long as its bound holds, none of its pieces can touch.
            let holds = distance > self.search.margin || matches!(known, Known::Far(_));
            let travel = if holds {
                self.travel_to_edges(pair, node)
            } else {
                // Else it would be found anew in every tick beside a near edge.
                let lasting = known == Known::Nothing;
                self.edge_leaf(pair, here, node, lasting)
            };
            let distance = larger(distance, travel);
            ancestors.note(if distance > self.search.margin {
                self.coherence.set_distance(key, distance)
            } else {
                Bound::NOW
            });
        }
        ancestors.close(index, self.coherence);
        None
    }

    /// Travel within which a bound expires early, m, see [`EARLY_M`].
    pub fn early_m(&self) -> f32 {
        EARLY_M + 2.0 * EARLY_TICKS as f32 * self.search.way
    }

    /// Whether a node whose bound has not expired is visited all the same, see [`EARLY_M`].
    #[inline]
    fn due(&self, key: Key, bound: Bound, leaf: bool, early: f32) -> bool {
        let soon = bound.expires_within(self.horizon, early);
        soon && (!leaf || self.coherence.is_turn_of(key, EARLY_TICKS))
    }

    /// Compares the pieces of a leaf with the other part's edges and offers their contacts. Returns what the object must travel until two of them can
    /// touch, m: 0 where they may touch in this tick, or where a `lasting` bound is not asked for.
    #[inline(never)]
    fn edge_leaf(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        node: &NodeRecord,
        lasting: bool,
    ) -> f32 {
        let key = pair.keys.of(leaf.node);
        let cached = self.coherence.cached_pairs(key, self.horizon);
        let entry = match cached {
            CachedPairs::In(entry) => Some(entry),
            CachedPairs::Wanted(entry) => self.keep_pairs(pair, key, node, entry),
            CachedPairs::Many | CachedPairs::Unknown(_) => None,
        };
        let rest_m = match entry {
            Some(entry) => self.cross_kept(pair, leaf, node, entry),
            None if self.cross_all(pair, leaf, node) => {
                if let CachedPairs::Unknown(entry) = cached {
                    (self.coherence).want_pairs(entry, key, self.horizon, KEPT_M);
                }
                0.0
            }
            None => f32::INFINITY,
        };
        if rest_m > self.search.margin && lasting && self.left() > 0 {
            // Lasts longer than the entry.
            self.travel_to_edges(pair, node)
        } else if rest_m == f32::INFINITY {
            0.0
        } else {
            rest_m
        }
    }

    /// Makes an entry of the edge cache: the pairs of pieces that can touch within some travel. `None` where there are too many, or the travel would soon be
    /// used up.
    fn keep_pairs(
        &mut self,
        pair: &DirectedPair<'_>,
        key: Key,
        node: &NodeRecord,
        entry: Entry,
    ) -> Option<Entry> {
        let way = self.search.way;
        let kept_m = smaller(KEPT_M + KEPT_TICKS * way, MOST_KEPT_M);
        if kept_m < LEAST_KEPT_TICKS * way {
            return None;
        }
        let reach = self.reach() + kept_m;
        self.coherence.begin_pairs(entry, key, self.horizon, kept_m);
        let mut has_space = true;
        self.near_groups(pair, node, reach, |search, near| {
            has_space = has_space && search.keep_near(pair, node, entry, near, reach);
        });
        has_space.then_some(entry)
    }

    /// Adds the pairs of pieces of a leaf and `near` ones of the other part that are at most `reach` (m) apart to an entry. Returns whether there was space for
    /// them.
    fn keep_near(
        &mut self,
        pair: &DirectedPair<'_>,
        node: &NodeRecord,
        entry: Entry,
        near: &[(u32, &EdgeRecord)],
        reach: f32,
    ) -> bool {
        let rotation = pair.to_field.rotation();
        for (own_number, record) in node.points(pair.edges.pieces).iter().enumerate() {
            let own = Piece::placed(record, pair.to_field.apply(record.center), rotation);
            let (center, radius) = own.sphere();
            self.spent += PIECE + EDGE_BOUND * near.len() as u32;
            for (number, other) in near {
                if is_within(other, center, radius, reach)
                    && self.is_near(&own, other, reach)
                    && !self.coherence.add_pair(entry, own_number, *number)
                {
                    return false;
                }
            }
        }
        true
    }

    /// Compares the pairs of an entry that may touch and offers their contacts. Returns what the object must travel until any of them can touch, m.
    fn cross_kept(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        node: &NodeRecord,
        entry: Entry,
    ) -> f32 {
        let rotation = pair.to_field.rotation();
        let records = node.points(pair.edges.pieces);
        self.spent += KEPT_PAIR * self.coherence.pairs(entry) as u32;
        let mut from = 0;
        while let Some((number, kept)) = self.coherence.next_pair(entry, from, self.horizon) {
            from = number + 1;
            let other = pair.field_edges.pieces.get(usize::from(kept.other));
            let Some((record, other)) = records.get(usize::from(kept.own)).zip(other) else {
                continue;
            };
            self.spent += PIECE;
            let own = Piece::placed(record, pair.to_field.apply(record.center), rotation);
            let other = Piece::fixed(other);
            let compared = self.compare(pair, leaf, &own, &other);
            let rest_m = self.rest_m(&own, &other, compared);
            if rest_m > self.search.margin {
                let beyond_m = rest_m - self.search.margin;
                let key = pair.keys.of(leaf.node);
                (self.coherence).rest_pair(entry, number, key, self.horizon, beyond_m);
            }
        }
        self.coherence.pairs_rest(entry)
    }

    /// Compares all pieces of a leaf with those near it and offers their contacts. Returns whether any may touch before long.
    fn cross_all(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, node: &NodeRecord) -> bool {
        let mut any_near = false;
        self.near_groups(pair, node, self.reach(), |search, near| {
            any_near |= search.cross(pair, leaf, node, near);
        });
        any_near
    }

    /// Distance within which pieces are compared, m.
    fn reach(&self) -> f32 {
        self.search.margin + DEEPEST_M
    }

    /// What the object must travel until the pieces of a leaf can touch an edge of the other part, m: a lower bound that is to last for a while, at most
    /// [`RESERVE_M`] and [`RESERVE_TICKS`].
    #[inline(never)]
    fn travel_to_edges(&mut self, pair: &DirectedPair<'_>, node: &NodeRecord) -> f32 {
        let reserve = self.search.margin + DEEPEST_M + RESERVE_M + RESERVE_TICKS * self.search.way;
        let mut least = reserve;
        self.spent += EDGE_TRAVEL;
        self.near_groups(pair, node, reserve, |search, near| {
            least = search.clear(pair, node, near, least);
        });
        least - DEEPEST_M
    }

    /// Passes to `visit` all pieces of the other part's edges whose spheres lie within `reach` (m) of a leaf's sphere, in groups.
    #[inline(always)]
    fn near_groups<'i>(
        &mut self,
        pair: &DirectedPair<'i>,
        node: &NodeRecord,
        reach: f32,
        mut visit: impl FnMut(&mut Self, &[(u32, &'i EdgeRecord)]),
    ) {
        let mut near = Near::new();
        self.near_edges(pair, node, reach, |search, other| {
            // Emptied when full, so there is space.
            let _ = near.push(other);
            if near.is_full() {
                visit(search, &near);
                near.clear();
            }
        });
        if !near.is_empty() {
            visit(self, &near);
        }
    }

    /// Passes to `visit` every piece of the other part's edges whose sphere lies within `reach` (m) of a leaf's sphere.
    #[inline(always)]
    fn near_edges<'i>(
        &mut self,
        pair: &DirectedPair<'i>,
        leaf: &NodeRecord,
        reach: f32,
        mut visit: impl FnMut(&mut Self, (u32, &'i EdgeRecord)),
    ) {
        let (center, radius) = (pair.to_field.apply(leaf.center), leaf.radius);
        let tree = pair.field_edges;
        let mut index = 0;
        while let Some(node) = tree.nodes.get(index as usize) {
            self.spent += EDGE_NODE;
            let farthest = radius + node.radius + reach;
            if (Vec3::from_array(node.center) - center).length_squared() > farthest * farthest {
                index = node.skip;
                continue;
            }
            index += 1;
            if node.skip != index {
                continue;
            }
            for (number, record) in (node.first_point..).zip(node.points(tree.pieces)) {
                self.spent += EDGE_BOUND;
                if is_within(record, center, radius, reach) {
                    visit(self, (number, record));
                }
            }
        }
    }

    /// Offers the crossings of the pieces of a leaf with `near` pieces of the other part. Returns whether any may touch before long.
    fn cross(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        node: &NodeRecord,
        near: &[(u32, &EdgeRecord)],
    ) -> bool {
        let rotation = pair.to_field.rotation();
        let reach = self.reach();
        let mut any_near = false;
        for record in node.points(pair.edges.pieces) {
            let own = Piece::placed(record, pair.to_field.apply(record.center), rotation);
            let (center, radius) = own.sphere();
            self.spent += PIECE + EDGE_BOUND * near.len() as u32;
            for (_, other) in near {
                if !is_within(other, center, radius, reach) || !self.is_near(&own, other, reach) {
                    continue;
                }
                let compared = self.compare(pair, leaf, &own, &Piece::fixed(other));
                any_near |= !matches!(compared, Compared::Far(_) | Compared::Along(_));
            }
        }
        any_near
    }

    /// Offers the crossing of two pieces.
    #[inline]
    fn compare(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        own: &Piece<'_>,
        other: &Piece<'_>,
    ) -> Compared {
        self.spent += EDGE_PAIR;
        let (from, distance) = nearest(own, other);
        if distance > self.reach() {
            return Compared::Far(distance);
        }
        if run_along(own, other, from) {
            return Compared::Along(distance);
        }
        self.spent += FEET_STEP * feet_steps(own, other) as u32;
        let feet = match feet(own, other, from, self.most_turn()) {
            Ok(feet) => feet,
            Err(rest_m) => return Compared::Beside(rest_m),
        };
        self.spent += CROSSING;
        match crossing(own, other, pair.to_field.rotation(), feet) {
            Meeting::Crossing(found) => {
                self.touch(pair, leaf, [own.record, other.record], &found);
                Compared::Crossing(found.gap)
            }
            Meeting::Averted(angle) => Compared::Averted(angle),
            Meeting::Beside => Compared::Beside(0.0),
        }
    }

    /// Whether a piece is at most `reach` (m) apart from the sphere about another one.
    #[inline]
    fn is_near(&mut self, own: &Piece<'_>, other: &EdgeRecord, reach: f32) -> bool {
        self.spent += PIECE_BOUND;
        own.is_near((Vec3::from_array(other.center), other.radius), reach)
    }

    /// The circle through a piece, which is kept in `known`; `None` for a straight one.
    #[inline]
    fn circle<'c>(&mut self, known: &'c mut Option<Circle>, piece: &Piece<'_>) -> Option<&'c Circle> {
        if known.is_none() {
            *known = Circle::of(piece);
            self.spent += CIRCLE * u32::from(known.is_some());
        }
        known.as_ref()
    }

    /// The smaller of `least` and what the pieces of a leaf can travel until they come to cross one of `near`, and [`DEEPEST_M`], m.
    fn clear(
        &mut self,
        pair: &DirectedPair<'_>,
        node: &NodeRecord,
        near: &[(u32, &EdgeRecord)],
        mut least: f32,
    ) -> f32 {
        let rotation = pair.to_field.rotation();
        // Found where they are asked for.
        let mut circles: [Option<Circle>; NEAR_PIECES] = [const { None }; NEAR_PIECES];
        // Long enough that the distance, which costs more, is not asked for.
        let lasting = self.search.margin + DEEPEST_M + EARLY_M;
        let turn = self.most_turn();
        for record in node.points(pair.edges.pieces) {
            let own = Piece::placed(record, pair.to_field.apply(record.center), rotation);
            let (center, radius) = own.sphere();
            let mut circle = None;
            self.spent += PIECE + EDGE_BOUND * near.len() as u32;
            for ((_, other), other_circle) in near.iter().zip(&mut circles) {
                if !is_within(other, center, radius, least) || !self.is_near(&own, other, least) {
                    continue;
                }
                let other = &Piece::fixed(other);
                self.spent += CIRCLE_PAIR;
                let travel = (self.circle(&mut circle, &own))
                    .and_then(|own| Some(own.travel(self.circle(other_circle, other)?, turn)));
                let along = travel.map_or(0.0, |travel| DEEPEST_M + travel);
                least = if along > lasting {
                    smaller(least, along)
                } else {
                    self.spent += EDGE_PAIR;
                    smaller(least, larger(along, nearest(&own, other).1))
                };
            }
        }
        least
    }

    /// The most by which the held part turns for its travel, 1/m: a part that turns by an angle travels at least that times its radius.
    fn most_turn(&self) -> f32 {
        let held = self.search.parts.get(usize::from(self.search.held));
        held.map_or(0.0, |part| 1.0 / part.radius)
    }

    /// What the object must travel until two pieces that were compared can touch, m; at most 0 where that is not known.
    #[inline]
    fn rest_m(&mut self, own: &Piece<'_>, other: &Piece<'_>, compared: Compared) -> f32 {
        match compared {
            Compared::Far(distance) => distance - DEEPEST_M,
            Compared::Along(distance) => {
                self.spent += 2 * CIRCLE + CIRCLE_PAIR;
                let circles = Circle::of(own).zip(Circle::of(other));
                let along = circles.map_or(0.0, |(own, other)| own.travel(&other, self.most_turn()));
                larger(along, distance - DEEPEST_M)
            }
            // The distance of two edges that cross is their gap.
            Compared::Crossing(gap) => gap,
            Compared::Averted(angle) => angle / self.most_turn(),
            Compared::Beside(rest_m) => rest_m,
        }
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
        contact.single = true;
        contact.leaf = leaf;
    }
}

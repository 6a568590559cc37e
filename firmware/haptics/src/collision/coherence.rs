//! Temporal coherence: how far the object must travel before a node's points can touch (its *advancement bound*).
//!
//! A node whose points are all at least D from the other part cannot hold a candidate until some point of the object has travelled D − margin. The
//! travel is summed once a tick from a bound on the speed of any point, so the bounds are conservative and the candidates are the same with and
//! without them. Bounds are kept in a direct-mapped table: a collision costs a field query, never a contact. A node that was near is assumed to be
//! near still, without a field query, and is queried again once in [`QUERY_AGAIN`] ticks. Travel is counted in whole nanometres, rounded to the safe
//! side, so that none is lost to rounding.
//!
//! A node that contact exclusions keep apart from everything within reach also counts as far, as long as each of those exclusions holds. Such entries
//! carry an epoch, which ends with any exclusion.
//!
//! A node's bound is at most the smallest bound of the nodes below it, so far regions are skipped in large pieces. For a near leaf the table stores
//! which of its points are near, and the bound of the others.
//!
//! Cost: some 25 instructions for a node with a valid entry, against some 200 for a field query.

use crate::collision::edge_cache::{CachedPairs, EdgeCache, Entry, PiecePair};
use crate::collision::face_cache::{CachedFace, FaceCache};
use crate::collision::node_key::{ALL, Key, Points, SLOTS};

/// Travel beyond which it is reset to zero and the table is cleared: 1.8 m.
const LONGEST_NM: u32 = 1_800_000_000;
// Bounds stay clear of the flag [`EXCLUDED`].
const _: () = assert!(LONGEST_NM + FARTHEST_NM < EXCLUDED);
/// Flag in the bound of a node that a contact exclusion keeps apart.
const EXCLUDED: u32 = 1 << 31;
/// Largest bound ahead of the travel: 268 mm.
const FARTHEST_NM: u32 = 1 << 28;
/// Period, in ticks, after which a near node is queried again and all points of a near leaf are evaluated; a power of two. The phase depends on the
/// node, so that the work is spread over ticks.
const QUERY_AGAIN: u32 = 16;
/// Flag in the bound of a leaf that is far by its points although its sphere is not: when the bound expires, the points are evaluated directly.
const BY_POINTS: u32 = 1;

/// Advancement bounds of nodes, cached faces, and near pairs of pieces of edges.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Coherence {
    travel_nm: u32,
    /// Entries with bounds up to this travel are void.
    invalidated_nm: u32,
    /// Tick counter.
    round: u32,
    /// Epoch of the contact exclusions.
    epoch: u16,
    slots: [Slot; SLOTS],
    face_cache: FaceCache,
    edge_cache: EdgeCache,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    tag: u16,
    /// Near points; none for a far node, all for a near inner node. With [`EXCLUDED`] the epoch instead.
    near: Points,
    /// Travel at which the bound of the other points, or of all, expires.
    bound_nm: u32,
}

impl Slot {
    /// All zero, so that a fresh table lies in zeroed memory rather than being copied from flash.
    const EMPTY: Self = Self {
        tag: 0,
        near: 0,
        bound_nm: 0,
    };
}

/// Stored knowledge of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Known {
    /// None of its points can be a candidate before this [`Bound`].
    Far(Bound),
    /// The node was near not long ago: only these of its points can be candidates.
    Near(Points),
    /// The bounds of all points of this leaf have expired, and its sphere did not show it to be far when last queried.
    Expired,
    /// No entry, or the node is to be queried again.
    Nothing,
}

/// Advancement bound: the travel (as [`Coherence`] sums it, nm) at which a node must be evaluated again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Bound(u32);

impl Bound {
    /// Expires at every tick.
    pub const NOW: Self = Self(0);
    /// Never expires: the neutral element when bounds are combined.
    pub const NEVER: Self = Self(u32::MAX);

    /// Whether it expires within `distance` m past the `horizon` (see [`Coherence::horizon`]).
    #[inline]
    pub fn expires_within(self, horizon: u32, distance: f32) -> bool {
        self.0 <= horizon.saturating_add(up_nm(distance))
    }
}

impl Coherence {
    pub const fn new() -> Self {
        Self {
            travel_nm: 0,
            invalidated_nm: 0,
            round: 0,
            epoch: 0,
            slots: [Slot::EMPTY; SLOTS],
            face_cache: FaceCache::new(),
            edge_cache: EdgeCache::new(),
        }
    }

    /// Voids all entries. For a jump of the object, or other parts. The nodes' turns begin anew: where a tick's budget ends the search, what it found
    /// depends on them, and a run after a reset must not depend on what went before.
    pub fn invalidate(&mut self) {
        // Equivalent to travelling past every bound: clearing the table costs more than most ticks.
        self.add_travel(FARTHEST_NM);
        self.invalidated_nm = self.travel_nm;
        self.round = 0;
    }

    fn add_travel(&mut self, nm: u32) {
        self.travel_nm = self.travel_nm.saturating_add(nm);
        if self.travel_nm > LONGEST_NM {
            self.clear();
        }
    }

    /// Resets the travel, and voids all entries by their tags: a third of the instructions of zeroing all of the table.
    #[cold]
    #[inline(never)]
    fn clear(&mut self) {
        (self.travel_nm, self.invalidated_nm, self.epoch) = (0, 0, 0);
        for slot in &mut self.slots {
            slot.tag = Slot::EMPTY.tag;
        }
        self.face_cache.clear();
        self.edge_cache.clear();
    }

    /// Adds the object's motion: no point moved by more than `distance` m.
    pub fn travelled(&mut self, distance: f32) {
        self.round = self.round.wrapping_add(1);
        self.add_travel(up_nm(distance));
    }

    /// Travel up to which bounds count as expired, for points within `margin` m; input of [`Self::query`].
    pub fn horizon(&self, margin: f32) -> u32 {
        self.travel_nm.saturating_add(up_nm(margin))
    }

    /// Stored knowledge of a node, for points that come within the `horizon`. The nodes below an inner node have more precise entries than the node
    /// itself: when its bound has expired, they are looked at, not the node's sphere.
    #[inline]
    pub fn query(&self, key: Key, horizon: u32, leaf: bool) -> Known {
        let slot = &self.slots[key.slot()];
        if slot.tag != key.tag() || slot.bound_nm <= self.invalidated_nm {
            return Known::Nothing;
        }
        if slot.bound_nm >= EXCLUDED {
            // Ancestors cannot distinguish exclusion entries, so their bound must not outlive the exclusion.
            return if slot.near == self.epoch && slot.bound_nm & !EXCLUDED > horizon {
                Known::Far(Bound::NOW)
            } else {
                Known::Nothing
            };
        }
        let reached = slot.bound_nm <= horizon;
        if slot.near == 0 && !reached {
            return Known::Far(Bound(slot.bound_nm));
        }
        let requery = self.is_turn_of(key, QUERY_AGAIN);
        match (leaf, slot.near) {
            (false, _) if requery => Known::Nothing,
            (false, 0) => Known::Expired,
            (false, _) => Known::Near(ALL),
            // Once in [`QUERY_AGAIN`] ticks the sphere is queried: it may show by now that the leaf is far.
            (true, 0) if requery || slot.bound_nm & BY_POINTS == 0 => Known::Nothing,
            (true, 0) => Known::Expired,
            (true, _) if requery => Known::Expired,
            (true, near) => Known::Near(if reached { ALL } else { near }),
        }
    }

    /// Whether it is this node's turn, which each node has once in `ticks` (a power of two); consecutive nodes have theirs in consecutive ticks.
    #[inline]
    pub fn is_turn_of(&self, key: Key, ticks: u32) -> bool {
        self.round.wrapping_add(key.0).is_multiple_of(ticks)
    }

    /// Stores that no point of the node is nearer than `distance` m, by its sphere.
    #[inline]
    pub fn set_distance(&mut self, key: Key, distance: f32) -> Bound {
        let Bound(bound_nm) = self.bound_after(key, distance);
        self.set_bound(key, Bound(bound_nm & !BY_POINTS))
    }

    /// Stores that no point of the leaf is nearer than `distance` m, by each of its points.
    #[inline]
    pub fn set_far(&mut self, key: Key, distance: f32) -> Bound {
        let Bound(bound_nm) = self.bound_after(key, distance);
        // The flag must not round the bound up.
        self.set_bound(key, Bound(bound_nm.saturating_sub(1) | BY_POINTS))
    }

    /// Stores that no node below this one has a bound smaller than `bound`.
    #[inline]
    pub fn set_bound(&mut self, key: Key, bound: Bound) -> Bound {
        let bound_nm = smaller_of(bound.0, self.travel_nm + FARTHEST_NM);
        self.set(key, 0, bound_nm);
        Bound(bound_nm)
    }

    /// Stores that the node is near.
    #[inline]
    pub fn set_near(&mut self, key: Key) {
        // Expires at once, but is a valid entry.
        self.set(key, ALL, self.travel_nm + 1);
    }

    /// Stores which of the leaf's points are near, and that the others are no nearer than `distance` m.
    #[inline]
    pub fn set_points(&mut self, key: Key, near: Points, distance: f32) {
        let Bound(bound_nm) = self.bound_after(key, distance);
        self.set(key, near, bound_nm);
    }

    /// Stores that no point of the node can touch anything but the faces that exclusions keep it from, before it has travelled `distance` m.
    pub fn set_excluded(&mut self, key: Key, distance: f32) {
        let Bound(bound_nm) = self.bound_after(key, distance);
        self.set(key, self.epoch, bound_nm | EXCLUDED);
    }

    /// Face near the selected points of a leaf, if cached.
    #[inline(always)]
    pub fn cached_face(&self, leaf: Key, which: Points) -> CachedFace {
        self.face_cache.get(leaf, which, self.travel_nm)
    }

    /// The travel for which the cached face of a leaf holds, m: beyond so much there may be others.
    pub fn cached_face_rest(&self, leaf: Key) -> f32 {
        rest_m(self.face_cache.until(leaf), self.travel_nm)
    }

    /// Caches the one face within `distance` m of the selected points of a leaf, or `None` where there is more than one.
    pub fn cache_face(&mut self, leaf: Key, which: Points, face: Option<u16>, distance: f32) {
        if !leaf.is_none() {
            // The node's share of the distance: not all leaves expire in the same tick.
            let Bound(until_nm) = self.bound_after(leaf, distance);
            self.face_cache.set(leaf, which, face, until_nm);
        }
    }

    /// What is known of the edges of a leaf up to the `horizon` (see [`Self::horizon`]).
    #[inline]
    pub fn cached_pairs(&self, leaf: Key, horizon: u32) -> CachedPairs {
        if leaf.is_none() {
            CachedPairs::Many
        } else {
            self.edge_cache.get(leaf, self.travel_nm, horizon)
        }
    }

    /// Begins an entry for a leaf of whose edges no pairs but those added can touch within a travel of `distance` m past the `horizon`.
    pub fn begin_pairs(&mut self, entry: Entry, leaf: Key, horizon: u32, distance: f32) {
        (self.edge_cache).begin(entry, leaf, Self::bound_past(leaf, horizon, distance));
    }

    /// Reserves a free entry for a leaf with near edges, for a travel of `distance` m past the `horizon`.
    pub fn want_pairs(&mut self, entry: Entry, leaf: Key, horizon: u32, distance: f32) {
        (self.edge_cache).want(entry, leaf, Self::bound_past(leaf, horizon, distance));
    }

    /// Adds a pair to an entry, see [`EdgeCache::push`].
    pub fn add_pair(&mut self, entry: Entry, own: usize, other: u32) -> bool {
        self.edge_cache.push(entry, own, other)
    }

    /// Number of pairs of an entry.
    pub fn pairs(&self, entry: Entry) -> usize {
        self.edge_cache.len(entry)
    }

    /// The first pair of an entry from number `from` on that may touch before the `horizon`, and its number.
    #[inline]
    pub fn next_pair(&self, entry: Entry, from: usize, horizon: u32) -> Option<(usize, PiecePair)> {
        self.edge_cache.next(entry, from, horizon)
    }

    /// Notes that a pair of a leaf's entry cannot touch within a travel of `distance` m past the `horizon`.
    pub fn rest_pair(&mut self, entry: Entry, number: usize, leaf: Key, horizon: u32, distance: f32) {
        (self.edge_cache).rest(entry, number, Self::bound_past(leaf, horizon, distance));
    }

    /// The travel within which nothing of an entry can touch, m.
    pub fn pairs_rest(&self, entry: Entry) -> f32 {
        rest_m(self.edge_cache.until(entry), self.travel_nm)
    }

    /// Voids all exclusion entries; for when any exclusion has ended.
    pub fn end_exclusions(&mut self) {
        match self.epoch.checked_add(1) {
            Some(next) => self.epoch = next,
            None => {
                self.invalidate();
                self.epoch = 0;
            }
        }
    }

    /// Travel at which the node's share of `distance` m is used up.
    #[inline]
    fn bound_after(&self, key: Key, distance: f32) -> Bound {
        Bound(Self::bound_past(key, self.travel_nm, distance))
    }

    /// The same, counted from a travel `from`, nm.
    #[inline]
    fn bound_past(key: Key, from: u32, distance: f32) -> u32 {
        // A float that is negative or not a number becomes 0, a huge one the largest number.
        let ahead = (distance * (key.share() * 1e9)) as u32;
        from.saturating_add(smaller_of(ahead, FARTHEST_NM))
    }

    #[inline]
    fn set(&mut self, key: Key, near: Points, bound_nm: u32) {
        if !key.is_none() {
            let tag = key.tag();
            self.slots[key.slot()] = Slot { tag, near, bound_nm };
        }
    }
}

fn smaller_of(a: u32, b: u32) -> u32 {
    if b < a { b } else { a }
}

/// What is left of a travel up to `until`, m.
fn rest_m(until_nm: u32, travel_nm: u32) -> f32 {
    // Rounded down by more than the product's error.
    until_nm.saturating_sub(travel_nm) as f32 * (0.999_999 * 1e-9)
}

/// Nanometres, rounded up past any rounding of the single-precision product.
fn up_nm(distance: f32) -> u32 {
    ((distance * (1.000_001 * 1e9)) as u32).saturating_add(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::node_key::{Keys, LONGEST_SHARE, NODES, PAIRS, SHORTEST_SHARE};

    fn key_of(pair: u16, node: u32) -> Key {
        Keys::new(pair, node as usize + 1).of(node)
    }

    fn is_far(known: Known) -> bool {
        matches!(known, Known::Far(_))
    }

    #[test]
    fn query_needed_once_the_distance_is_travelled() {
        let mut c = Coherence::new();
        let key = key_of(3, 77);
        assert_eq!(c.query(key, c.horizon(0.0), true), Known::Nothing);
        c.set_distance(key, 1e-3);
        assert!(is_far(c.query(key, c.horizon(0.0), true)));
        assert!(is_far(c.query(key, c.horizon(0.44e-3), true)));
        assert_eq!(c.query(key, c.horizon(0.91e-3), true), Known::Nothing);
        for _ in 0..44 {
            c.travelled(1e-5);
            assert!(is_far(c.query(key, c.horizon(0.0), true)));
        }
        for _ in 0..47 {
            c.travelled(1e-5);
        }
        assert_eq!(c.query(key, c.horizon(0.0), true), Known::Nothing);
    }

    /// The shares cover the whole range evenly: each of eight parts of it holds an eighth of a thousand nodes, four standard deviations of 10.5
    /// allowed.
    #[test]
    fn shares_lie_between_their_bounds_and_differ() {
        let mut seen = [0u32; 8];
        for node in 0..1000 {
            let share = key_of(3, node).share();
            assert!(
                (SHORTEST_SHARE - 1e-6..=LONGEST_SHARE).contains(&share),
                "{share}"
            );
            let part = (LONGEST_SHARE - share) / (LONGEST_SHARE - SHORTEST_SHARE) * 8.0;
            seen[(part as usize).min(7)] += 1;
        }
        assert!(seen.iter().all(|n| (125 - 42..=125 + 42).contains(n)), "{seen:?}");
    }

    #[test]
    fn excluded_nodes_are_far_until_an_exclusion_ends() {
        let mut c = Coherence::new();
        let key = key_of(PAIRS - 1, NODES - 1);
        assert_eq!(key.tag(), u16::MAX, "the largest, and not that of an empty slot");
        for _ in 0..20 {
            c.set_excluded(key, 1e-3);
            assert!(is_far(c.query(key, c.horizon(0.4e-3), true)));
            assert_eq!(c.query(key, c.horizon(1e-3), true), Known::Nothing);
            c.end_exclusions();
            assert_eq!(c.query(key, c.horizon(0.0), true), Known::Nothing);
        }
        // Entries of different epochs are distinct, and distinct from entries without one.
        let mut c = Coherence::new();
        c.set_distance(key, 1e-3);
        for _ in 0..3 {
            c.end_exclusions();
        }
        assert!(is_far(c.query(key, c.horizon(0.0), true)));
    }

    #[test]
    fn a_collision_evicts() {
        let mut c = Coherence::new();
        let (a, b) = (key_of(0, 5), key_of(0, 5 + SLOTS as u32));
        c.set_distance(a, 1.0);
        c.set_distance(b, 1.0);
        assert_eq!(c.query(a, c.horizon(0.0), true), Known::Nothing);
        assert!(is_far(c.query(b, c.horizon(0.0), true)));
    }

    #[test]
    fn no_bound_outlasts_long_travel() {
        let mut c = Coherence::new();
        let key = key_of(0, 0);
        for start in 0..20 {
            c.set_distance(key, f32::INFINITY);
            assert!(is_far(c.query(key, c.horizon(0.2), true)), "{start}");
            c.travelled(0.2);
            assert_eq!(c.query(key, c.horizon(0.1), true), Known::Nothing);
        }
    }

    #[test]
    fn nothing_is_known_once_invalidated() {
        let mut c = Coherence::new();
        for start in 0..20 {
            let key = |node| key_of(3, node);
            c.set_distance(key(0), f32::INFINITY);
            c.set_bound(key(1), Bound::NEVER);
            c.set_points(key(2), 5, f32::INFINITY);
            c.set_excluded(key(3), f32::INFINITY);
            c.set_near(key(4));
            c.invalidate();
            for node in 0..5 {
                for leaf in [false, true] {
                    let known = c.query(key(node), c.horizon(0.0), leaf);
                    assert_eq!(known, Known::Nothing, "{start}: {node}");
                }
            }
        }
    }

    /// Every kind of entry is found, right after an invalidation too.
    #[test]
    fn entries_are_found_after_invalidation() {
        let mut c = Coherence::new();
        for _ in 0..20 {
            c.invalidate();
            c.set_near(key_of(3, 1));
            c.set_points(key_of(3, 2), 5, 1e-3);
            c.set_distance(key_of(3, 3), 1e-3);
            let query = |node| c.query(key_of(3, node), c.horizon(0.0), true);
            // Each is queried again in one of 16 ticks.
            for (node, known) in [(1, Known::Near(ALL)), (2, Known::Near(5))] {
                let requery = c
                    .round
                    .wrapping_add(key_of(3, node).0)
                    .is_multiple_of(QUERY_AGAIN);
                assert_eq!(query(node), if requery { Known::Expired } else { known });
            }
            assert!(is_far(query(3)));
            c.travelled(0.0);
        }
    }

    #[test]
    fn no_bound_from_a_meaningless_distance() {
        let mut c = Coherence::new();
        c.travelled(1e-3);
        for distance in [-1.0, 0.0, f32::NAN, f32::NEG_INFINITY] {
            c.set_distance(key_of(1, 1), distance);
            assert_eq!(
                c.query(key_of(1, 1), c.horizon(0.0), true),
                Known::Nothing,
                "{distance}"
            );
        }
    }

    #[test]
    fn near_nodes_are_queried_again() {
        let mut c = Coherence::new();
        let key = key_of(1, 9);
        let (mut queried, mut expired) = (0, 0);
        for _ in 0..4 * QUERY_AGAIN {
            c.set_near(key);
            queried += u32::from(c.query(key, c.horizon(1.0), false) == Known::Nothing);
            expired += u32::from(c.query(key, c.horizon(1.0), true) == Known::Expired);
            c.travelled(0.0);
        }
        assert_eq!((queried, expired), (4, 4));
    }

    /// A leaf that is far by its points only is evaluated when its bound expires, and its sphere is queried once in [`QUERY_AGAIN`] ticks.
    #[test]
    fn far_by_points_expires_without_a_node_query() {
        let mut c = Coherence::new();
        let key = key_of(1, 9);
        let mut queried = 0;
        for _ in 0..4 * QUERY_AGAIN {
            c.set_far(key, 1e-3);
            assert!(is_far(c.query(key, c.horizon(0.7e-3), true)));
            match c.query(key, c.horizon(0.9e-3), true) {
                Known::Expired => {}
                known => {
                    assert_eq!(known, Known::Nothing);
                    queried += 1;
                }
            }
            c.travelled(0.0);
        }
        assert_eq!(queried, 4);
    }
}

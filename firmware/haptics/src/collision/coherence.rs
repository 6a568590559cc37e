//! What need not be looked at yet: how far the object must travel before a node's points can touch.
//!
//! A node whose points are all at least D from the other part cannot hold a candidate until some point of the object has travelled
//! D − margin. The travel is added up once a tick from a bound on the speed of any point, so the due times are conservative and the
//! candidates found are the same with and without them. They are kept in a direct-mapped table: a collision costs a look-up, never a contact.
//! A node that was near is taken to be near still, without asking the field, and asked again once in [`QUERY_AGAIN`] ticks. Whole numbers of
//! nanometres, rounded to the safe side, so that no travel is lost to rounding.
//!
//! A node that exclusions keep apart from all it could meet is far too, as long as every one of those exclusions lasts: what was noted so is told from the
//! rest by an epoch that ends with any of them.
//!
//! A node is due no sooner than the first of those below it, so what is far is passed over in large pieces. Of a leaf that is near it is noted which
//! of its points are, and how long the others can be left alone.
//!
//! Cost: some 25 instructions for a node of which enough is known, against some 200 for asking the field.

use crate::collision::face_cache::{CachedFace, FaceCache};
use crate::collision::node_key::{ALL, Key, Points, SLOTS};

/// The travel is taken back to zero, and the table cleared, beyond this: 1.8 m.
const LONGEST_NM: u32 = 1_800_000_000;
// Dues stay clear of [`EXCLUDED`].
const _: () = assert!(LONGEST_NM + FARTHEST_NM < EXCLUDED);
/// Set in the due of a node that a exclusion keeps apart.
const EXCLUDED: u32 = 1 << 31;
/// No due lies farther ahead: 268 mm.
const FARTHEST_NM: u32 = 1 << 28;
/// Ticks after which a node that was near is asked again, or all points of such a leaf are looked at; a power of two. Which tick depends on the
/// node, so that the work is spread.
const QUERY_AGAIN: u32 = 16;
/// Set in the due of a leaf whose sphere did not tell that it is far, but its points did: when it is due, so are they.
const BY_POINTS: u32 = 1;

/// Bound times of nodes.
// In this order: what is asked with every node lies at offsets that fit an instruction.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Coherence {
    travel_nm: u32,
    /// What was noted at up to this travel is void.
    invalidated_nm: u32,
    /// Counts ticks.
    round: u32,
    /// Of the exclusions.
    epoch: u16,
    slots: [Slot; SLOTS],
    face_cache: FaceCache,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    tag: u16,
    /// Points that are near: none of a node that is far, or of an inner one. With [`EXCLUDED`] the epoch instead.
    near: Points,
    /// The travel at which the others, or all, are due.
    bound_nm: u32,
}

impl Slot {
    /// All zero, so that a fresh table lies in memory that is cleared rather than copied from flash.
    const EMPTY: Self = Self {
        tag: 0,
        near: 0,
        bound_nm: 0,
    };
}

/// What is known of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Known {
    /// None of its points can be a candidate before this [`Bound`].
    Far(Bound),
    /// It was near not long ago: none but these of its points can be a candidate.
    Near(Points),
    /// A leaf all of whose points are due, and whose sphere told nothing when it was last asked.
    Expired,
    /// Nothing, or nothing of late.
    Nothing,
}

/// When a node is to be looked at again: the travel, nm, as [`Coherence`] adds it up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Bound(u32);

impl Bound {
    /// At every tick.
    pub const NOW: Self = Self(0);
    /// Never, before others have had their say.
    pub const NEVER: Self = Self(u32::MAX);
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
        }
    }

    /// Everything is due. For a jump of the object, or other parts.
    pub fn invalidate(&mut self) {
        // As if it had travelled past every due: exclusion_work the table costs more than most ticks.
        self.add_travel(FARTHEST_NM);
        self.invalidated_nm = self.travel_nm;
    }

    fn add_travel(&mut self, nm: u32) {
        self.travel_nm = self.travel_nm.saturating_add(nm);
        if self.travel_nm > LONGEST_NM {
            // In place: made anew it would pass over the stack, which has not room for many such.
            (self.travel_nm, self.invalidated_nm, self.epoch) = (0, 0, 0);
            self.slots.fill(Slot::EMPTY);
            self.face_cache.clear();
        }
    }

    /// The object moved, no point of it by more than `distance` m.
    pub fn travelled(&mut self, distance: f32) {
        self.round = self.round.wrapping_add(1);
        self.add_travel(up_nm(distance));
    }

    /// The travel that leaves `margin` m unseen: to be given to [`Self::query`].
    pub fn horizon(&self, margin: f32) -> u32 {
        self.travel_nm.saturating_add(up_nm(margin))
    }

    /// What is known of a node, for points that come within the `horizon`. More is known of what lies below an inner node than of the node: when it
    /// is due, it counts as near.
    #[inline]
    pub fn query(&self, key: Key, horizon: u32, leaf: bool) -> Known {
        let slot = &self.slots[key.slot()];
        if slot.tag != key.tag() || slot.bound_nm <= self.invalidated_nm {
            return Known::Nothing;
        }
        if slot.bound_nm >= EXCLUDED {
            // What is above cannot tell it from other dues, and must not outlast the exclusion.
            return if slot.near == self.epoch && slot.bound_nm & !EXCLUDED > horizon {
                Known::Far(Bound::NOW)
            } else {
                Known::Nothing
            };
        }
        let due = slot.bound_nm <= horizon;
        if slot.near == 0 && !due {
            return Known::Far(Bound(slot.bound_nm));
        }
        let again = self.round.wrapping_add(key.0).is_multiple_of(QUERY_AGAIN);
        match (leaf, slot.near) {
            (false, _) if again => Known::Nothing,
            (false, _) => Known::Near(ALL),
            // Now and then it is seen whether the sphere tells by now.
            (true, 0) if again || slot.bound_nm & BY_POINTS == 0 => Known::Nothing,
            (true, 0) => Known::Expired,
            (true, _) if again => Known::Expired,
            (true, near) => Known::Near(if due { ALL } else { near }),
        }
    }

    /// No point of the node is nearer than `distance` m, as its sphere tells now.
    #[inline]
    pub fn set_distance(&mut self, key: Key, distance: f32) -> Bound {
        let Bound(bound_nm) = self.ahead(key, distance);
        self.set_bound(key, Bound(bound_nm & !BY_POINTS))
    }

    /// No point of the leaf is nearer than `distance` m, as each of them tells now.
    #[inline]
    pub fn set_far(&mut self, key: Key, distance: f32) -> Bound {
        let Bound(bound_nm) = self.ahead(key, distance);
        // No later than that.
        self.set_bound(key, Bound(bound_nm.saturating_sub(1) | BY_POINTS))
    }

    /// No node below this one is due before `due`.
    #[inline]
    pub fn set_bound(&mut self, key: Key, due: Bound) -> Bound {
        let bound_nm = smaller_of(due.0, self.travel_nm + FARTHEST_NM);
        self.set(key, 0, bound_nm);
        Bound(bound_nm)
    }

    /// The node is near.
    #[inline]
    pub fn set_near(&mut self, key: Key) {
        // Bound at once, but not forgotten.
        self.set(key, ALL, self.travel_nm + 1);
    }

    /// Of the leaf's points these are near, the others no nearer than `distance` m.
    #[inline]
    pub fn set_points(&mut self, key: Key, near: Points, distance: f32) {
        let Bound(bound_nm) = self.ahead(key, distance);
        self.set(key, near, bound_nm);
    }

    /// No point of the node can touch anything but what exclusions keep it from before it has travelled `distance` m.
    pub fn set_excluded(&mut self, key: Key, distance: f32) {
        let Bound(bound_nm) = self.ahead(key, distance);
        self.set(key, self.epoch, bound_nm | EXCLUDED);
    }

    /// What these points of a leaf have to do with.
    #[inline(always)]
    pub fn cached_face(&self, leaf: Key, which: Points) -> CachedFace {
        self.face_cache.get(leaf, which, self.travel_nm)
    }

    /// All that these points of a leaf find within `distance` m of where they are has to do with this face, or with more than one.
    pub fn cache_face(&mut self, leaf: Key, which: Points, face: Option<u16>, distance: f32) {
        if !leaf.is_none() {
            // Not all leaves in the same tick again.
            let Bound(until_nm) = self.ahead(leaf, distance);
            self.face_cache.set(leaf, which, face, until_nm);
        }
    }

    /// Some exclusion is no more: what was noted for it is void.
    pub fn end_exclusions(&mut self) {
        match self.epoch.checked_add(1) {
            Some(next) => self.epoch = next,
            None => {
                self.invalidate();
                self.epoch = 0;
            }
        }
    }

    /// When the node's share of `distance` m will be used up.
    #[inline]
    fn ahead(&self, key: Key, distance: f32) -> Bound {
        // A float that is negative or not a number becomes 0, a huge one the largest number.
        let ahead = (distance * (key.share() * 1e9)) as u32;
        Bound(self.travel_nm + smaller_of(ahead, FARTHEST_NM))
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
    fn due_once_the_distance_is_used_up() {
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

    /// Over the whole range, and evenly: each of eight parts of it holds an eighth of a thousand nodes, four standard deviations of 10.5 allowed.
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
    fn what_joints_keep_apart_is_far_while_they_last() {
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
        // Every epoch's keys are told apart, and from those without.
        let mut c = Coherence::new();
        c.set_distance(key, 1e-3);
        for _ in 0..3 {
            c.end_exclusions();
        }
        assert!(is_far(c.query(key, c.horizon(0.0), true)));
    }

    #[test]
    fn a_collision_forgets() {
        let mut c = Coherence::new();
        let (a, b) = (key_of(0, 5), key_of(0, 5 + SLOTS as u32));
        c.set_distance(a, 1.0);
        c.set_distance(b, 1.0);
        assert_eq!(c.query(a, c.horizon(0.0), true), Known::Nothing);
        assert!(is_far(c.query(b, c.horizon(0.0), true)));
    }

    #[test]
    fn no_due_outlasts_long_travel() {
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
    fn nothing_is_known_once_forgotten() {
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

    /// Whatever was noted, right after everything was forgotten too.
    #[test]
    fn what_is_noted_is_known() {
        let mut c = Coherence::new();
        for _ in 0..20 {
            c.invalidate();
            c.set_near(key_of(3, 1));
            c.set_points(key_of(3, 2), 5, 1e-3);
            c.set_distance(key_of(3, 3), 1e-3);
            let ask = |node| c.query(key_of(3, node), c.horizon(0.0), true);
            // Each in one of 16 ticks is asked again.
            for (node, known) in [(1, Known::Near(ALL)), (2, Known::Near(5))] {
                let again = c
                    .round
                    .wrapping_add(key_of(3, node).0)
                    .is_multiple_of(QUERY_AGAIN);
                assert_eq!(ask(node), if again { Known::Expired } else { known });
            }
            assert!(is_far(ask(3)));
            c.travelled(0.0);
        }
    }

    #[test]
    fn nothing_nearer_than_nothing() {
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
    fn near_is_asked_again() {
        let mut c = Coherence::new();
        let key = key_of(1, 9);
        let (mut asked, mut looked_at) = (0, 0);
        for _ in 0..4 * QUERY_AGAIN {
            c.set_near(key);
            asked += u32::from(c.query(key, c.horizon(1.0), false) == Known::Nothing);
            looked_at += u32::from(c.query(key, c.horizon(1.0), true) == Known::Expired);
            c.travelled(0.0);
        }
        assert_eq!((asked, looked_at), (4, 4));
    }

    /// A leaf that only its points told to be far is looked at when due, and now and then asked.
    #[test]
    fn far_by_points_is_due_without_asking() {
        let mut c = Coherence::new();
        let key = key_of(1, 9);
        let mut asked = 0;
        for _ in 0..4 * QUERY_AGAIN {
            c.set_far(key, 1e-3);
            assert!(is_far(c.query(key, c.horizon(0.7e-3), true)));
            match c.query(key, c.horizon(0.9e-3), true) {
                Known::Expired => {}
                known => {
                    assert_eq!(known, Known::Nothing);
                    asked += 1;
                }
            }
            c.travelled(0.0);
        }
        assert_eq!(asked, 4);
    }
}

//! Edge cache: for a leaf of edges, the pairs of its pieces and the other part's that can come near each other, and for each the travel until it must be
//! compared again.
//!
//! Without it the other part's tree is traversed and every piece compared with all near the leaf in each tick, four fifths of the cost of edges that
//! stay near others, such as those along a prism in its hole. Each leaf has two slots of the table, which [`super::coherence`] owns; where other leaves have
//! both, it is compared in full. So is a leaf whose edges were not near when it was last compared: most leaves never come near others.
//!
//! Cost: some 12 instructions for a pair that need not be compared; some 30 field queries to make an entry.

use crate::collision::node_key::Key;

/// Entries in the table. A power of two.
const SLOTS: usize = 1 << SLOT_BITS;
const SLOT_BITS: u32 = 7;
/// Pairs of pieces in an entry.
const MOST: usize = 20;
/// Length of an entry whose leaf has more pairs than that.
const TOO_MANY: u8 = 254;
/// Length of an entry that is to be made when the leaf is compared again.
const WANTED: u8 = 255;

/// A pair of pieces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PiecePair {
    /// Travel up to which it cannot touch, nm.
    until_nm: u32,
    /// Piece of the other part.
    pub other: u16,
    /// Piece of the leaf, counted from its first.
    pub own: u8,
}

/// Near pairs of pieces, by leaf.
#[derive(Clone, Debug)]
pub(crate) struct EdgeCache {
    slots: [Slot; SLOTS],
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    leaf: Key,
    /// Travel at which the entry expires, nm.
    until_nm: u32,
    /// Number of pairs, or [`TOO_MANY`], or [`WANTED`].
    len: u8,
    pairs: [PiecePair; MOST],
}

impl Slot {
    /// All zero, so that a fresh table lies in zeroed memory rather than being copied from flash.
    const EMPTY: Self = Self {
        leaf: Key::NONE,
        until_nm: 0,
        len: 0,
        pairs: [PiecePair {
            until_nm: 0,
            other: 0,
            own: 0,
        }; MOST],
    };

    /// What its entry says up to the `horizon_nm`, a travel.
    fn known(&self, entry: Entry, horizon_nm: u32) -> CachedPairs {
        let holds = horizon_nm < self.until_nm;
        match self.len {
            0 if !holds => CachedPairs::Unknown(entry),
            WANTED => CachedPairs::Wanted(entry),
            _ if !holds => CachedPairs::Wanted(entry),
            TOO_MANY => CachedPairs::Many,
            _ => CachedPairs::In(entry),
        }
    }
}

/// What is known of the edges of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CachedPairs {
    /// No pairs but those of the entry in this slot can touch.
    In(Entry),
    /// There are more than an entry holds, or both slots hold valid entries of other leaves.
    Many,
    /// No valid entry, but the leaf had near edges when it was last compared: this one is worth making.
    Wanted(Entry),
    /// Nothing; this entry is free.
    Unknown(Entry),
}

/// An entry, by its slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry(u8);

impl EdgeCache {
    pub const fn new() -> Self {
        Self {
            slots: [Slot::EMPTY; SLOTS],
        }
    }

    pub fn clear(&mut self) {
        for slot in &mut self.slots {
            (slot.leaf, slot.until_nm) = (Key::NONE, 0);
        }
    }

    /// What is known of a leaf's edges up to the `horizon_nm`, a travel; the travel now is `travel_nm`.
    pub fn get(&self, leaf: Key, travel_nm: u32, horizon_nm: u32) -> CachedPairs {
        // Hashed: near leaves lie at regular distances in a tree.
        let first = (leaf.hash() >> (u32::BITS - SLOT_BITS)) as u8;
        let places = [first, first ^ 1];
        let slot = |place: u8| &self.slots[usize::from(place)];
        if let Some(place) = places.into_iter().find(|&place| slot(place).leaf == leaf) {
            return slot(place).known(Entry(place), horizon_nm);
        }
        let free = places
            .into_iter()
            .find(|&place| travel_nm >= slot(place).until_nm);
        free.map_or(CachedPairs::Many, |place| CachedPairs::Unknown(Entry(place)))
    }

    /// Reserves a free entry for a leaf, to be made when the leaf is compared again.
    pub fn want(&mut self, entry: Entry, leaf: Key, until_nm: u32) {
        self.begin(entry, leaf, until_nm);
        self.slots[usize::from(entry.0)].len = WANTED;
    }

    /// Begins an entry without pairs.
    pub fn begin(&mut self, Entry(place): Entry, leaf: Key, until_nm: u32) {
        let slot = &mut self.slots[usize::from(place)];
        (slot.leaf, slot.until_nm, slot.len) = (leaf, until_nm, 0);
    }

    /// Adds a pair, which is to be compared at once. Returns whether there was space for it; else the entry says that there are too many.
    pub fn push(&mut self, Entry(place): Entry, own: usize, other: u32) -> bool {
        let slot = &mut self.slots[usize::from(place)];
        let numbers = u8::try_from(own).ok().zip(u16::try_from(other).ok());
        let free = slot.pairs.get_mut(usize::from(slot.len)).zip(numbers);
        let Some((pair, (own, other))) = free else {
            slot.len = TOO_MANY;
            return false;
        };
        *pair = PiecePair {
            until_nm: 0,
            other,
            own,
        };
        slot.len += 1;
        true
    }

    /// Number of pairs of an entry.
    pub fn len(&self, Entry(place): Entry) -> usize {
        let len = usize::from(self.slots[usize::from(place)].len);
        if len <= MOST { len } else { 0 }
    }

    /// The first pair from number `from` on that may touch before the `horizon_nm`, and its number.
    #[inline]
    pub fn next(&self, Entry(place): Entry, from: usize, horizon_nm: u32) -> Option<(usize, PiecePair)> {
        let slot = &self.slots[usize::from(place)];
        let pairs = slot.pairs.get(..usize::from(slot.len))?;
        let mut number = from;
        while let Some(pair) = pairs.get(number) {
            if pair.until_nm <= horizon_nm {
                return Some((number, *pair));
            }
            number += 1;
        }
        None
    }

    /// Notes that a pair cannot touch up to the given travel.
    pub fn rest(&mut self, Entry(place): Entry, number: usize, until_nm: u32) {
        if let Some(pair) = self.slots[usize::from(place)].pairs.get_mut(number) {
            pair.until_nm = until_nm;
        }
    }

    /// Travel up to which nothing of the entry can touch, nm.
    pub fn until(&self, entry @ Entry(place): Entry) -> u32 {
        let slot = &self.slots[usize::from(place)];
        let pairs = slot.pairs.iter().take(self.len(entry));
        pairs.map(|pair| pair.until_nm).fold(slot.until_nm, u32::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::node_key::Keys;

    fn leaf(node: u32) -> Key {
        Keys::new(3, 100_000).of(node)
    }

    fn made(cache: &mut EdgeCache, leaf: Key, until_nm: u32) -> Entry {
        let CachedPairs::Unknown(entry) = cache.get(leaf, 0, 0) else {
            panic!("its slot is taken");
        };
        cache.begin(entry, leaf, until_nm);
        entry
    }

    #[test]
    fn an_entry_holds_for_its_leaf_and_travel_only() {
        let mut cache = EdgeCache::new();
        let entry = made(&mut cache, leaf(7), 100);
        assert!(cache.push(entry, 1, 300));
        assert_eq!(cache.get(leaf(7), 0, 99), CachedPairs::In(entry));
        assert_eq!(cache.get(leaf(7), 0, 100), CachedPairs::Wanted(entry));
        cache.clear();
        assert_eq!(cache.get(leaf(7), 0, 0), CachedPairs::Unknown(entry));
    }

    /// An entry without pairs is not made again when it expires.
    #[test]
    fn an_entry_is_made_for_a_leaf_that_had_near_edges() {
        let mut cache = EdgeCache::new();
        let CachedPairs::Unknown(entry) = cache.get(leaf(7), 0, 0) else {
            panic!("its slot is taken");
        };
        cache.want(entry, leaf(7), 100);
        assert_eq!(cache.len(entry), 0);
        for horizon in [0, 200] {
            assert_eq!(cache.get(leaf(7), 0, horizon), CachedPairs::Wanted(entry));
        }
        cache.begin(entry, leaf(7), 100);
        assert_eq!(cache.get(leaf(7), 0, 99), CachedPairs::In(entry));
        assert_eq!(cache.get(leaf(7), 0, 100), CachedPairs::Unknown(entry));
    }

    /// Of two slots a leaf gets the one that is free; live entries are neither returned for another leaf nor evicted.
    #[test]
    fn a_slot_holds_one_leaf() {
        let mut cache = EdgeCache::new();
        let first = made(&mut cache, leaf(0), 100);
        let second = Entry(first.0 ^ 1);
        let mut others = (1..100_000)
            .map(leaf)
            .filter(|&l| cache.clone().get(l, 99, 99) == CachedPairs::Unknown(second));
        let [other, third] =
            [others.next(), others.next()].map(|other| other.expect("more leaves than slots"));
        cache.begin(second, other, 200);
        assert_eq!(cache.get(third, 99, 200), CachedPairs::Many);
        assert_eq!(cache.get(third, 100, 200), CachedPairs::Unknown(first));
    }

    #[test]
    fn no_more_pairs_than_it_holds_and_none_of_numbers_too_large() {
        let mut cache = EdgeCache::new();
        let entry = made(&mut cache, leaf(0), 100);
        assert!((0..MOST).all(|own| cache.push(entry, own, 65_535)));
        assert_eq!(cache.get(leaf(0), 0, 0), CachedPairs::In(entry));
        assert!(!cache.push(entry, 0, 0));
        assert_eq!(cache.get(leaf(0), 0, 0), CachedPairs::Many);
        for (own, other) in [(256, 0), (0, 65_536)] {
            cache.begin(entry, leaf(0), 100);
            assert!(!cache.push(entry, own, other));
            assert_eq!(cache.get(leaf(0), 0, 0), CachedPairs::Many);
        }
    }

    #[test]
    fn pairs_at_rest_are_passed_over() {
        let mut cache = EdgeCache::new();
        let entry = made(&mut cache, leaf(0), 100);
        assert_eq!((cache.next(entry, 0, 0), cache.until(entry)), (None, 100));
        for own in 0..3 {
            assert!(cache.push(entry, own, 7));
        }
        assert_eq!((cache.len(entry), cache.until(entry)), (3, 0));
        for (number, until) in [(0, 50), (2, 40)] {
            cache.rest(entry, number, until);
        }
        let numbers = |cache: &EdgeCache, horizon| {
            let mut from = 0;
            core::iter::from_fn(move || {
                let (number, _) = cache.next(entry, from, horizon)?;
                from = number + 1;
                Some(number)
            })
            .fold(0, |all, number| 10 * all + number + 1)
        };
        assert_eq!(numbers(&cache, 39), 2);
        assert_eq!(numbers(&cache, 40), 23);
        assert_eq!(numbers(&cache, 50), 123);
        cache.rest(entry, 1, 60);
        assert_eq!(cache.until(entry), 40);
    }
}

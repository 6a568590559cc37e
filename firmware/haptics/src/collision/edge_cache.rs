//! Edge cache: which pieces of a leaf's edges are near which pieces of the other part's, valid until others can come as near.
//!
//! To find them takes most of the cost of a leaf whose edges are near others in every tick, such as those along a prism in its hole: the other part's
//! tree is traversed, and each piece compared with all that are near the leaf. The table is direct-mapped, like that of [`super::coherence`], which
//! owns it.
//!
//! Cost: some 20 instructions per leaf with a valid entry.

use crate::collision::node_key::Key;

/// Entries in the table. A power of two.
const SLOTS: usize = 1 << SLOT_BITS;
const SLOT_BITS: u32 = 7;
/// Pairs of pieces in an entry.
const MOST: usize = 12;

/// Pairs of a piece of a leaf and one of the other part, in the order in which they are compared; held apart, so that none is padded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PiecePairs {
    len: u8,
    /// Pieces of the leaf, counted from its first.
    own: [u8; MOST],
    other: [u16; MOST],
    /// Whether others are near that cannot face each other.
    pub others_near: bool,
}

impl PiecePairs {
    pub const EMPTY: Self = Self {
        len: 0,
        own: [0; MOST],
        other: [0; MOST],
        others_near: false,
    };

    /// Adds a pair. Returns whether there was space for it.
    pub fn push(&mut self, own: usize, other: u32) -> bool {
        let place = usize::from(self.len);
        let numbers = u8::try_from(own).ok().zip(u16::try_from(other).ok());
        let Some((own, other)) = numbers.filter(|_| place < MOST) else {
            return false;
        };
        (self.own[place], self.other[place]) = (own, other);
        self.len += 1;
        true
    }

    pub fn iter(&self) -> impl Iterator<Item = (usize, usize)> {
        (self.own.iter().zip(&self.other))
            .map(|(&own, &other)| (usize::from(own), usize::from(other)))
            .take(usize::from(self.len))
    }
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
    /// Whether there are more pairs than an entry holds.
    many: bool,
    pairs: PiecePairs,
}

impl Slot {
    /// All zero, so that a fresh table lies in zeroed memory rather than being copied from flash.
    const EMPTY: Self = Self {
        leaf: Key::NONE,
        until_nm: 0,
        many: false,
        pairs: PiecePairs::EMPTY,
    };
}

/// Cached knowledge about the edges of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CachedPairs<'a> {
    /// No other pieces of it can touch an edge.
    Pairs(&'a PiecePairs),
    /// There are more than an entry holds, or the slot holds another leaf's valid entry.
    Many,
    /// No valid entry.
    Unknown,
}

impl EdgeCache {
    pub const fn new() -> Self {
        Self {
            slots: [Slot::EMPTY; SLOTS],
        }
    }

    pub fn clear(&mut self) {
        for slot in &mut self.slots {
            slot.until_nm = 0;
        }
    }

    /// Pairs of a leaf that may touch up to the `horizon_nm`, a travel; the travel now is `travel_nm`.
    #[inline]
    pub fn get(&self, leaf: Key, travel_nm: u32, horizon_nm: u32) -> CachedPairs<'_> {
        let slot = &self.slots[Self::place(leaf)];
        if slot.leaf != leaf && travel_nm < slot.until_nm {
            CachedPairs::Many
        } else if slot.leaf != leaf || horizon_nm >= slot.until_nm {
            CachedPairs::Unknown
        } else if slot.many {
            CachedPairs::Many
        } else {
            CachedPairs::Pairs(&slot.pairs)
        }
    }

    /// Stores the pairs of a leaf, `None` where there are too many, valid until the given travel.
    pub fn set(&mut self, leaf: Key, pairs: Option<PiecePairs>, until_nm: u32) {
        self.slots[Self::place(leaf)] = Slot {
            leaf,
            until_nm,
            many: pairs.is_none(),
            pairs: pairs.unwrap_or(PiecePairs::EMPTY),
        };
    }

    /// Slot of a leaf, hashed: near leaves lie at regular distances in a tree.
    fn place(leaf: Key) -> usize {
        (leaf.hash() >> (u32::BITS - SLOT_BITS)) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::node_key::Keys;

    fn leaf(node: u32) -> Key {
        Keys::new(3, 100_000).of(node)
    }

    #[test]
    fn an_entry_holds_for_its_leaf_and_travel_only() {
        let mut pairs = PiecePairs::EMPTY;
        assert!(pairs.push(1, 300));
        let mut cache = EdgeCache::new();
        assert_eq!(cache.get(leaf(7), 0, 0), CachedPairs::Unknown);
        cache.set(leaf(7), Some(pairs), 100);
        assert_eq!(cache.get(leaf(7), 0, 99), CachedPairs::Pairs(&pairs));
        assert_eq!(cache.get(leaf(7), 0, 100), CachedPairs::Unknown);
        cache.set(leaf(7), None, 100);
        assert_eq!(cache.get(leaf(7), 0, 99), CachedPairs::Many);
        cache.clear();
        assert_eq!(cache.get(leaf(7), 0, 0), CachedPairs::Unknown);
    }

    /// On collision a live entry is neither returned nor evicted.
    #[test]
    fn a_slot_holds_one_leaf() {
        let mut cache = EdgeCache::new();
        let place = |node: &u32| EdgeCache::place(leaf(*node));
        let other = (1..100_000).find(|node| place(node) == place(&0));
        let other = leaf(other.expect("more leaves than places"));
        cache.set(leaf(0), Some(PiecePairs::EMPTY), 100);
        assert_eq!(cache.get(other, 99, 200), CachedPairs::Many);
        assert_eq!(cache.get(other, 100, 200), CachedPairs::Unknown);
    }

    #[test]
    fn no_more_pairs_than_it_holds_and_none_of_numbers_too_large() {
        let mut pairs = PiecePairs::EMPTY;
        assert!(!pairs.push(256, 0) && !pairs.push(0, 65_536));
        assert!((0..MOST).all(|own| pairs.push(own, 65_535)) && !pairs.push(0, 0));
        assert!(pairs.iter().eq((0..MOST).map(|own| (own, 65_535))));
    }
}

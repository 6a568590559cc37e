//! Face cache: the only face near the selected points of a leaf, valid until the points can reach a cell that names another face.
//!
//! A good third of the cost of a point query at a wall is the path to its cell: grid, brick, palette. Where all cells around the near points of a
//! leaf name one face, that cost is saved until the points may have travelled as far as the cells were examined. The table is direct-mapped, like
//! that of [`super::coherence`], which owns it: a leaf whose slot is taken is queried through the cells.
//!
//! Cost: some 20 instructions per leaf with a valid entry, against 80 per point; several hundred to create an entry.

use crate::collision::node_key::{Key, Points};

/// Entries in the table. A power of two.
const SLOTS: usize = 1 << SLOT_BITS;
const SLOT_BITS: u32 = 9;

/// Cached faces of leaves.
#[derive(Clone, Debug)]
pub(crate) struct FaceCache {
    slots: [Slot; SLOTS],
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    leaf: Key,
    /// Travel at which the entry expires, nm.
    until_nm: u32,
    /// Points it covers.
    which: Points,
    /// The face; `None` where more than one face is near, or it could not be determined.
    face: Option<u16>,
}

impl Slot {
    /// All zero, so that a fresh table lies in zeroed memory rather than being copied from flash.
    const EMPTY: Self = Self {
        leaf: Key::NONE,
        until_nm: 0,
        which: 0,
        face: None,
    };
}

/// Cached knowledge about points of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CachedFace {
    /// All cells near them name this face.
    Face(u16),
    /// More than one face is near, or the slot holds another leaf's valid entry: query the cells.
    Several,
    /// No valid entry: a face search is worthwhile.
    Unknown,
}

impl FaceCache {
    pub const fn new() -> Self {
        Self {
            slots: [Slot::EMPTY; SLOTS],
        }
    }

    pub fn clear(&mut self) {
        self.slots.fill(Slot::EMPTY);
    }

    /// Cached face of the selected points of a leaf at the given travel.
    #[inline(always)]
    pub fn get(&self, leaf: Key, which: Points, travel_nm: u32) -> CachedFace {
        let slot = &self.slots[Self::place(leaf)];
        if travel_nm >= slot.until_nm {
            CachedFace::Unknown
        } else if slot.leaf != leaf {
            CachedFace::Several
        } else if which & !slot.which != 0 {
            CachedFace::Unknown
        } else {
            slot.face.map_or(CachedFace::Several, CachedFace::Face)
        }
    }

    /// Travel at which the entry in the slot of a leaf expires, nm.
    pub fn until(&self, leaf: Key) -> u32 {
        self.slots[Self::place(leaf)].until_nm
    }

    /// Stores the face of the selected points of a leaf, valid until the given travel.
    pub fn set(&mut self, leaf: Key, which: Points, face: Option<u16>, until_nm: u32) {
        self.slots[Self::place(leaf)] = Slot {
            leaf,
            until_nm,
            which,
            face,
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

    #[test]
    fn an_entry_holds_for_its_points_and_travel_only() {
        let keys = Keys::new(3, 1000);
        let mut face_cache = FaceCache::new();
        assert_eq!(face_cache.get(keys.of(7), 0b11, 0), CachedFace::Unknown);
        face_cache.set(keys.of(7), 0b0110, Some(5), 100);
        assert_eq!(face_cache.get(keys.of(7), 0b0110, 99), CachedFace::Face(5));
        assert_eq!(face_cache.get(keys.of(7), 0b0010, 0), CachedFace::Face(5));
        assert_eq!(face_cache.get(keys.of(7), 0b1010, 0), CachedFace::Unknown);
        assert_eq!(face_cache.get(keys.of(7), 0b0110, 100), CachedFace::Unknown);
        face_cache.set(keys.of(7), 0b0110, None, 100);
        assert_eq!(face_cache.get(keys.of(7), 0b0110, 0), CachedFace::Several);
        face_cache.clear();
        assert_eq!(face_cache.get(keys.of(7), 0b0110, 0), CachedFace::Unknown);
    }

    /// On collision a live entry is neither returned nor evicted: [`CachedFace::Several`] starts no face search.
    #[test]
    fn a_slot_holds_one_leaf() {
        let keys = Keys::new(0, 100_000);
        let mut face_cache = FaceCache::new();
        let first = keys.of(0);
        let other = (1..100_000)
            .map(|node| keys.of(node))
            .find(|&key| FaceCache::place(key) == FaceCache::place(first))
            .expect("more leaves than places");
        face_cache.set(first, 1, Some(5), 100);
        assert_eq!(face_cache.get(other, 1, 99), CachedFace::Several);
        assert_eq!(face_cache.get(other, 1, 100), CachedFace::Unknown);
    }
}

//! The one face that points of a leaf have to do with, for as long as they cannot come to a cell that names another.
//!
//! Of what it takes to look a point up at a wall the way to its cell is a good third: grid, brick, palette. Where all cells about the near points of
//! a leaf name one face it is spared, until the points may have gone as far as was looked about them. The table is direct-mapped, like that of
//! [`crate::coherence`], which keeps it: whoever finds his place taken goes to the cells.
//!
//! Cost: some 20 instructions a leaf where it is known, against 80 a point; several hundred to find out.

use crate::collision::node_key::{Key, Points};

/// Entries in the table. A power of two.
const SLOTS: usize = 1 << SLOT_BITS;
const SLOT_BITS: u32 = 9;

/// Faces of leaves.
#[derive(Clone, Debug)]
pub(crate) struct FaceCache {
    slots: [Slot; SLOTS],
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    leaf: Key,
    /// Travel before which it holds, nm.
    until_nm: u32,
    /// Of which points.
    which: Points,
    /// None where they have to do with more than one, or it is not known.
    face: Option<u16>,
}

impl Slot {
    /// All zero, so that a fresh table lies in memory that is cleared rather than copied from flash.
    const EMPTY: Self = Self {
        leaf: Key::NONE,
        until_nm: 0,
        which: 0,
        face: None,
    };
}

/// What is known of points of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CachedFace {
    /// All their cells name this face.
    Face(u16),
    /// They do not, or did not when last asked.
    Several,
    /// Not asked.
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

    /// Of these points of a leaf, when the object has travelled so far.
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

    /// Of these points of a leaf, before the object has travelled so far.
    pub fn set(&mut self, leaf: Key, which: Points, face: Option<u16>, until_nm: u32) {
        self.slots[Self::place(leaf)] = Slot {
            leaf,
            until_nm,
            which,
            face,
        };
    }

    /// Leaves that are near lie at regular distances in a tree: they are spread.
    fn place(leaf: Key) -> usize {
        (leaf.hash() >> (u32::BITS - SLOT_BITS)) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::node_key::Keys;

    #[test]
    fn known_of_these_points_and_so_far_only() {
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

    /// Who finds his place taken is neither told another's wall, nor takes it from him while it holds.
    #[test]
    fn a_place_is_one_leafs() {
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

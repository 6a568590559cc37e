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
pub(crate) struct Walls {
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
    wall: Option<u16>,
}

impl Slot {
    /// All zero, so that a fresh table lies in memory that is cleared rather than copied from flash.
    const EMPTY: Self = Self {
        leaf: Key::NONE,
        until_nm: 0,
        which: 0,
        wall: None,
    };
}

/// What is known of points of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wall {
    /// All their cells name this face.
    Face(u16),
    /// They do not, or did not when last asked.
    Several,
    /// Not asked.
    Unknown,
}

impl Walls {
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
    pub fn get(&self, leaf: Key, which: Points, travel_nm: u32) -> Wall {
        let slot = &self.slots[Self::place(leaf)];
        if travel_nm >= slot.until_nm {
            Wall::Unknown
        } else if slot.leaf != leaf {
            Wall::Several
        } else if which & !slot.which != 0 {
            Wall::Unknown
        } else {
            slot.wall.map_or(Wall::Several, Wall::Face)
        }
    }

    /// Of these points of a leaf, before the object has travelled so far.
    pub fn set(&mut self, leaf: Key, which: Points, wall: Option<u16>, until_nm: u32) {
        self.slots[Self::place(leaf)] = Slot {
            leaf,
            until_nm,
            which,
            wall,
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
        let mut walls = Walls::new();
        assert_eq!(walls.get(keys.of(7), 0b11, 0), Wall::Unknown);
        walls.set(keys.of(7), 0b0110, Some(5), 100);
        assert_eq!(walls.get(keys.of(7), 0b0110, 99), Wall::Face(5));
        assert_eq!(walls.get(keys.of(7), 0b0010, 0), Wall::Face(5));
        assert_eq!(walls.get(keys.of(7), 0b1010, 0), Wall::Unknown);
        assert_eq!(walls.get(keys.of(7), 0b0110, 100), Wall::Unknown);
        walls.set(keys.of(7), 0b0110, None, 100);
        assert_eq!(walls.get(keys.of(7), 0b0110, 0), Wall::Several);
        walls.clear();
        assert_eq!(walls.get(keys.of(7), 0b0110, 0), Wall::Unknown);
    }

    /// Who finds his place taken is neither told another's wall, nor takes it from him while it holds.
    #[test]
    fn a_place_is_one_leafs() {
        let keys = Keys::new(0, 100_000);
        let mut walls = Walls::new();
        let first = keys.of(0);
        let other = (1..100_000)
            .map(|node| keys.of(node))
            .find(|&key| Walls::place(key) == Walls::place(first))
            .expect("more leaves than places");
        walls.set(first, 1, Some(5), 100);
        assert_eq!(walls.get(other, 1, 99), Wall::Several);
        assert_eq!(walls.get(other, 1, 100), Wall::Unknown);
    }
}

//! Which faces a region of a field has to do with.

use super::field::Field;
use super::records::*;

/// What `good` tells of a palette: an entry a bit.
const MOST_ENTRIES: u16 = u16::BITS as u16;
/// What coming to a brick takes, in reads.
const BRICK: u32 = 6;

impl Field<'_> {
    /// Whether a look-up anywhere from `low` to `high` (cells from the grid's corner) finds a cell that names this face and no other. Unlike
    /// [`Self::only`] nothing found is not enough; when the answer is no all the same, and the cost, are as there.
    pub fn all_at(&self, low: [f32; 3], high: [f32; 3], reads: &mut u32, face: u16) -> bool {
        (0..3).all(|a| low[a] >= 0.0 && high[a] < self.cells[a])
            && self.region(low, high, reads, |found| found == Some(face))
    }

    /// Whether a look-up anywhere from `low` to `high` (cells from the grid's corner) finds nothing, or nothing but faces that `these` says yes to,
    /// by their exact surfaces. No is also the answer where more than `reads` would have to be read to tell, where either is no number, and of
    /// voxmaps.
    ///
    /// Cost: what is taken off `reads`, each some 8 instructions: 6 for a brick, one for each entry of its palette, and, of a brick that has to do
    /// with other faces too, one for each cell of the region.
    pub fn only(&self, low: [f32; 3], high: [f32; 3], reads: &mut u32, these: impl Fn(u16) -> bool) -> bool {
        self.region(low, high, reads, |found| found.is_none_or(&these))
    }

    /// Whether all that a look-up from `low` to `high` finds is good: the one face of a cell, or nothing at all.
    #[inline]
    fn region(
        &self,
        low: [f32; 3],
        high: [f32; 3],
        reads: &mut u32,
        is_good: impl Fn(Option<u16>) -> bool,
    ) -> bool {
        if self.is_occupancy() || !(0..3).all(|a| low[a] <= high[a]) {
            return false;
        }
        let (mut first, mut last) = ([0u32; 3], [0u32; 3]);
        for a in 0..3 {
            let (from, to, cells) = (low[a], high[a], self.cells[a]);
            if to < 0.0 || from >= cells {
                // All of it is beyond the grid.
                return true;
            }
            first[a] = from as u32;
            last[a] = if to < cells { to as u32 } else { cells as u32 - 1 };
        }
        let brick = |cell: u32| cell / BRICK_CELLS as u32;
        for z in brick(first[2])..=brick(last[2]) {
            for y in brick(first[1])..=brick(last[1]) {
                for x in brick(first[0])..=brick(last[0]) {
                    let at = [x, y, z].map(|b| b * BRICK_CELLS as u32);
                    let from = core::array::from_fn(|a| first[a].max(at[a]) - at[a]);
                    let to = core::array::from_fn(|a| last[a].min(at[a] + BRICK_CELLS as u32 - 1) - at[a]);
                    if !self.in_brick([x, y, z], from, to, reads, &is_good) {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// The same of cells `from..=to` of a brick.
    #[inline]
    fn in_brick(
        &self,
        at: [u32; 3],
        from: [u32; 3],
        to: [u32; 3],
        reads: &mut u32,
        is_good: &impl Fn(Option<u16>) -> bool,
    ) -> bool {
        if !take(reads, BRICK) {
            return false;
        }
        let dims = self.record.brick_dims.map(u32::from);
        let index = (at[2] * dims[1] + at[1]) * dims[0] + at[0];
        let brick = match GridEntry::from_bits(self.grid[index as usize]) {
            GridEntry::Empty { inside, .. } => return !inside && is_good(None),
            GridEntry::Brick(number) => &self.bricks[number as usize],
        };
        let entries = brick.palette_len;
        if entries > MOST_ENTRIES || !take(reads, u32::from(entries)) {
            return false;
        }
        let palette = &self.palette[brick.palette as usize..][..usize::from(entries)];
        let mut good = 0u32;
        for (i, &bits) in palette.iter().enumerate() {
            // Where more than one face is near, not all of them are these.
            good |= u32::from(bits <= Nearby::MAX_FACES && is_good(Some(bits))) << i;
        }
        if good.count_ones() == u32::from(entries) {
            return true;
        }
        let count: u32 = (0..3).map(|a| to[a] - from[a] + 1).product();
        if good == 0 || brick.index_bits != 4 || !take(reads, count) {
            return false;
        }
        // Four bits a cell, so that a row is one word.
        let across = to[0] - from[0] + 1;
        (from[2]..=to[2]).all(|z| {
            (from[1]..=to[1]).all(|y| {
                let start = brick.indices as usize + (y << 2 | z << 5) as usize;
                let Some(row) = self.blob[start..].first_chunk() else {
                    return false;
                };
                let mut cells = u32::from_le_bytes(*row) >> (4 * from[0]);
                for _ in 0..across {
                    if good >> (cells & 15) & 1 == 0 {
                        return false;
                    }
                    cells >>= 4;
                }
                true
            })
        })
    }
}

/// Whether there are so many left; then they are no more.
fn take(left: &mut u32, wanted: u32) -> bool {
    match left.checked_sub(wanted) {
        Some(rest) => {
            *left = rest;
            true
        }
        None => {
            *left = 0;
            false
        }
    }
}

// A row is the eight cells of four bits in a word.
const _: () = assert!(4 * BRICK_CELLS as u32 == u32::BITS);

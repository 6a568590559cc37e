//! Faces that a region of a field refers to.

use super::field::Field;
use super::nearby::Nearby;
use super::records::*;

/// Most palette entries whose result `good` can hold: one bit each.
const MOST_ENTRIES: u16 = u16::BITS as u16;
/// Cost of reaching a brick, in reads.
const BRICK: u32 = 6;

impl Field<'_> {
    /// Whether every query from `low` to `high` (cells from the grid's corner) finds a cell that refers to this face only. Unlike in [`Self::only`],
    /// finding nothing is not sufficient; the other conditions for `false`, and the cost, are the same.
    pub fn all_at(&self, low: [f32; 3], high: [f32; 3], reads: &mut u32, face: u16) -> bool {
        (0..3).all(|a| low[a] >= 0.0 && high[a] < self.cells[a])
            && self.region(low, high, reads, |found| found == Some(face))
    }

    /// Whether queries from `low` to `high` (cells from the grid's corner) find nothing, or only faces that `these` accepts, through their exact
    /// surfaces. It also returns `false` when the test would need more than `reads` reads, when a bound is NaN, and for voxmaps.
    ///
    /// Cost: the amount subtracted from `reads`, each about 8 instructions: 6 for a brick, one for each entry of its palette, and, for a brick that
    /// also refers to other faces, one for each cell of the region.
    pub fn only(&self, low: [f32; 3], high: [f32; 3], reads: &mut u32, these: impl Fn(u16) -> bool) -> bool {
        self.region(low, high, reads, |found| found.is_none_or(&these))
    }

    /// Whether `is_good` accepts everything that queries from `low` to `high` find: the single face of a cell, or nothing.
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
                // The whole region is outside the grid.
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

    /// The same test for cells `from..=to` of a brick.
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
            // A cell with several near faces is never accepted.
            good |= u32::from(bits <= Nearby::MAX_FACES && is_good(Some(bits))) << i;
        }
        if good.count_ones() == u32::from(entries) {
            return true;
        }
        let count: u32 = (0..3).map(|a| to[a] - from[a] + 1).product();
        if good == 0 || brick.index_bits != 4 || !take(reads, count) {
            return false;
        }
        // Four bits per cell, so that a row is one word.
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

/// Whether at least `wanted` are left, and subtracts them; sets `left` to 0 otherwise.
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

// A row is eight cells of four bits, one word.
const _: () = assert!(4 * BRICK_CELLS as u32 == u32::BITS);

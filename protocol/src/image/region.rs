//! Which faces a region of a field has to do with.

use super::field::Field;
use super::records::*;

/// A palette of no more entries is read as a whole before cells are.
const SHORT_PALETTE: u16 = 4;
/// Cells read in one brick, at most: those next to a cell on all sides.
const MOST_CELLS: u32 = 27;

impl Field<'_> {
    /// Whether a look-up anywhere within `reach` cells (at most 8) of `g` along each axis finds nothing, or nothing but faces that `these` says yes to, by
    /// their exact surfaces. `g` in cells from the grid's corner. No is also the answer where that takes more work than it is worth, and of voxmaps.
    ///
    /// Cost: at most 8 bricks, and in each at most 27 cells.
    pub fn only(&self, g: [f32; 3], reach: f32, these: impl Fn(u16) -> bool) -> bool {
        if self.is_occupancy() {
            return false;
        }
        let (mut low, mut high) = ([0u32; 3], [0u32; 3]);
        for a in 0..3 {
            let (from, to) = (g[a] - reach, g[a] + reach);
            if to < 0.0 || from >= self.cells[a] {
                // All of it is beyond the grid.
                return true;
            }
            low[a] = from as u32;
            high[a] = if to < self.cells[a] {
                to as u32
            } else {
                self.cells[a] as u32 - 1
            };
            if !(reach <= 8.0 && high[a] - low[a] <= 17) {
                return false;
            }
        }
        let brick = |cell: u32| cell / BRICK_CELLS as u32;
        for z in brick(low[2])..=brick(high[2]) {
            for y in brick(low[1])..=brick(high[1]) {
                for x in brick(low[0])..=brick(high[0]) {
                    let at = [x, y, z].map(|b| b * BRICK_CELLS as u32);
                    let from = core::array::from_fn(|a| low[a].max(at[a]) - at[a]);
                    let to = core::array::from_fn(|a| high[a].min(at[a] + BRICK_CELLS as u32 - 1) - at[a]);
                    if !self.brick_only([x, y, z], from, to, &these) {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// The same of cells `from..=to` of a brick.
    fn brick_only(&self, at: [u32; 3], from: [u32; 3], to: [u32; 3], these: &impl Fn(u16) -> bool) -> bool {
        let dims = self.record.brick_dims.map(u32::from);
        let index = (at[2] * dims[1] + at[1]) * dims[0] + at[0];
        let brick = match GridEntry::from_bits(self.grid[index as usize]) {
            GridEntry::Empty { inside, .. } => return !inside,
            GridEntry::Brick(number) => &self.bricks[number as usize],
        };
        let palette = &self.palette[brick.palette as usize..][..usize::from(brick.palette_len)];
        let good = |nearby: Nearby| matches!(nearby, Nearby::Face(face) if these(face));
        // Groups are not among the entries that are good: they need not be read.
        if brick.palette_len <= SHORT_PALETTE
            && palette
                .iter()
                .all(|&bits| good(Nearby::from_bits(bits, |_| None)))
        {
            return true;
        }
        let count: u32 = (0..3).map(|a| to[a] - from[a] + 1).product();
        count <= MOST_CELLS
            && (from[2]..=to[2]).all(|z| {
                (from[1]..=to[1]).all(|y| {
                    (from[0]..=to[0]).all(|x| good(self.nearby_in(brick, (x | y << 3 | z << 6) as usize)))
                })
            })
    }
}

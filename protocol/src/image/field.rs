//! In-place queries of a signed-distance field.
//!
//! A brick stores samples only if some cell of it is interpolated. In the others the surfaces that the cells name give the distance; the queries here,
//! which know no surfaces, return 0 there: a bound that excludes nothing, without a gradient that could push.
//!
//! Trilinear interpolation inside a stored brick: on a cylinder of radius R the error is about cell²/(8R). Cost: about half of the 300 instructions
//! that a point near the surface takes in a tick, counted on an emulated Cortex-M7 on 2026-11-21.

use super::nearby::{Group, MOST_LEVELS, Nearby};
use super::records::*;

/// A field and the arrays it refers to. Created by [`super::SceneImage`], which has checked every index.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    pub(super) record: &'a FieldRecord,
    pub(super) grid: &'a [u16],
    pub(super) bricks: &'a [BrickRecord],
    pub(super) palette: &'a [u16],
    pub(super) blob: &'a [u8],
    pub(super) inverse_cell: f32,
    /// Cells along x, y, z.
    pub(super) cells: [f32; 3],
    /// Lower bound of the distance from the surface to the grid's sides, cells.
    pub(super) padding: f32,
}

/// Result of a field query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lookup {
    /// The position is in a stored brick.
    Near(FieldSample),
    /// No surface within `bound` metres.
    Far {
        /// Whether it is inside the solid.
        inside: bool,
        /// Lower bound of the distance to the surface, m.
        bound: f32,
    },
}

/// Result of a field query without interpolation.
#[derive(Clone, Copy, Debug)]
pub enum Place<'a> {
    /// The position is in a cell of a stored brick.
    Cell(Cell<'a>),
    /// As [`Lookup::Far`].
    Far {
        /// Whether it is inside the solid.
        inside: bool,
        /// Lower bound of the distance to the surface, m.
        bound: f32,
    },
}

/// A position in a cell of a stored brick.
#[derive(Clone, Copy, Debug)]
pub struct Cell<'a> {
    brick: &'a BrickRecord,
    /// Palette entry: the nearest faces of the cell.
    entry: u16,
    /// Number of finer bricks that it is in.
    level: u16,
    /// Index of the cell in the brick.
    index: usize,
    /// The position, in cells from the corner of the grid, or of the finer brick.
    at: [f32; 3],
}

/// Distance and gradient at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldSample {
    /// Signed distance to the surface, m, negative inside. Clamped to the band.
    pub distance: f32,
    /// Gradient (points outward), close to unit length within the band.
    pub gradient: [f32; 3],
    /// Nearest surface (see [`super::Surfaces`]), or [`NO_FACE`].
    pub face: u16,
    /// The nearest surfaces, and how they give the distance.
    pub nearby: Nearby,
}

impl<'a> Field<'a> {
    /// The stored record.
    pub fn record(&self) -> &'a FieldRecord {
        self.record
    }

    /// Distance, gradient and face at `p` (m, shape frame), or a lower bound; distance and gradient 0 in a brick without samples. A non-finite `p` is far outside with bound 0. A voxmap has no
    /// distances: it returns bounds everywhere, to its surface voxels.
    #[inline]
    pub fn lookup(&self, p: [f32; 3]) -> Lookup {
        match self.place(p) {
            Place::Cell(cell) => Lookup::Near(self.sample(&cell)),
            Place::Far { inside, bound } => Lookup::Far { inside, bound },
        }
    }

    /// Signed distance at `p` (m, shape frame) if stored there, 0 in a brick without samples, else the signed lower bound: sufficient for culling,
    /// without the cost of the gradient.
    #[inline]
    pub fn bound(&self, p: [f32; 3]) -> f32 {
        match self.place(p) {
            Place::Cell(cell) => self.distance(&cell),
            Place::Far { inside: true, bound } => -bound,
            Place::Far { inside: false, bound } => bound,
        }
    }

    /// `p` (m, shape frame) in cells from the grid's corner.
    #[inline(always)]
    pub fn in_cells(&self, p: [f32; 3]) -> [f32; 3] {
        let o = &self.record.origin;
        let k = self.inverse_cell;
        [(p[0] - o[0]) * k, (p[1] - o[1]) * k, (p[2] - o[2]) * k]
    }

    /// Cell that contains `p` (m, shape frame), without interpolation, for a caller that evaluates the exact surfaces. A voxmap has no cells of
    /// distances: it returns bounds everywhere, as in [`Self::lookup`].
    #[inline(always)]
    pub fn place(&self, p: [f32; 3]) -> Place<'a> {
        let g = self.in_cells(p);
        if !self.holds(g) {
            return Place::Far {
                inside: false,
                bound: self.beyond(g),
            };
        }
        let (entry, index) = self.entry(g);
        match entry {
            GridEntry::Brick(number) => {
                let brick = &self.bricks[number as usize];
                if self.is_occupancy() {
                    return self.voxel_as_far(brick, index);
                }
                let cell = Cell {
                    brick,
                    index,
                    at: g,
                    entry: self.palette_entry(brick, index),
                    level: 0,
                };
                if Nearby::is_finer(cell.entry) {
                    return Place::Cell(self.finest(&cell));
                }
                Place::Cell(cell)
            }
            GridEntry::Empty { inside, cells } => Place::Far {
                inside,
                bound: f32::from(cells) * self.record.cell,
            },
        }
    }

    /// The cell at the same position in the finest brick that covers this one.
    #[cold]
    fn finest(&self, cell: &Cell<'a>) -> Cell<'a> {
        let mut cell = *cell;
        for _ in 0..MOST_LEVELS {
            let Some(brick) = self.finer(&cell) else { break };
            // Below 8: the fraction is below 1 by at least a rounding step.
            let at = within(cell.at).map(|f| f * BRICK_CELLS as f32);
            let index = index_in_brick(at.map(|a| a as u32));
            cell = Cell {
                brick,
                index,
                at,
                entry: self.palette_entry(brick, index),
                level: cell.level + 1,
            };
        }
        cell
    }

    /// The finer brick that covers a cell, if any.
    #[inline]
    fn finer(&self, cell: &Cell<'_>) -> Option<&'a BrickRecord> {
        let number = Nearby::finer(cell.entry, self.palette.get(cell.brick.palette as usize..)?)?;
        self.bricks.get(usize::from(number))
    }

    /// Nearest faces of a cell.
    #[inline(always)]
    pub fn nearby(&self, cell: &Cell<'_>) -> Nearby {
        self.decoded(cell.brick, cell.entry)
    }

    /// Meaning of a palette entry of a brick.
    #[inline(always)]
    fn decoded(&self, brick: &BrickRecord, entry: u16) -> Nearby {
        let palette = &self.palette[brick.palette as usize..];
        Nearby::from_bits(entry, |at| Group::read(palette.get(usize::from(at)..)?))
    }

    /// Nearest faces of the cell with this index in a brick.
    #[inline]
    pub(super) fn nearby_in(&self, brick: &BrickRecord, index: usize) -> Nearby {
        self.decoded(brick, self.palette_entry(brick, index))
    }

    /// Sum of the grid's sides, m.
    #[inline]
    pub fn extent_m(&self) -> f32 {
        (self.cells[0] + self.cells[1] + self.cells[2]) * self.record.cell
    }

    /// Interpolated distance in a cell, m; 0 without samples.
    #[inline(always)]
    pub fn distance(&self, cell: &Cell<'_>) -> f32 {
        value(&self.corners(cell.brick, cell.index), within(cell.at)) * (self.record.scale * cell.scale())
    }

    /// Interpolated distance and its gradient in a cell; 0 without samples.
    #[inline(always)]
    pub fn sample(&self, cell: &Cell<'_>) -> FieldSample {
        let corners = self.corners(cell.brick, cell.index);
        let per_cell = self.record.scale * self.inverse_cell;
        let nearby = self.nearby(cell);
        FieldSample {
            distance: value(&corners, within(cell.at)) * (self.record.scale * cell.scale()),
            gradient: gradient(&corners, within(cell.at)).map(|x| x * per_cell),
            face: nearby.face(),
            nearby,
        }
    }

    /// Whether a grid position lies in the grid; false for NaN.
    ///
    /// Compares bit patterns: those of positive numbers are ordered like the numbers, those of negative numbers and NaN are greater than all of
    /// these.
    #[inline(always)]
    pub(super) fn holds(&self, g: [f32; 3]) -> bool {
        let n = &self.cells;
        g[0].to_bits() < n[0].to_bits() && g[1].to_bits() < n[1].to_bits() && g[2].to_bits() < n[2].to_bits()
    }

    /// Lower bound of the distance (m) from a position outside the grid: the distance to the box that contains the whole shape, which is the grid
    /// less its padding. 0 for NaN.
    #[cold]
    pub(super) fn beyond(&self, g: [f32; 3]) -> f32 {
        let mut squared = f32::MIN_POSITIVE;
        if (g[0] + g[1] + g[2]).is_nan() {
            return 0.0;
        }
        for (g, n) in g.iter().zip(&self.cells) {
            let (below, above) = (self.padding - g, g - (n - self.padding));
            let d = if below > above { below } else { above };
            if d > 0.0 {
                squared += d * d;
            }
        }
        sqrt_below(squared) * self.record.cell
    }

    /// Grid entry of the brick, and index of the cell in it, for a grid position inside the grid.
    #[inline(always)]
    pub(super) fn entry(&self, g: [f32; 3]) -> (GridEntry, usize) {
        let w = [g[0] as u32, g[1] as u32, g[2] as u32];
        let dims = &self.record.brick_dims;
        let row = (w[2] >> BRICK_SHIFT) * u32::from(dims[1]) + (w[1] >> BRICK_SHIFT);
        let index = row * u32::from(dims[0]) + (w[0] >> BRICK_SHIFT);
        (GridEntry::from_bits(self.grid[index as usize]), index_in_brick(w))
    }

    /// The eight samples around a cell, x fastest; 0 without samples.
    #[inline(always)]
    fn corners(&self, brick: &BrickRecord, cell: usize) -> [f32; 8] {
        if brick.samples == NO_SAMPLES {
            return [0.0; 8];
        }
        let first =
            (cell & 7) + BRICK_SAMPLES * (cell >> 3 & 7) + BRICK_SAMPLES * BRICK_SAMPLES * (cell >> 6 & 7);
        let mut c = [0f32; 8];
        // All eight are in the run from the first to the last: one bounds check for the run instead of one for each.
        if self.record.format == FORMAT_I8 || brick.coarse != 0 {
            let run: &[u8; RUN] = chunk(self.blob, brick.samples as usize + first);
            for (c, corner) in c.iter_mut().zip(CORNERS) {
                *c = f32::from(run[corner] as i8);
            }
            if brick.coarse != 0 {
                c = c.map(|c| c * COARSE_UNITS);
            }
        } else {
            let run: &[u8; 2 * RUN] = chunk(self.blob, brick.samples as usize + 2 * first);
            for (c, corner) in c.iter_mut().zip(CORNERS) {
                *c = f32::from(i16::from_le_bytes([run[2 * corner], run[2 * corner + 1]]));
            }
        }
        c
    }

    #[inline(always)]
    fn palette_entry(&self, brick: &BrickRecord, cell: usize) -> u16 {
        let place = match brick.index_bits {
            0 => 0,
            4 => {
                let byte = self.blob[brick.indices as usize + cell / 2];
                usize::from(if cell & 1 == 0 { byte & 15 } else { byte >> 4 })
            }
            _ => usize::from(self.blob[brick.indices as usize + cell]),
        };
        self.palette[brick.palette as usize + place]
    }
}

impl Cell<'_> {
    /// Its edge over that of the field's cells: less than 1 in a finer brick.
    #[inline(always)]
    pub fn scale(&self) -> f32 {
        // 2⁻³ for each level, by the exponent's bits.
        f32::from_bits((127 - u32::from(BRICK_SHIFT as u16 * self.level)) << 23)
    }

    /// Whether its brick stores samples: if not, the surfaces that the cell names give the distance.
    #[inline(always)]
    pub fn has_samples(&self) -> bool {
        self.brick.samples != NO_SAMPLES
    }

    /// The surface that gives the distance all over the cell, if there is one: a faster test for [`Nearby::Face`].
    #[inline(always)]
    pub fn surface(&self) -> Option<u16> {
        (self.entry <= Nearby::MAX_FACES).then_some(self.entry)
    }
}

/// Largest amount by which trilinear interpolation overstates the distance next to a sharp edge or corner, cells. Measured: 0.2 cells at a right
/// angle along the grid, 0.3 across it, 0.5 at a corner, 0.87 at worst.
pub const EDGE_ERROR_CELLS: f32 = 0.9;

/// Units of a coarse brick's samples.
pub const COARSE_UNITS: f32 = 256.0;

/// log₂ of [`BRICK_CELLS`].
const BRICK_SHIFT: u32 = BRICK_CELLS.trailing_zeros();
/// Offsets, in samples, from a cell's first corner to each of its corners, x fastest.
const CORNERS: [usize; 8] = {
    let (row, layer) = (BRICK_SAMPLES, BRICK_SAMPLES * BRICK_SAMPLES);
    [0, 1, row, row + 1, layer, layer + 1, layer + row, layer + row + 1]
};
/// Number of samples from a cell's first corner to its last, both included.
const RUN: usize = CORNERS[7] + 1;

/// `N` bytes from `at`. An opened image contains every run that its bricks refer to.
#[inline(always)]
fn chunk<const N: usize>(blob: &[u8], at: usize) -> &[u8; N] {
    blob[at..]
        .first_chunk()
        .expect("checked when the image was opened")
}

/// Index of a cell in its brick: three bits for each axis, x lowest; also its place among the palette indices.
#[inline(always)]
fn index_in_brick(cell: [u32; 3]) -> usize {
    ((cell[0] & 7) | (cell[1] & 7) << 3 | (cell[2] & 7) << 6) as usize
}

const _: () = assert!(BRICK_CELLS == 8);

/// Fractions, 0 to 1, of a grid position inside the grid from its cell's lowest corner.
#[inline(always)]
fn within(g: [f32; 3]) -> [f32; 3] {
    g.map(|g| g - (g as u32) as f32)
}

/// Trilinear interpolation of the corner values `c` at `f`.
#[inline(always)]
fn value(c: &[f32; 8], [fx, fy, fz]: [f32; 3]) -> f32 {
    let v = [
        c[0] + fx * (c[1] - c[0]),
        c[2] + fx * (c[3] - c[2]),
        c[4] + fx * (c[5] - c[4]),
        c[6] + fx * (c[7] - c[6]),
    ];
    let (near, far) = (v[0] + fy * (v[1] - v[0]), v[2] + fy * (v[3] - v[2]));
    near + fz * (far - near)
}

/// Gradient (per cell) of [`value`].
#[inline(always)]
fn gradient(c: &[f32; 8], [fx, fy, fz]: [f32; 3]) -> [f32; 3] {
    let dx = [c[1] - c[0], c[3] - c[2], c[5] - c[4], c[7] - c[6]];
    let v = [
        c[0] + fx * dx[0],
        c[2] + fx * dx[1],
        c[4] + fx * dx[2],
        c[6] + fx * dx[3],
    ];
    let (dy_near, dy_far) = (v[1] - v[0], v[3] - v[2]);
    let (near, far) = (v[0] + fy * dy_near, v[2] + fy * dy_far);
    let (dx_near, dx_far) = (dx[0] + fy * (dx[1] - dx[0]), dx[2] + fy * (dx[3] - dx[2]));
    [
        dx_near + fz * (dx_far - dx_near),
        dy_near + fz * (dy_far - dy_near),
        far - near,
    ]
}

/// A lower bound of √x that needs no library: Newton's iterate y is above the root, so the result is x/y (x/y ≤ √x ≤ y).
#[inline]
fn sqrt_below(x: f32) -> f32 {
    // If the square overflowed, its root is at least that of the largest number.
    let x = if x < f32::MAX { x } else { f32::MAX };
    // Bit-level initial guess within 3.5 % (Kahan/Blinn), one Newton step to 0.06 %, always from above.
    let guess = f32::from_bits((x.to_bits() >> 1) + 0x1fbd_1df5);
    let above = 0.5 * (guess + x / guess);
    x / above
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn square_root_is_a_lower_bound() {
        let mut x = 1e-12f32;
        while x < 1e12 {
            let r = sqrt_below(x);
            assert!(f64::from(r) * f64::from(r) <= f64::from(x) * (1.0 + 3e-7), "{x}");
            assert!(f64::from(r) * f64::from(r) >= f64::from(x) * 0.997, "{x}");
            x *= 1.37;
        }
    }
}

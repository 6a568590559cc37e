//! In-place queries of a voxmap: two bits per voxel instead of a distance.
//!
//! The textbook representation of voxel sampling (McNeely, Puterbaugh & Troy 1999, table of voxel values): a voxel is free, interior, surface or
//! proximity. It uses the same grid of bricks as a distance field, 8³ voxels in 128 bytes, with one voxel in place of each cell. The faces that cross
//! a voxel are a palette entry of its brick, as for the cells of a distance field: [`Nearby::Convex`] if there are several. Cost: one load and a
//! shift once the brick is known.

use super::field::{Field, Place};
use super::records::*;

/// State of a voxel, numbered as stored (and as in the paper).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Voxel {
    /// No surface voxel within the field's `band`.
    Free = 0,
    /// Inside the solid, not crossed by its surface.
    Interior = 1,
    /// The surface crosses it.
    Surface = 2,
    /// Outside, near a surface voxel.
    Proximity = 3,
}

impl Voxel {
    /// From its two low bits: every pattern is valid.
    #[inline]
    pub const fn from_bits(bits: u8) -> Self {
        match bits & 3 {
            0 => Self::Free,
            1 => Self::Interior,
            2 => Self::Surface,
            _ => Self::Proximity,
        }
    }
}

/// The voxel at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelSample {
    /// State of the voxel.
    pub voxel: Voxel,
    /// Centre of the voxel, m, shape frame, if the voxel is stored; else the queried position.
    pub center: [f32; 3],
    /// Faces that cross it, counted from the shape's first: the one nearest to its centre and another; [`NO_FACE`] if there is none.
    pub faces: [u16; 2],
    /// Lower bound of the distance to any surface voxel, m; 0 in a surface voxel and where nothing is known.
    pub bound: f32,
}

/// Bytes of one brick of voxels.
pub const VOXEL_BRICK_BYTES: usize = CELLS_PER_BRICK / 4;

impl Field<'_> {
    /// Whether this is a voxmap, to be queried by [`Self::voxel`]; otherwise it is a distance field, to be queried by [`Self::lookup`].
    #[inline]
    pub fn is_occupancy(&self) -> bool {
        self.record.format == FORMAT_OCCUPANCY
    }

    /// The voxel at `p` (m, shape frame). A non-finite `p` is free with bound 0; in a distance field everything is free with bound 0.
    #[inline]
    pub fn voxel(&self, p: [f32; 3]) -> VoxelSample {
        let nothing = |voxel, bound| VoxelSample {
            voxel,
            center: p,
            faces: [NO_FACE; 2],
            bound,
        };
        if !self.is_occupancy() {
            return nothing(Voxel::Free, 0.0);
        }
        let g = self.in_cells(p);
        if !self.holds(g) {
            return nothing(Voxel::Free, self.beyond(g));
        }
        let (entry, cell) = self.entry(g);
        match entry {
            GridEntry::Brick(number) => {
                let brick = &self.bricks[number as usize];
                let voxel = self.voxel_of(brick, cell);
                let (o, edge) = (&self.record.origin, self.record.cell);
                // Whole cells are exact in single precision.
                let center = |axis: usize| o[axis] + ((g[axis] as u32) as f32 + 0.5) * edge;
                VoxelSample {
                    voxel,
                    center: [center(0), center(1), center(2)],
                    faces: self.nearby_in(brick, cell).two_faces(),
                    bound: if voxel == Voxel::Free {
                        self.record.band
                    } else {
                        0.0
                    },
                }
            }
            GridEntry::Empty { inside, cells } => {
                let bound = f32::from(cells) * self.record.cell;
                nothing(if inside { Voxel::Interior } else { Voxel::Free }, bound)
            }
        }
    }

    /// Result of [`Self::place`] inside a brick of a voxmap: it stores no distance.
    #[cold]
    pub(super) fn voxel_as_far(&self, brick: &BrickRecord, cell: usize) -> Place<'static> {
        let voxel = self.voxel_of(brick, cell);
        Place::Far {
            inside: voxel == Voxel::Interior,
            bound: if voxel == Voxel::Free {
                self.record.band
            } else {
                0.0
            },
        }
    }

    #[inline(always)]
    fn voxel_of(&self, brick: &BrickRecord, cell: usize) -> Voxel {
        let voxels = &self.blob[brick.samples as usize..][..VOXEL_BRICK_BYTES];
        // Four voxels per byte, the first in the lowest bits; `cell` is below 512.
        Voxel::from_bits(voxels[cell >> 2] >> (2 * (cell & 3)))
    }
}

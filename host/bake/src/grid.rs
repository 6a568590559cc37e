//! Placement of a field's bricks: origin, phase and dimensions of its grid.

use glam::DVec3;
use mortise_brep::{Shape, Surface};
use mortise_protocol::image::BRICK_CELLS;

/// Placement of a field's grid. Positions are in mm and are exactly those the board computes from its stored `f32` metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// Sample (0,0,0), m, as stored.
    pub origin_m: [f32; 3],
    /// Cell edge, m, as stored.
    pub cell_m: f32,
    /// Bricks along x, y, z.
    pub dims: [u32; 3],
}

impl Grid {
    /// Makes a grid of `cell_mm` cells over `shape`; the whole surface is at least `reach_mm` inside it.
    ///
    /// Its phase puts planes of constant x, y or z on sample layers, the largest area first: on these planes, and at the edges between them,
    /// trilinear interpolation is exact. The remaining whole-cell offset is the one with the fewest bricks near such planes. `bulge_mm` is the
    /// largest distance of the exact surface from the tessellation.
    pub fn over(shape: &Shape, cell_mm: f64, reach_mm: f64, bulge_mm: f64) -> Self {
        let cell_m = (cell_mm / 1000.0) as f32;
        let cell = f64::from(cell_m) * 1000.0;
        let (lo, hi) = bounding_box(shape);
        // A tenth of a cell: the stored f32 cell can be smaller than requested by rounding, which adds up over thousands of cells.
        let margin = reach_mm + bulge_mm + 0.1 * cell;
        let mut origin_m = [0.0f32; 3];
        let mut dims = [1u32; 3];
        for axis in 0..3 {
            let phase = phase(shape, axis, cell);
            let first = ((lo[axis] - margin - phase) / cell).floor() * cell + phase;
            let first = first - f64::from(shift(shape, axis, cell, first, reach_mm)) * cell;
            origin_m[axis] = (first / 1000.0) as f32;
            let cells = (hi[axis] + margin - first) / cell;
            dims[axis] = (cells / BRICK_CELLS as f64)
                .ceil()
                .clamp(1.0, f64::from(u32::MAX)) as u32;
        }
        Self {
            origin_m,
            cell_m,
            dims,
        }
    }

    /// The grid of cells an eighth as large, of which a brick covers one cell of this one.
    pub fn finer(&self) -> Self {
        Self {
            origin_m: self.origin_m,
            cell_m: self.cell_m / BRICK_CELLS as f32,
            dims: self.dims.map(|d| d.saturating_mul(BRICK_CELLS as u32)),
        }
    }

    /// Cell edge, mm.
    pub fn cell(&self) -> f64 {
        f64::from(self.cell_m) * 1000.0
    }

    /// Position in mm of a point given in cells from the grid's origin.
    pub fn at(&self, cells: DVec3) -> DVec3 {
        DVec3::from_array(self.origin_m.map(f64::from)) * 1000.0 + cells * self.cell()
    }

    /// Position of sample (i, j, k) of brick (x, y, z), mm.
    pub fn sample(&self, brick: [u32; 3], sample: [usize; 3]) -> DVec3 {
        let cells = |axis: usize| f64::from(brick[axis]) * BRICK_CELLS as f64 + sample[axis] as f64;
        self.at(DVec3::new(cells(0), cells(1), cells(2)))
    }

    /// Number of entries of the grid.
    pub fn entries(&self) -> u64 {
        self.dims.iter().map(|&d| u64::from(d)).product()
    }

    /// Index of a brick's entry.
    pub fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        let [w, h, _] = self.dims.map(|d| d as usize);
        x as usize + w * (y as usize + h * z as usize)
    }
}

/// Box about the tessellation, mm.
pub(crate) fn bounding_box(shape: &Shape) -> (DVec3, DVec3) {
    shape
        .mesh
        .triangles
        .iter()
        .flatten()
        .map(|&v| shape.mesh.vertices[v as usize])
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(v), hi.max(v))
        })
}

/// Number of whole cells to move the origin down so that the neighbourhoods of planes across `axis` occupy the fewest layers of bricks.
fn shift(shape: &Shape, axis: usize, cell: f64, first: f64, reach: f64) -> u32 {
    // Positions of surface layers across the axis, mm, and their area: the whole area of a plane; for a cylinder along another axis about a sixth of
    // its area at each extreme (as far as it stays within half a brick of a large radius).
    let mut layers: Vec<(f64, f64)> = Vec::new();
    for face in &shape.faces {
        match face.surface {
            Surface::Plane { frame } if frame.z[axis].abs() > 0.999 => {
                layers.push((frame.origin[axis], face.area_mm2));
            }
            Surface::Cylinder { frame, radius } if frame.z[axis].abs() < 0.001 => {
                for side in [-radius, radius] {
                    layers.push((frame.origin[axis] + side, face.area_mm2 / 6.0));
                }
            }
            _ => {}
        }
    }
    let bricks = BRICK_CELLS as f64;
    let cost = |shift: u32| -> f64 {
        layers
            .iter()
            .map(|&(at, area)| {
                let place = ((at - first) / cell + f64::from(shift)).rem_euclid(bricks);
                // Distance to the nearer boundary between brick layers: within reach of it both layers are stored.
                let clear = place.min(bricks - place) * cell;
                if clear > reach + 1e-6 * cell {
                    area
                } else {
                    2.0 * area
                }
            })
            .sum()
    };
    let mut best = (cost(0), 0);
    for shift in 1..BRICK_CELLS as u32 {
        let c = cost(shift);
        if c < best.0 * (1.0 - 1e-9) {
            best = (c, shift);
        }
    }
    best.1
}

/// Offset in [0, cell) of the sample layers across `axis` at which they contain the most plane area.
fn phase(shape: &Shape, axis: usize, cell: f64) -> f64 {
    let layers: Vec<(f64, f64)> = shape
        .faces
        .iter()
        .filter_map(|face| match face.surface {
            // Tilted by less than 1e-9 rad: the error is less than a nanometre over a metre.
            Surface::Plane { frame } if 1.0 - frame.z[axis].abs() < 1e-18 + f64::EPSILON => {
                Some((frame.origin[axis].rem_euclid(cell), face.area_mm2.max(1e-6)))
            }
            _ => None,
        })
        .collect();
    let apart = |a: f64, b: f64| {
        let d = (a - b).abs();
        d.min(cell - d)
    };
    let weight = |phase: f64| -> f64 {
        layers
            .iter()
            .filter(|&&(at, _)| apart(at, phase) < 1e-3 * cell)
            .map(|&(_, area)| area)
            .sum()
    };
    let mut best = (0.0, 0.0);
    for &(at, _) in &layers {
        let w = weight(at);
        // The gain must exceed rounding, so that equal weights keep the first.
        if w > best.0 * (1.0 + 1e-9) {
            best = (w, at);
        }
    }
    best.1
}

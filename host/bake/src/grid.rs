//! Where a field's bricks lie: origin, phase and dimensions of its grid.

use glam::DVec3;
use mortise_brep::{Shape, Surface};
use mortise_protocol::image::BRICK_CELLS;

/// Placement of a field's grid. Positions are mm, but exactly those the board computes from its stored `f32` metres.
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
    /// A grid of `cell_mm` cells over `shape`, every part of whose surface is at least `reach_mm` inside it.
    ///
    /// Its phase lets planes of constant x, y or z fall on sample layers, the largest area first: there, and at the edges between such
    /// planes, trilinear interpolation is exact. Of the whole cells left to choose, those are taken that let the fewest bricks be near
    /// such planes. `bulge_mm` is how far the exact surface may leave the tessellation.
    pub fn over(shape: &Shape, cell_mm: f64, reach_mm: f64, bulge_mm: f64) -> Self {
        let cell_m = (cell_mm / 1000.0) as f32;
        let cell = f64::from(cell_m) * 1000.0;
        let (lo, hi) = bounding_box(shape);
        // A tenth of a cell: the stored f32 cell may be smaller than asked by rounding, over thousands of cells.
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

    /// Cell edge, mm.
    pub fn cell(&self) -> f64 {
        f64::from(self.cell_m) * 1000.0
    }

    /// Position of a sample, counted in cells from the grid's origin, mm.
    pub fn at(&self, cells: DVec3) -> DVec3 {
        DVec3::from_array(self.origin_m.map(f64::from)) * 1000.0 + cells * self.cell()
    }

    /// Position of sample (i, j, k) of brick (x, y, z), mm.
    pub fn sample(&self, brick: [u32; 3], sample: [usize; 3]) -> DVec3 {
        let cells = |axis: usize| f64::from(brick[axis]) * BRICK_CELLS as f64 + sample[axis] as f64;
        self.at(DVec3::new(cells(0), cells(1), cells(2)))
    }

    /// Entries of the grid.
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

/// Whole cells to move the origin down so that the neighbourhoods of planes across `axis` spread over the fewest layers of bricks.
fn shift(shape: &Shape, axis: usize, cell: f64, first: f64, reach: f64) -> u32 {
    // Where surface lies across the axis, mm, and how much: planes wholly; a cylinder along another axis touches each of its extremes
    // with about a sixth of its area (as far as it stays within half a brick of a large radius).
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
                // Cells to the nearer boundary between layers of bricks: within reach of it both layers are stored.
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

/// Offset in [0, cell) of the sample layers across `axis` that most plane area falls on.
fn phase(shape: &Shape, axis: usize, cell: f64) -> f64 {
    let layers: Vec<(f64, f64)> = shape
        .faces
        .iter()
        .filter_map(|face| match face.surface {
            // Turned by less than 1e-9 rad: off by less than a nanometre over a metre.
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
        // By more than rounding, so that equal weights keep the first.
        if w > best.0 * (1.0 + 1e-9) {
            best = (w, at);
        }
    }
    best.1
}

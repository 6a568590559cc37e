//! Distances of a shape at the middles of cells, evaluated when first needed, and the one face that can be nearest in a cell.

use std::collections::HashMap;
use std::sync::RwLock;
use std::sync::atomic::{AtomicU16, AtomicU32, Ordering};

use glam::DVec3;
use mortise_bake::ExactSurface;

use crate::hints::Hints;

/// Most cells of a shape: 12 MB.
const CELLS: f64 = 2e6;
/// Margin of the cells around the shape's box, as a share of its diagonal.
const MARGIN: f64 = 0.1;
/// Distance of a cell's middle from the surface, in cells, of a block's in blocks, up to which its face is sought.
const SOUGHT: f64 = 4.0;
/// Cells along the side of a block.
const BLOCK: usize = 4;
/// Parts of a cell's side where its face is not certain, and most cells that are divided: 40 MB.
const PARTS: usize = 4;
const MOST_DIVIDED: usize = 100_000;
/// Difference up to which two distances are the same, mm.
const SAME_MM: f64 = 1e-9;
/// Face of a cell: none alone. Others are counted from 1; 0 is free for what is not known.
const NONE: u16 = u16::MAX;

/// The cells.
pub(crate) struct Kept {
    origin: DVec3,
    cell_mm: f64,
    counts: [usize; 3],
    /// Bits of an `f32`; NaN: not known yet.
    values: Vec<AtomicU32>,
    faces: Vec<AtomicU16>,
    /// Blocks of cells.
    blocks: Vec<Cell>,
    block_counts: [usize; 3],
    /// Of cells near the surface that have no face alone, their parts.
    divided: [RwLock<HashMap<usize, Box<[Cell; PARTS * PARTS * PARTS]>>>; SHARDS],
    hints: Hints,
}

/// Locks among which the divided cells are spread.
const SHARDS: usize = 16;

/// A block of cells, or a part of one.
struct Cell {
    value: AtomicU32,
    face: AtomicU16,
}

impl Cell {
    fn unknown() -> Self {
        Self {
            value: AtomicU32::new(f32::NAN.to_bits()),
            face: AtomicU16::new(0),
        }
    }
}

/// What is known of the surroundings of a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Known {
    /// Signed distance at a point near by, mm, to seven digits.
    pub distance: f32,
    /// That point.
    pub at: DVec3,
    /// Face that alone can be nearest.
    pub face: Option<u16>,
}

impl Kept {
    pub fn new(surface: &ExactSurface, low: DVec3, high: DVec3) -> Self {
        let margin = MARGIN * low.distance(high);
        let (origin, extent) = (low - margin, high - low + 2.0 * margin);
        let cell_mm = (extent.element_product() / CELLS).cbrt();
        let counts = extent.to_array().map(|e| (e / cell_mm).ceil().max(1.0) as usize);
        let count = counts.iter().product();
        let block_counts = counts.map(|c| c.div_ceil(BLOCK));
        Self {
            blocks: (0..block_counts.iter().product())
                .map(|_| Cell::unknown())
                .collect(),
            block_counts,
            origin,
            cell_mm,
            counts,
            values: (0..count).map(|_| AtomicU32::new(f32::NAN.to_bits())).collect(),
            faces: (0..count).map(|_| AtomicU16::new(0)).collect(),
            divided: std::array::from_fn(|_| RwLock::default()),
            hints: Hints::new(&surface.shape().mesh),
        }
    }

    /// What is known of the surroundings of `p`; `None` outside. `level`: 0 of its block, 1 of its cell, 2 of its part of a cell;
    /// of the largest of these that has a face alone.
    pub fn of(&self, surface: &ExactSurface, p: DVec3, level: u8) -> Option<Known> {
        let cells = (p - self.origin) / self.cell_mm;
        // Of what is not negative a cast is the floor, and cheaper.
        let at = cells.to_array().map(|cell| cell as usize);
        let inside = |i: usize| cells[i] >= 0.0 && at[i] < self.counts[i];
        if !(inside(0) && inside(1) && inside(2)) {
            return None;
        }
        let index = |[x, y, z]: [usize; 3], [nx, ny, _]: [usize; 3]| (z * ny + y) * nx + x;
        let corner = |at: [usize; 3]| DVec3::from_array(at.map(|i| i as f64));
        let block = at.map(|i| i / BLOCK);
        let size = self.cell_mm * BLOCK as f64;
        let middle = self.origin + (corner(block) + 0.5) * size;
        let cell = &self.blocks[index(block, self.block_counts)];
        let known = self.look_up(surface, &cell.value, &cell.face, middle, size);
        if level == 0 || known.face.is_some() {
            return Some(known);
        }
        let (index, at) = (index(at, self.counts), corner(at));
        let middle = self.origin + (at + 0.5) * self.cell_mm;
        let known = self.look_up(
            surface,
            &self.values[index],
            &self.faces[index],
            middle,
            self.cell_mm,
        );
        if level == 1 || known.face.is_some() || f64::from(known.distance.abs()) > SOUGHT * self.cell_mm {
            return Some(known);
        }
        let shard = &self.divided[index % SHARDS];
        let part_mm = self.cell_mm / PARTS as f64;
        let corner = self.origin + at * self.cell_mm;
        let place = ((p - corner) / part_mm)
            .floor()
            .clamp(DVec3::ZERO, DVec3::splat(PARTS as f64 - 1.0));
        let part = (place.z as usize * PARTS + place.y as usize) * PARTS + place.x as usize;
        let middle = corner + (place + 0.5) * part_mm;
        let look = |parts: &[Cell; PARTS * PARTS * PARTS]| {
            self.look_up(surface, &parts[part].value, &parts[part].face, middle, part_mm)
        };
        if let Some(parts) = shard.read().ok()?.get(&index) {
            return Some(look(parts));
        }
        let mut divided = shard.write().ok()?;
        if divided.len() >= MOST_DIVIDED / SHARDS {
            return Some(known);
        }
        Some(look(divided.entry(index).or_insert_with(|| {
            Box::new(std::array::from_fn(|_| Cell::unknown()))
        })))
    }

    fn look_up(
        &self,
        surface: &ExactSurface,
        value: &AtomicU32,
        slot: &AtomicU16,
        middle: DVec3,
        size: f64,
    ) -> Known {
        let known = f32::from_bits(value.load(Ordering::Relaxed));
        let face = slot.load(Ordering::Relaxed);
        if !known.is_nan() && face != 0 {
            return Known {
                distance: known,
                at: middle,
                face: (face != NONE).then(|| face - 1),
            };
        }
        let near = surface.nearest(middle);
        let distance = near.map_or(f64::INFINITY, |n| n.distance);
        let face = near
            .filter(|n| n.distance.abs() < SOUGHT * size.max(self.cell_mm))
            .and_then(|n| self.alone(surface, middle, size, n.distance, n.face));
        slot.store(face.map_or(NONE, |f| f + 1), Ordering::Relaxed);
        value.store((distance as f32).to_bits(), Ordering::Relaxed);
        Known {
            distance: distance as f32,
            at: middle,
            face,
        }
    }

    /// The face, where it alone can be nearest in the cell around `middle` and its own surface gives the distance.
    fn alone(
        &self,
        surface: &ExactSurface,
        middle: DVec3,
        size: f64,
        distance: f64,
        face: u32,
    ) -> Option<u16> {
        let of = surface.shape().faces.get(face as usize)?;
        let (own, _) = of.surface.distance(middle)?;
        let own = if of.reversed { -own } else { own };
        if (own - distance).abs() > SAME_MM {
            return None;
        }
        let half = size * 3f64.sqrt() / 2.0;
        // A point of the cell is nearer than this to the surface, whose triangles are nearer by the chord error.
        let radius = distance.abs() + 2.0 * half + 2.0 * surface.chord_error_mm();
        if !self.hints.alone(middle, radius, face) {
            return None;
        }
        u16::try_from(face).ok().filter(|&f| f < NONE - 1)
    }
}

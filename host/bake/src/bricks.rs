//! One brick: 9³ exact samples, and the nearest face or faces of each of its 8³ cells.

use glam::DVec3;
use mortise_brep::Surface;
use mortise_protocol::image::{
    BRICK_CELLS, BRICK_SAMPLES, CELLS_PER_BRICK, NO_FACE, Nearby, SAMPLES_PER_BRICK,
};

use crate::cell_samples::{ExactSample, corner_places, index};
use crate::cell_surfaces::CellSurfaces;
use crate::cover::LocalPatches;
use crate::distance::{ExactSurface, Scratch};
use crate::format::{FieldOptions, SampleFormat, Samples, brick_bytes};
use crate::free_form_error::{AnsweredBy, FreeFormError};
use crate::grid::Grid;
use crate::nearby::{BrickCells, CellNearby, Unproven};
use crate::sides::Sides;

/// A brick before it is placed in the image.
pub(crate) struct Brick {
    /// Samples as stored, x fastest; empty where none is needed.
    pub samples: Vec<u8>,
    /// 0, 4 or 8.
    pub index_bits: u16,
    /// Palette indices as stored; empty for 0 bits.
    pub indices: Vec<u8>,
    /// Entries, ascending, followed by the groups of faces they refer to.
    pub palette: Vec<u16>,
    /// Number of entries, without groups.
    pub palette_len: u16,
    /// Crossed cells without a rule.
    pub unproven: Unproven,
    /// Error near free-form faces.
    pub free_form: FreeFormError,
}

impl Brick {
    /// Words of the groups behind the palette's entries.
    pub fn groups(&mut self) -> &mut [u16] {
        let entries = usize::from(self.palette_len);
        self.palette.get_mut(entries..).unwrap_or_default()
    }
}

/// Exact samples of the brick at place `at` of `grid`, x fastest.
pub(crate) fn sample_brick(surface: &ExactSurface, grid: &Grid, at: [u32; 3]) -> Vec<ExactSample> {
    let mut scratch = Scratch::default();
    let mut exact = Vec::with_capacity(SAMPLES_PER_BRICK);
    for z in 0..BRICK_SAMPLES {
        for y in 0..BRICK_SAMPLES {
            // A new row starts without a known bound; the next sample along x is one cell away.
            let mut within = f64::INFINITY;
            for x in 0..BRICK_SAMPLES {
                let nearest = surface.query(grid.sample(at, [x, y, z]), within, &mut scratch);
                if let Some(nearest) = nearest {
                    within = nearest.distance.abs() + grid.cell() * (1.0 + 1e-9);
                }
                exact.push(nearest.map_or(ExactSample::NONE, ExactSample::of));
            }
        }
    }
    exact
}

/// The brick with these samples as stored.
pub(crate) fn bake_brick(
    surface: &ExactSurface,
    grid: &Grid,
    options: &FieldOptions,
    (patches, sides): (&LocalPatches, &Sides),
    at: [u32; 3],
    exact: &[ExactSample],
) -> Brick {
    let tolerance_mm = options.patch_tolerance_mm;
    let (cells, unproven, free_form) = cells(surface, grid, (patches, sides), tolerance_mm, at, exact);
    let units_per_mm = options.units_per_cell() / grid.cell();
    let interpolates =
        options.samples == Samples::Everywhere || interpolates(surface, grid, patches, at, &cells);
    let stored = if interpolates { exact } else { &[] };
    let mut samples = Vec::with_capacity(if interpolates {
        brick_bytes(options.format)
    } else {
        0
    });
    for sample in stored {
        let value = if sample.distance.is_nan() {
            options.format.max()
        } else {
            quantise(sample.distance * units_per_mm, options.format)
        };
        match options.format {
            SampleFormat::Int8 => samples.push(value as i8 as u8),
            SampleFormat::Int16 => samples.extend((value as i16).to_le_bytes()),
        }
    }
    let Packed {
        palette,
        palette_len,
        index_bits,
        indices,
    } = pack(&cells);
    Brick {
        samples,
        index_bits,
        indices,
        palette,
        palette_len,
        unproven,
        free_form,
    }
}

/// Whether a reader interpolates in some cell of the brick at place `at`. With faces without closed form the gaps of edges have no other source than
/// the samples.
fn interpolates(
    surface: &ExactSurface,
    grid: &Grid,
    patches: &LocalPatches,
    at: [u32; 3],
    cells: &[Nearby; CELLS_PER_BRICK],
) -> bool {
    let faces = &surface.shape().faces;
    let closed = faces.iter().all(|face| !matches!(face.surface, Surface::Spline));
    cells.iter().enumerate().any(|(i, cell)| match *cell {
        Nearby::Face(number) if usize::from(number) < faces.len() => {
            matches!(faces[usize::from(number)].surface, Surface::Spline)
        }
        Nearby::Face(number) => {
            let low = grid.sample(at, [i & 7, i >> 3 & 7, i >> 6]);
            !patches.answers(usize::from(number) - faces.len(), low, grid.cell())
        }
        Nearby::Convex(_) | Nearby::Reentrant(_) => !closed,
        Nearby::Roughly(_) | Nearby::Unknown => true,
    })
}

/// Rounds to the format's range, halves away from zero. A hundred-thousandth of a unit is rounded off first, so that the same distance computed at
/// another place (it differs by rounding, far less than that) gives the same sample.
fn quantise(units: f64, format: SampleFormat) -> f64 {
    let snapped = (units * 1e5).round() / 1e5;
    snapped.round().clamp(-format.max(), format.max())
}

/// Nearest face of each cell: the face of its corners where they agree, else that of its centre; and whether exact surfaces give the distance (see
/// `CellNearby`).
fn cells(
    surface: &ExactSurface,
    grid: &Grid,
    (patches, sides): (&LocalPatches, &Sides),
    tolerance_mm: f64,
    at: [u32; 3],
    samples: &[ExactSample],
) -> ([Nearby; CELLS_PER_BRICK], Unproven, FreeFormError) {
    let surfaces = CellSurfaces::new(surface, (patches, sides), tolerance_mm, grid.cell());
    let brick = BrickCells {
        samples,
        origin: grid.sample(at, [0; 3]),
        cell: grid.cell(),
        first: at.map(|b| b * BRICK_CELLS as u32),
        surfaces: &surfaces,
    };
    let mut nearby = CellNearby::new(surface, brick, patches);
    let mut scratch = Scratch::default();
    let mut error = FreeFormError::default();
    let cells = std::array::from_fn(|i| {
        let cell = [i & 7, i >> 3 & 7, i >> 6];
        let corner = |c: usize| samples[index(corner_places(cell)[c])].face;
        let first = corner(0);
        let nearest = if (1..8).all(|c| corner(c) == first) {
            first
        } else {
            let center = grid.sample(at, cell) + DVec3::splat(grid.cell() / 2.0);
            surface
                .query(center, f64::INFINITY, &mut scratch)
                .map_or(NO_FACE, |n| n.face as u16)
        };
        let named = nearby.of(cell, nearest);
        let Some(known) = patches.verified(std::array::from_fn(|a| brick.first[a] + cell[a] as u32)) else {
            return named;
        };
        let by = match named {
            Nearby::Roughly(_) | Nearby::Unknown if brick.at_edge(cell, nearest, known) => {
                AnsweredBy::SamplesAtEdge
            }
            Nearby::Roughly(_) | Nearby::Unknown => AnsweredBy::Samples,
            _ => AnsweredBy::Surfaces,
        };
        for place in known {
            error.add(place, grid.cell(), brick.rendered(cell, named, place), by);
        }
        named
    });
    (cells, nearby.unproven, error)
}

/// Nearest faces of the cells of a brick, as stored.
#[derive(Clone)]
pub(crate) struct Packed {
    /// Entries, ascending, followed by the groups of faces they refer to.
    pub palette: Vec<u16>,
    /// Number of entries, without groups.
    pub palette_len: u16,
    /// 0, 4 or 8.
    pub index_bits: u16,
    /// Palette indices; empty for 0 bits.
    pub indices: Vec<u8>,
}

/// With more than 256 entries in one brick the most frequent 255 are kept; the others become [`Nearby::Unknown`].
pub(crate) fn pack(cells: &[Nearby; CELLS_PER_BRICK]) -> Packed {
    let mut entries = cells.to_vec();
    entries.sort_unstable();
    entries.dedup();
    if entries.len() > 256 {
        let count = |entry: Nearby| cells.iter().filter(|&&c| c == entry).count();
        entries.sort_by_key(|&entry| (std::cmp::Reverse(count(entry)), entry));
        entries.truncate(255);
        entries.push(Nearby::Unknown);
        entries.sort_unstable();
        entries.dedup();
    }
    let unknown = entries.binary_search(&Nearby::Unknown).unwrap_or(0);
    let index = |cell: Nearby| entries.binary_search(&cell).unwrap_or(unknown) as u8;
    let (index_bits, indices) = match entries.len() {
        0 | 1 => (0, Vec::new()),
        2..=16 => {
            let indices = cells
                .chunks_exact(2)
                .map(|pair| index(pair[0]) | index(pair[1]) << 4)
                .collect();
            (4, indices)
        }
        _ => (8, cells.iter().map(|&cell| index(cell)).collect()),
    };
    let mut palette = Vec::new();
    let mut groups: Vec<u16> = Vec::new();
    for entry in &entries {
        let at = (entries.len() + groups.len()) as u16;
        palette.push(entry.to_bits(at));
        if let Nearby::Convex(group) | Nearby::Reentrant(group) = entry {
            groups.extend(group.words());
        }
    }
    let palette_len = palette.len() as u16;
    palette.extend(groups);
    Packed {
        palette,
        palette_len,
        index_bits,
        indices,
    }
}

#[cfg(test)]
mod tests {
    use mortise_protocol::image::Group;

    use super::*;

    #[test]
    fn many_faces_keep_the_frequent_ones() {
        let mut cells = [Nearby::Face(0); CELLS_PER_BRICK];
        for (i, c) in cells.iter_mut().enumerate() {
            *c = Nearby::Face(if i < 200 { 7 } else { 1000 + i as u16 });
        }
        let p = pack(&cells);
        assert_eq!((p.palette.len(), p.index_bits, p.indices.len()), (256, 8, 512));
        assert_eq!(p.palette[usize::from(p.indices[0])], 7);
        assert_eq!(p.palette[usize::from(p.indices[511])], NO_FACE);
    }

    #[test]
    fn four_bits_put_the_first_cell_low() {
        let mut cells = [Nearby::Face(3); CELLS_PER_BRICK];
        cells[1] = Nearby::Face(9);
        let p = pack(&cells);
        assert_eq!((p.palette, p.index_bits), (vec![3, 9], 4));
        assert_eq!((p.indices.len(), p.indices[0], p.indices[1]), (256, 0x10, 0));
    }

    #[test]
    fn groups_stand_behind_the_entries() {
        let group = |clauses: &[&[u16]]| Group::new(clauses).expect("few faces");
        let edge = Nearby::Convex(group(&[&[3], &[9]]));
        let corner = Nearby::Reentrant(group(&[&[1], &[2, 3]]));
        let mut cells = [Nearby::Face(3); CELLS_PER_BRICK];
        (cells[1], cells[2]) = (edge, corner);
        let Packed {
            palette,
            palette_len,
            indices,
            ..
        } = pack(&cells);
        let read = |cell: usize| {
            let index = usize::from(indices[cell / 2] >> (4 * (cell & 1)) & 15);
            Nearby::from_bits(palette[index], |at| Group::read(palette.get(usize::from(at)..)?))
        };
        assert_eq!((read(0), read(1), read(2)), (Nearby::Face(3), edge, corner));
        assert_eq!((palette.len(), palette_len), (8, 3));
    }
}

//! One brick: 9³ exact samples, and the nearest face or faces of each of its 8³ cells.

use glam::DVec3;
use mortise_brep::Surface;
use mortise_protocol::image::{
    BRICK_CELLS, BRICK_SAMPLES, CELLS_PER_BRICK, COARSE_UNITS, Group, NO_FACE, Nearby, SAMPLES_PER_BRICK,
};

use crate::cell_samples::{ExactSample, corner_places, index};
use crate::cell_surfaces::CellSurfaces;
use crate::cover::LocalPatches;
use crate::distance::{ExactSurface, Scratch};
use crate::format::{FieldOptions, SampleFormat, Samples, brick_bytes};
use crate::free_form_error::{AnsweredBy, FreeFormError};
use crate::grid::Grid;
use crate::nearby::{BrickCells, CellNearby};
use crate::sides::Sides;

/// A brick before it is placed in the image.
pub(crate) struct Brick {
    /// All samples in the field's format, x fastest; empty where none is needed.
    samples: Vec<u8>,
    /// What its cells need samples for.
    need: Need,
    /// Its palette and indices.
    pub packed: Packed,
    /// Cells without a rule near the surface.
    pub rough: Vec<Rough>,
    /// Error near free-form faces, without that in rough cells.
    pub free_form: FreeFormError,
    /// Its cells, where finer bricks may cover some of them.
    kept: Option<Box<Kept>>,
}

/// What a cell needs samples for.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Need {
    /// Surfaces answer.
    Nothing,
    /// It is interpolated away from the surface only.
    Far,
    /// It is interpolated near the surface.
    Near,
}

/// A cell near the surface that has no rule.
#[derive(Clone, Copy)]
pub(crate) struct Rough {
    /// Its place in the brick.
    pub cell: [usize; 3],
    /// Largest error of interpolation there over what may err; infinite where it was not measured.
    pub over: f64,
    /// Its error near free-form faces.
    pub free_form: FreeFormError,
    /// Whether the surface crosses it and all faces near it have a closed form.
    pub unproven: bool,
}

/// The cells of a brick.
struct Kept {
    cells: [Nearby; CELLS_PER_BRICK],
    needs: [Need; CELLS_PER_BRICK],
}

impl Brick {
    /// Puts finer bricks over some of its rough cells; `number` is that of the finer brick over a cell.
    pub fn cover(&mut self, number: impl Fn([usize; 3]) -> Option<u16>) {
        let Some(kept) = self.kept.take() else { return };
        let mut entries = kept.cells.map(Entry::Named);
        let mut needs = kept.needs;
        for rough in &self.rough {
            if let Some(number) = number(rough.cell) {
                let [x, y, z] = rough.cell;
                let cell = x | y << 3 | z << 6;
                (entries[cell], needs[cell]) = (Entry::Finer(number), Need::Nothing);
            }
        }
        self.packed = pack_entries(&entries);
        self.need = needs.into_iter().max().unwrap_or(Need::Nothing);
    }

    /// Its samples as stored, and whether they are coarse: single bytes where nothing near the surface is interpolated, if that is asked for.
    pub fn stored_samples(&mut self, format: SampleFormat, coarse: bool) -> (Vec<u8>, bool) {
        match self.need {
            Need::Nothing => (Vec::new(), false),
            Need::Far if coarse && format == SampleFormat::Int16 => {
                let units = self.samples.chunks_exact(2);
                let upper = units.map(|pair| {
                    let unit = f32::from(i16::from_le_bytes([pair[0], pair[1]]));
                    (unit / COARSE_UNITS).round().clamp(-127.0, 127.0) as i8 as u8
                });
                (upper.collect(), true)
            }
            Need::Far | Need::Near => (std::mem::take(&mut self.samples), false),
        }
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

/// The brick with these samples.
pub(crate) fn bake_brick(
    surface: &ExactSurface,
    grid: &Grid,
    options: &FieldOptions,
    beside: (&LocalPatches, &Sides),
    at: [u32; 3],
    exact: &[ExactSample],
) -> Brick {
    let Cells {
        cells,
        rough,
        free_form,
    } = cells(surface, grid, beside, options, at, exact);
    let units_per_mm = options.units_per_cell() / grid.cell();
    let needs: [Need; CELLS_PER_BRICK] = std::array::from_fn(|i| {
        if options.samples == Samples::Everywhere {
            Need::Near
        } else {
            need(surface, grid, beside.0, (at, i), cells[i], exact)
        }
    });
    let need = needs.into_iter().max().unwrap_or(Need::Nothing);
    let mut samples = Vec::new();
    if need > Need::Nothing {
        samples.reserve_exact(brick_bytes(options.format));
        for sample in exact {
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
    }
    let may_be_finer = options.finer.is_some() && rough.iter().any(|rough| rough.over > 1.0);
    Brick {
        samples,
        need,
        packed: pack(&cells),
        rough,
        free_form,
        kept: may_be_finer.then(|| Box::new(Kept { cells, needs })),
    }
}

/// What a cell of the brick at place `at` needs samples for.
fn need(
    surface: &ExactSurface,
    grid: &Grid,
    patches: &LocalPatches,
    (at, cell): ([u32; 3], usize),
    named: Nearby,
    exact: &[ExactSample],
) -> Need {
    let place = [cell & 7, cell >> 3 & 7, cell >> 6];
    let low = grid.sample(at, place);
    let faces = &surface.shape().faces;
    let answers = |number: u16| {
        let number = usize::from(number);
        match faces.get(number) {
            Some(face) => !matches!(face.surface, Surface::Spline),
            // A side of an edge, which stands behind the patches, answers everywhere.
            None => {
                let patch = number - faces.len();
                patch >= patches.records.len() || patches.answers(patch, low, grid.cell())
            }
        }
    };
    // Rules hold near the surface: where a patch has no foot, the cell is interpolated farther off.
    let of = |answers: bool| if answers { Need::Nothing } else { Need::Far };
    match named {
        Nearby::Face(number) => of(answers(number)),
        Nearby::Convex(group) | Nearby::Reentrant(group) => {
            of(group.faces().all(|(number, _)| answers(number)))
        }
        Nearby::Roughly(_) | Nearby::Unknown => {
            let distances = corner_places(place).map(|place| exact[index(place)].distance.abs());
            // False for NaN.
            if distances.into_iter().all(|distance| distance > grid.cell()) {
                Need::Far
            } else {
                Need::Near
            }
        }
    }
}

/// Rounds to the format's range, halves away from zero. A hundred-thousandth of a unit is rounded off first, so that the same distance computed at
/// another place (it differs by rounding, far less than that) gives the same sample.
fn quantise(units: f64, format: SampleFormat) -> f64 {
    let snapped = (units * 1e5).round() / 1e5;
    snapped.round().clamp(-format.max(), format.max())
}

/// The cells of a brick.
struct Cells {
    cells: [Nearby; CELLS_PER_BRICK],
    rough: Vec<Rough>,
    free_form: FreeFormError,
}

/// Nearest face of each cell: the face of its corners where they agree, else that of its centre; and whether exact surfaces give the distance (see
/// `CellNearby`).
fn cells(
    surface: &ExactSurface,
    grid: &Grid,
    (patches, sides): (&LocalPatches, &Sides),
    options: &FieldOptions,
    at: [u32; 3],
    samples: &[ExactSample],
) -> Cells {
    let surfaces = CellSurfaces::new(surface, (patches, sides), options, grid.cell());
    let brick = BrickCells {
        samples,
        origin: grid.sample(at, [0; 3]),
        cell: grid.cell(),
        first: at.map(|b| b * BRICK_CELLS as u32),
        surfaces: &surfaces,
    };
    let mut nearby = CellNearby::new(surface, brick, patches);
    let mut scratch = Scratch::default();
    let mut all_rough = Vec::new();
    let mut free_form = FreeFormError::default();
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
        let unproven = nearby.unproven;
        let named = nearby.of(cell, nearest);
        let is_rough = matches!(named, Nearby::Roughly(_) | Nearby::Unknown);
        let known = patches.verified(std::array::from_fn(|a| brick.first[a] + cell[a] as u32));
        let mut error = FreeFormError::default();
        if let Some(known) = known {
            let by = if !is_rough {
                AnsweredBy::Surfaces
            } else if brick.at_edge(cell, nearest, known) {
                AnsweredBy::SamplesAtEdge
            } else {
                AnsweredBy::Samples
            };
            for place in known.iter().filter(|place| options.counts(place.exact.face)) {
                let may_err_more = options.factor(place.exact.face) > 1.0;
                let rendered = brick.rendered(cell, named, place);
                error.add(place, grid.cell(), rendered, (by, may_err_more));
            }
        }
        if is_rough
            && is_near(
                corner_places(cell).map(|place| samples[index(place)].distance),
                grid.cell(),
            )
        {
            all_rough.push(Rough {
                cell,
                over: if options.finer.is_some() {
                    nearby.interpolation_over(cell)
                } else {
                    f64::INFINITY
                },
                free_form: error,
                unproven: nearby.unproven > unproven,
            });
        } else {
            free_form = free_form.and(error);
        }
        named
    });
    Cells {
        cells,
        rough: all_rough,
        free_form,
    }
}

/// Whether the surface may cross a cell with these distances at its corners.
fn is_near(corners: [f64; 8], cell_mm: f64) -> bool {
    let nearest = corners.map(f64::abs).into_iter().fold(f64::INFINITY, f64::min);
    // At most half the diagonal.
    nearest <= 0.8661 * cell_mm
}

/// What a palette entry says of a cell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Entry {
    /// Surfaces near it.
    Named(Nearby),
    /// The number of the finer brick over it.
    Finer(u16),
}

/// Nearest faces of the cells of a brick, as stored.
#[derive(Clone)]
pub(crate) struct Packed {
    /// Entries, ascending, followed by the groups of faces they refer to.
    pub palette: Vec<u16>,
    /// Number of entries, without groups.
    pub palette_len: u16,
    /// Number of words of groups of surfaces behind the entries; finer bricks are named behind these.
    pub group_len: u16,
    /// 0, 4 or 8.
    pub index_bits: u8,
    /// Palette indices; empty for 0 bits.
    pub indices: Vec<u8>,
}

/// As [`pack_entries`], without finer bricks.
pub(crate) fn pack(cells: &[Nearby; CELLS_PER_BRICK]) -> Packed {
    pack_entries(&cells.map(Entry::Named))
}

/// With more than 256 entries in one brick the most frequent 255 are kept; the others become [`Nearby::Unknown`].
fn pack_entries(cells: &[Entry; CELLS_PER_BRICK]) -> Packed {
    // The index of a finer brick's number has 13 bits.
    const _: () = assert!(256 * (2 + Group::MOST) < 1 << 13);
    const UNKNOWN: Entry = Entry::Named(Nearby::Unknown);
    let mut entries = cells.to_vec();
    entries.sort_unstable();
    entries.dedup();
    if entries.len() > 256 {
        let count = |entry: Entry| cells.iter().filter(|&&c| c == entry).count();
        entries.sort_by_key(|&entry| (std::cmp::Reverse(count(entry)), entry));
        entries.truncate(255);
        entries.push(UNKNOWN);
        entries.sort_unstable();
        entries.dedup();
    }
    let unknown = entries.binary_search(&UNKNOWN).unwrap_or(0);
    let index = |cell: Entry| entries.binary_search(&cell).unwrap_or(unknown) as u8;
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
    let mut group_len = 0;
    for entry in &entries {
        let at = (entries.len() + groups.len()) as u16;
        match entry {
            Entry::Named(named) => {
                palette.push(named.to_bits(at));
                if let Nearby::Convex(group) | Nearby::Reentrant(group) = named {
                    groups.extend(group.words());
                }
                group_len = groups.len() as u16;
            }
            Entry::Finer(number) => {
                palette.push(Nearby::finer_bits(at));
                groups.push(*number);
            }
        }
    }
    let palette_len = palette.len() as u16;
    palette.extend(groups);
    Packed {
        palette,
        palette_len,
        group_len,
        index_bits,
        indices,
    }
}

#[cfg(test)]
mod tests {
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

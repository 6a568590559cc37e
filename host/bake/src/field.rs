//! Sampling the exact distance into sparse bricks.
//!
//! Only bricks with a point within the band of the surface are stored, and samples only in those in which some cell is interpolated. Trilinear interpolation of exact samples has an error of about cell²/(8R) on
//! a cylinder of radius R and is exact on planes; samples are rounded to `scale`, which adds at most scale/2. Cost: one exact query for
//! each of 729 samples of a stored brick, in parallel; a few queries for each empty one.

use std::collections::HashMap;
use std::ops::{ControlFlow, Range};

use glam::DVec3;
use mortise_protocol::image::{
    BRICK_CELLS, BrickRecord, FieldRecord, GridEntry, NO_SAMPLES, PatchRecord, patch_kind,
};
use rayon::prelude::*;

use crate::bounds::{Class, classify};
use crate::bricks::{Brick, Packed};
use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::format::FieldOptions;
use crate::free_form_error::FreeFormError;
use crate::grid::Grid;
use crate::levels::{Level, bake_levels, cell_of};
use crate::sides::Sides;

/// A standalone field: record offsets count from its own arrays.
#[derive(Clone, Debug)]
pub struct BakedField {
    /// Record as stored, except that `first_grid` and `first_brick` are 0.
    pub record: FieldRecord,
    /// Grid entries in 16 bits.
    pub grid: Vec<u16>,
    /// Bricks; offsets count from `blob` and `palette`.
    pub bricks: Vec<BrickRecord>,
    /// Palette entries.
    pub palette: Vec<u16>,
    /// Local patches, and behind them sides of smooth edges, that palettes name.
    pub patches: Vec<PatchRecord>,
    /// Measured error near free-form faces.
    pub free_form: FreeFormError,
    /// Samples and palette indices.
    pub blob: Vec<u8>,
    /// Number of sample bytes in `blob`; the rest are palette indices and padding.
    pub sample_bytes: usize,
    /// Number of grid entries with samples; equal bricks are stored once, so this can exceed the number of bricks.
    pub stored_entries: usize,
    /// Number of tested brick centres at which the sign disagreed with the winding number.
    pub sign_disagreements: usize,
    /// Number of brick centres tested.
    pub sign_tests: usize,
    /// Number of cells crossed by the surface in which the analytic faces near them were not proven to give the distance.
    pub unproven_cells: usize,
    /// Centre of one of these, mm.
    pub unproven_at: Option<DVec3>,
    /// Edge of the largest cell near the surface that is interpolated and errs more than asked, mm; 0 where there is none.
    pub rough_mm: f64,
    /// Number of finer bricks over cells without a rule.
    pub finer_bricks: usize,
    /// Groups of surfaces among the words of `palette`.
    pub(crate) groups: Vec<Range<usize>>,
}

impl BakedField {
    /// Whether it depends on the tolerance of local patches.
    pub(crate) fn has_local_patches(&self) -> bool {
        self.patches.iter().any(|patch| patch.kind == patch_kind::HEIGHT)
    }
}

/// Most grid entries of a field (2 bytes each; a larger grid would not fit any board).
const MAX_ENTRIES: u64 = 4 << 20;
/// Most entries with samples of a field: they take about 400 MB while baking.
const MAX_STORED: usize = 200_000;

/// Samples `surface`. `part` names it in errors. `progress` is called from any thread with (bricks done, total bricks) and can stop the work. The
/// result does not depend on the number of threads.
pub fn bake_field(
    surface: &mut ExactSurface,
    options: &FieldOptions,
    part: &str,
    progress: &(dyn Fn(usize, usize) -> ControlFlow<()> + Sync),
) -> Result<BakedField, BakeError> {
    let grid = Grid::over(
        surface.shape(),
        options.cell_mm,
        options.band_cells * options.cell_mm,
        surface.chord,
    );
    let reach = options.band_cells * grid.cell();
    let near = NearSurface::find(surface, &grid, reach, options.cell_mm, part, progress)?;
    let surface = &*surface;
    let done = std::sync::atomic::AtomicUsize::new(0);
    let all = near.stored.len();
    let step = || {
        let n = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
        progress(n.min(all), all).is_continue()
    };
    let sides = Sides::of(surface);
    let (levels, patches) =
        bake_levels(surface, &grid, options, &near.stored, &sides, &step).ok_or(BakeError::Cancelled)?;
    let unproven = || {
        let rough = levels.iter().flat_map(Level::rough);
        rough.filter_map(|(rough, at)| rough.unproven.then_some(at))
    };
    let (unproven_cells, unproven_at) = (unproven().count(), unproven().next());
    let is_rough = |level: &&Level| level.rough().any(|(rough, _)| rough.over > 1.0);
    let rough_mm = (levels.iter().filter(is_rough).map(|level| level.grid.cell())).fold(0.0, f64::max);
    let free_form = (levels.iter().map(Level::free_form)).fold(FreeFormError::default(), FreeFormError::and);
    let mut found = BakedField {
        sign_tests: near.sign_tests,
        sign_disagreements: near.sign_disagreements,
        unproven_cells,
        unproven_at,
        rough_mm,
        finer_bricks: levels.iter().skip(1).map(|level| level.bricks.len()).sum(),
        free_form,
        patches,
        ..pack(&grid, options, &near.classes, levels)
    };
    let first = surface.shape().faces.len() + found.patches.len();
    let named = sides.named(slices(&mut found.palette, &found.groups), first);
    found.patches.extend(named);
    check_brick_count(found.bricks.len(), options.cell_mm, part)?;
    Ok(found)
}

/// These runs of an array, which are in ascending order.
fn slices<'a>(mut words: &'a mut [u16], runs: &'a [Range<usize>]) -> impl Iterator<Item = &'a mut [u16]> {
    let mut at = 0;
    runs.iter().map(move |run| {
        let rest = std::mem::take(&mut words).split_at_mut(run.start - at).1;
        let (own, rest) = rest.split_at_mut(run.len());
        (words, at) = (rest, run.end);
        own
    })
}

/// Which bricks of a grid are near the surface.
pub(crate) struct NearSurface {
    /// Class of every grid entry.
    pub classes: Vec<Class>,
    /// Positions of the bricks to store, x fastest.
    pub stored: Vec<[u32; 3]>,
    /// See [`BakedField::sign_tests`].
    pub sign_tests: usize,
    /// See [`BakedField::sign_disagreements`].
    pub sign_disagreements: usize,
}

impl NearSurface {
    /// Bricks of `grid` with a point within `reach` mm of the surface. If normals prove wrong, the winding number decides signs from then on.
    pub fn find(
        surface: &mut ExactSurface,
        grid: &Grid,
        reach: f64,
        cell_mm: f64,
        part: &str,
        progress: &(dyn Fn(usize, usize) -> ControlFlow<()> + Sync),
    ) -> Result<Self, BakeError> {
        if grid.entries() > MAX_ENTRIES || grid.dims.iter().any(|&d| d > u32::from(u16::MAX)) {
            let ratio = (grid.entries() as f64 / MAX_ENTRIES as f64).cbrt().max(1.1);
            return Err(too_small(
                part,
                cell_mm,
                format!("{} grid entries, at most {MAX_ENTRIES}", grid.entries()),
                ratio * 1.1,
            ));
        }
        let alive = || progress(0, 0).is_continue();
        let classes = classify(surface, grid, reach, &alive);
        if !alive() {
            return Err(BakeError::Cancelled);
        }
        let stored: Vec<[u32; 3]> = positions(grid)
            .filter(|&b| classes[grid.index(b)] == Class::Stored)
            .collect();
        if stored.len() > MAX_STORED {
            let ratio = (stored.len() as f64 / MAX_STORED as f64).sqrt() * 1.1;
            return Err(too_small(
                part,
                cell_mm,
                format!("{} bricks near its surface, at most {MAX_STORED}", stored.len()),
                ratio,
            ));
        }
        let (sign_tests, sign_disagreements) = compare_signs(surface, grid, &stored, &classes);
        // A shell that is closed by its edge count but has overlapping, inside-out or doubled solids: the winding number decides.
        let classes = if sign_disagreements > 0 && !surface.sign_by_winding() {
            surface.set_sign_by_winding();
            classify(surface, grid, reach, &alive)
        } else {
            classes
        };
        Ok(Self {
            classes,
            stored,
            sign_tests,
            sign_disagreements,
        })
    }
}

/// Rejects a field with more different bricks than it can number.
pub(crate) fn check_brick_count(bricks: usize, cell_mm: f64, part: &str) -> Result<(), BakeError> {
    if bricks <= GridEntry::MAX_BRICKS {
        return Ok(());
    }
    let ratio = (bricks as f64 / GridEntry::MAX_BRICKS as f64).sqrt() * 1.1;
    let what = format!("{bricks} different bricks, at most {}", GridEntry::MAX_BRICKS);
    Err(too_small(part, cell_mm, what, ratio))
}

fn too_small(part: &str, cell_mm: f64, what: String, ratio: f64) -> BakeError {
    BakeError::CellTooSmall {
        part: part.to_owned(),
        cell_mm,
        what,
        enough_mm: cell_mm * ratio,
    }
}

pub(crate) fn positions(grid: &Grid) -> impl Iterator<Item = [u32; 3]> {
    let [w, h, d] = grid.dims;
    (0..d).flat_map(move |z| (0..h).flat_map(move |y| (0..w).map(move |x| [x, y, z])))
}

/// Compares the sign with the winding number at the centres of stored bricks that are clear of the surface.
fn compare_signs(
    surface: &ExactSurface,
    grid: &Grid,
    stored: &[[u32; 3]],
    classes: &[Class],
) -> (usize, usize) {
    let half = BRICK_CELLS / 2;
    let near = stored.par_iter().map(|&brick| {
        let p = grid.sample(brick, [half; 3]);
        let nearest = surface.nearest(p)?;
        // Within two chord errors the tessellation, and so its winding number, can be on the other side.
        (nearest.distance.abs() > 2.0 * surface.chord + 1e-6).then_some((p, nearest.distance < 0.0))
    });
    let far =
        positions(grid)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|brick| match classes[grid.index(brick)] {
                Class::Empty { inside, .. } => Some((grid.sample(brick, [half; 3]), inside)),
                Class::Stored => None,
            });
    near.chain(far)
        .flatten()
        .map(|(p, inside)| (1, usize::from((surface.winding_number(p) > 0.5) != inside)))
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
}

/// Bricks in arrays. Equal ones are stored once: grid entries share bricks, bricks share samples, indices and palettes.
#[derive(Default)]
struct Packer {
    records: Vec<BrickRecord>,
    palette: Vec<u16>,
    /// Groups of surfaces among the words of the palette.
    groups: Vec<Range<usize>>,
    blob: Vec<u8>,
    sample_bytes: usize,
    by_record: HashMap<[u32; 4], u16>,
    by_bytes: HashMap<Vec<u8>, u32>,
    by_palette: HashMap<(Vec<u16>, u16), u32>,
}

impl Packer {
    /// Number of a brick, which is stored if none is equal. Numbers past the limit wrap: the caller rejects such a field.
    fn number(&mut self, mut brick: Brick, options: &FieldOptions) -> u16 {
        let (samples, coarse) = brick.stored_samples(options.format, options.finer.is_some());
        let (palette, groups) = (&mut self.palette, &mut self.groups);
        let Packed {
            palette: run,
            palette_len,
            group_len,
            index_bits,
            indices,
        } = brick.packed;
        let palette_at = *(self.by_palette.entry((run, palette_len))).or_insert_with_key(|(run, entries)| {
            let at = palette.len();
            palette.extend_from_slice(run);
            let first = at + usize::from(*entries);
            groups.push(first..first + usize::from(group_len));
            at as u32
        });
        let samples = if samples.is_empty() {
            NO_SAMPLES
        } else {
            let (blob, sample_bytes) = (&mut self.blob, &mut self.sample_bytes);
            *self.by_bytes.entry(samples).or_insert_with_key(|bytes| {
                *sample_bytes += bytes.len();
                append_aligned(blob, bytes)
            })
        };
        let indices = if index_bits == 0 {
            0
        } else {
            let blob = &mut self.blob;
            *(self.by_bytes.entry(indices)).or_insert_with_key(|bytes| append_aligned(blob, bytes))
        };
        let bits = u32::from(index_bits) | u32::from(coarse) << 8 | u32::from(palette_len) << 16;
        let next = self.records.len() as u16;
        *(self.by_record.entry([samples, indices, palette_at, bits])).or_insert_with(|| {
            self.records.push(BrickRecord {
                samples,
                indices,
                palette: palette_at,
                palette_len,
                index_bits,
                coarse: u8::from(coarse),
            });
            next
        })
    }
}

/// The field of these levels. The bricks of the finest are stored first, so that each names only bricks of smaller numbers.
fn pack(grid: &Grid, options: &FieldOptions, classes: &[Class], levels: Vec<Level>) -> BakedField {
    let mut packer = Packer::default();
    let mut numbers: HashMap<[u32; 3], u16> = HashMap::new();
    for level in levels.into_iter().rev() {
        let mut own = HashMap::with_capacity(level.bricks.len());
        for (at, mut brick) in level.bricks {
            brick.cover(|cell| numbers.get(&cell_of(at, cell)).copied());
            own.insert(at, packer.number(brick, options));
        }
        numbers = own;
    }
    let mut entries: Vec<u16> = classes
        .iter()
        .map(|class| match *class {
            Class::Empty { inside, cells } => GridEntry::Empty { inside, cells }.to_bits(),
            Class::Stored => GridEntry::Brick(0).to_bits(),
        })
        .collect();
    for (at, number) in &numbers {
        entries[grid.index(*at)] = GridEntry::Brick(*number).to_bits();
    }
    let units = options.units_per_cell();
    let scale = (grid.cell() / 1000.0 / units) as f32;
    BakedField {
        record: FieldRecord {
            origin: grid.origin_m,
            cell: grid.cell_m,
            scale,
            band: (options.range_cells() * grid.cell() / 1000.0) as f32,
            brick_dims: grid.dims.map(|d| d as u16),
            format: options.format.code(),
            first_grid: 0,
            first_brick: 0,
            brick_count: packer.records.len() as u32,
        },
        grid: entries,
        bricks: packer.records,
        palette: packer.palette,
        groups: packer.groups,
        patches: Vec::new(),
        free_form: FreeFormError::default(),
        blob: packer.blob,
        sample_bytes: packer.sample_bytes,
        stored_entries: numbers.len(),
        sign_disagreements: 0,
        sign_tests: 0,
        unproven_cells: 0,
        unproven_at: None,
        rough_mm: 0.0,
        finer_bricks: 0,
    }
}

pub(crate) fn append_aligned(blob: &mut Vec<u8>, bytes: &[u8]) -> u32 {
    blob.resize(blob.len().next_multiple_of(4), 0);
    let at = blob.len() as u32;
    blob.extend_from_slice(bytes);
    at
}

//! Sampling the exact distance into sparse bricks.
//!
//! Only bricks with a point within the band of the surface are stored, and samples only in those in which some cell is interpolated. Trilinear interpolation of exact samples has an error of about cell²/(8R) on
//! a cylinder of radius R and is exact on planes; samples are rounded to `scale`, which adds at most scale/2. Cost: one exact query for
//! each of 729 samples of a stored brick, in parallel; a few queries for each empty one.

use std::collections::HashMap;
use std::ops::ControlFlow;

use glam::DVec3;
use mortise_protocol::image::{
    BRICK_CELLS, BrickRecord, FieldRecord, GridEntry, NO_SAMPLES, PatchRecord, patch_kind,
};
use rayon::prelude::*;

use crate::bounds::{Class, classify};
use crate::bricks::{Brick, bake_brick, sample_brick};
use crate::cell_samples::ExactSample;
use crate::cover::{LocalPatches, Sampled, has_free_forms};
use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::format::FieldOptions;
use crate::free_form_error::FreeFormError;
use crate::grid::Grid;
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
    let step = || {
        let n = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
        progress(n, near.stored.len()).is_continue()
    };
    let faces = surface.shape().faces.len();
    let baked = |beside: (&LocalPatches, &Sides), at, exact: &[ExactSample]| {
        bake_brick(surface, &grid, options, beside, at, exact)
    };
    let (bricks, patches, sides): (Option<Vec<Brick>>, _, _) = if has_free_forms(surface) {
        // Patches extend over many bricks: all samples first.
        let sampled: Option<Vec<Sampled>> = (near.stored.par_iter())
            .map(|&at| step().then(|| (at, sample_brick(surface, &grid, at))))
            .collect();
        let sampled = sampled.ok_or(BakeError::Cancelled)?;
        let alive = || progress(near.stored.len(), near.stored.len()).is_continue();
        let patches = LocalPatches::cover(surface, &grid, &sampled, options.patch_tolerance_mm, &alive);
        let sides = Sides::of(surface, faces + patches.records.len());
        let bricks =
            (sampled.par_iter()).map(|(at, exact)| alive().then(|| baked((&patches, &sides), *at, exact)));
        (bricks.collect(), patches, sides)
    } else {
        let none = LocalPatches::default();
        let sides = Sides::of(surface, faces);
        let bricks = (near.stored.par_iter())
            .map(|&at| step().then(|| baked((&none, &sides), at, &sample_brick(surface, &grid, at))));
        (bricks.collect(), none, sides)
    };
    let mut bricks = bricks.ok_or(BakeError::Cancelled)?;
    let mut patches = patches.records;
    patches.extend(sides.named((bricks.iter_mut()).map(Brick::groups)));
    let unproven_cells = bricks.iter().map(|brick| brick.unproven.cells).sum();
    let unproven_at = bricks.iter().find_map(|brick| brick.unproven.at);
    let free_form =
        (bricks.iter().map(|brick| brick.free_form)).fold(FreeFormError::default(), FreeFormError::and);
    let packed = pack(&grid, options, &near.classes, &near.stored, bricks);
    check_brick_count(packed.bricks.len(), options.cell_mm, part)?;
    Ok(BakedField {
        sign_tests: near.sign_tests,
        sign_disagreements: near.sign_disagreements,
        unproven_cells,
        unproven_at,
        patches,
        free_form,
        ..packed
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

/// Packs bricks into arrays and stores equal ones once: grid entries share bricks, bricks share samples, indices and palettes.
fn pack(
    grid: &Grid,
    options: &FieldOptions,
    classes: &[Class],
    stored: &[[u32; 3]],
    bricks: Vec<Brick>,
) -> BakedField {
    let mut entries: Vec<u16> = classes
        .iter()
        .map(|class| match *class {
            Class::Empty { inside, cells } => GridEntry::Empty { inside, cells }.to_bits(),
            Class::Stored => GridEntry::Brick(0).to_bits(),
        })
        .collect();
    let mut records: Vec<BrickRecord> = Vec::new();
    let mut palette: Vec<u16> = Vec::new();
    let mut blob: Vec<u8> = Vec::new();
    let mut by_record: HashMap<BrickRecord2, u16> = HashMap::new();
    let mut by_bytes: HashMap<Vec<u8>, u32> = HashMap::new();
    let mut by_palette: HashMap<Vec<u16>, u32> = HashMap::new();
    let mut sample_bytes = 0;
    for (&at, brick) in stored.iter().zip(bricks) {
        let palette_len = brick.palette_len;
        let palette_at = *by_palette.entry(brick.palette).or_insert_with_key(|run| {
            palette.extend_from_slice(run);
            (palette.len() - run.len()) as u32
        });
        let samples = if brick.samples.is_empty() {
            NO_SAMPLES
        } else {
            *by_bytes.entry(brick.samples).or_insert_with_key(|bytes| {
                sample_bytes += bytes.len();
                append_aligned(&mut blob, bytes)
            })
        };
        let indices = if brick.index_bits == 0 {
            0
        } else {
            *by_bytes
                .entry(brick.indices)
                .or_insert_with_key(|bytes| append_aligned(&mut blob, bytes))
        };
        let key = (samples, indices, palette_at, palette_len, brick.index_bits);
        let next = records.len();
        // Numbers past the limit wrap here; the caller rejects such a field.
        let number = *by_record.entry(key).or_insert_with(|| {
            records.push(BrickRecord {
                samples,
                indices,
                palette: palette_at,
                palette_len,
                index_bits: brick.index_bits,
            });
            next as u16
        });
        entries[grid.index(at)] = GridEntry::Brick(number).to_bits();
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
            brick_count: records.len() as u32,
        },
        grid: entries,
        bricks: records,
        palette,
        patches: Vec::new(),
        free_form: FreeFormError::default(),
        blob,
        sample_bytes,
        stored_entries: stored.len(),
        sign_disagreements: 0,
        sign_tests: 0,
        unproven_cells: 0,
        unproven_at: None,
    }
}

/// Samples, indices, palette, palette length, index bits.
type BrickRecord2 = (u32, u32, u32, u16, u16);

pub(crate) fn append_aligned(blob: &mut Vec<u8>, bytes: &[u8]) -> u32 {
    blob.resize(blob.len().next_multiple_of(4), 0);
    let at = blob.len() as u32;
    blob.extend_from_slice(bytes);
    at
}

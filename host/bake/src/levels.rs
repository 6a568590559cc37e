//! Bricks of a field and the finer bricks over some of their cells.
//!
//! A few cells of most shapes have no rule: where many small faces meet, where a free-form face is sharply curved, between two walls. Interpolation errs
//! there by a share of the cell, so that with cells of one size all of them would have to be as small as these few need. Instead a *finer brick* of cells
//! an eighth as large covers each such cell where interpolation errs more than asked, and so on in it. The bricks of one level are baked like a field of
//! their own whose grid is eight times as fine, with patches for its cells.

use glam::DVec3;
use mortise_protocol::image::{BRICK_CELLS, MOST_LEVELS, PatchRecord};
use rayon::prelude::*;

use crate::bricks::{Brick, Rough, bake_brick, sample_brick};
use crate::cell_samples::ExactSample;
use crate::cover::{LocalPatches, Sampled, has_free_forms};
use crate::distance::ExactSurface;
use crate::format::FieldOptions;
use crate::free_form_error::FreeFormError;
use crate::grid::Grid;
use crate::sides::Sides;

/// Finer bricks in one another: cells of a fivehundredth of the field's. Each further level takes eight times the bricks along a rough edge.
const LEVELS: usize = 3;
const _: () = assert!(LEVELS <= MOST_LEVELS);
/// Most finer bricks of a level: with more of them smaller cells everywhere take fewer bytes.
const MOST_FINER: usize = 600;
/// Most finer bricks over one brick: its palette names each of them.
const MOST_IN_BRICK: usize = 160;

/// Bricks of cells of one size, by their place in the grid of these cells.
pub(crate) struct Level {
    pub grid: Grid,
    pub bricks: Vec<([u32; 3], Brick)>,
    /// Whether finer bricks cover its rough cells that err more than asked.
    is_covered: bool,
}

impl Level {
    /// Rough cells that no finer brick covers, with their centres, mm.
    pub fn rough(&self) -> impl Iterator<Item = (&Rough, DVec3)> + Clone {
        self.bricks.iter().flat_map(|(at, brick)| {
            let left = brick
                .rough
                .iter()
                .filter(|rough| !(self.is_covered && rough.over > 1.0));
            left.map(|rough| {
                (
                    rough,
                    self.grid.sample(*at, rough.cell) + DVec3::splat(0.5 * self.grid.cell()),
                )
            })
        })
    }

    /// Error near free-form faces in the cells that no finer brick covers.
    pub fn free_form(&self) -> FreeFormError {
        let bricks = self.bricks.iter().map(|(_, brick)| brick.free_form);
        let rough = self.rough().map(|(rough, _)| rough.free_form);
        bricks
            .chain(rough)
            .fold(FreeFormError::default(), FreeFormError::and)
    }

    /// Places of the finer bricks over its rough cells that err more than asked; none where there would be too many.
    fn finer(&self) -> Vec<[u32; 3]> {
        let mut all = Vec::new();
        for (at, brick) in &self.bricks {
            let before = all.len();
            let over = brick.rough.iter().filter(|rough| rough.over > 1.0);
            all.extend(over.map(|rough| cell_of(*at, rough.cell)));
            if all.len() - before > MOST_IN_BRICK || all.len() > MOST_FINER {
                return Vec::new();
            }
        }
        all
    }
}

/// Place in the grid of a cell of a brick, which is also that of the finer brick over it.
pub(crate) fn cell_of(brick: [u32; 3], cell: [usize; 3]) -> [u32; 3] {
    std::array::from_fn(|a| brick[a] * BRICK_CELLS as u32 + cell[a] as u32)
}

/// The bricks of `grid` at these places, finer ones over their rough cells where `options` asks for them, and the patches of all. `step` is called
/// with each brick; `None` when it returned false.
pub(crate) fn bake_levels(
    surface: &ExactSurface,
    grid: &Grid,
    options: &FieldOptions,
    stored: &[[u32; 3]],
    sides: &Sides,
    step: &(dyn Fn() -> bool + Sync),
) -> Option<(Vec<Level>, Vec<PatchRecord>)> {
    let (mut levels, mut patches): (Vec<Level>, _) = (Vec::new(), Vec::new());
    let (mut grid, mut stored) = (*grid, stored.to_vec());
    loop {
        let (bricks, all) = bake_level(surface, &grid, options, &stored, (patches, sides), step)?;
        patches = all;
        let mut level = Level {
            grid,
            bricks: stored.into_iter().zip(bricks).collect(),
            is_covered: false,
        };
        let may_be_finer = options.finer.is_some() && levels.len() < LEVELS;
        stored = if may_be_finer { level.finer() } else { Vec::new() };
        level.is_covered = !stored.is_empty();
        levels.push(level);
        if stored.is_empty() {
            return Some((levels, patches));
        }
        grid = grid.finer();
    }
}

/// The bricks of one level, and the patches of all levels so far: those `before`, then its own.
fn bake_level(
    surface: &ExactSurface,
    grid: &Grid,
    options: &FieldOptions,
    stored: &[[u32; 3]],
    (before, sides): (Vec<PatchRecord>, &Sides),
    step: &(dyn Fn() -> bool + Sync),
) -> Option<(Vec<Brick>, Vec<PatchRecord>)> {
    let baked = |patches: &LocalPatches, at: [u32; 3], exact: &[ExactSample]| {
        bake_brick(surface, grid, options, (patches, sides), at, exact)
    };
    if !has_free_forms(surface) {
        let none = LocalPatches::default();
        let bricks =
            (stored.par_iter()).map(|&at| step().then(|| baked(&none, at, &sample_brick(surface, grid, at))));
        return Some((bricks.collect::<Option<_>>()?, before));
    }
    // Patches extend over many bricks: all samples first.
    let sampled: Option<Vec<Sampled>> = (stored.par_iter())
        .map(|&at| step().then(|| (at, sample_brick(surface, grid, at))))
        .collect();
    let sampled = sampled?;
    let patches = LocalPatches::cover(surface, grid, &sampled, options, before, step);
    let bricks = (sampled.par_iter()).map(|(at, exact)| step().then(|| baked(&patches, *at, exact)));
    Some((bricks.collect::<Option<_>>()?, patches.records))
}

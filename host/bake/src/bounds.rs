//! Classification of bricks from coarse to fine: which contain surface, and how far the others are from it.

use glam::DVec3;
use mortise_protocol::image::{BRICK_CELLS, GridEntry};
use rayon::prelude::*;

use crate::distance::{ExactSurface, Scratch};
use crate::grid::Grid;

/// Content of a grid entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    /// The band crosses it: samples are stored.
    Stored,
    /// No surface within this many cells of any of its points.
    Empty {
        /// Inside the solid.
        inside: bool,
        /// Whole cells, rounded down.
        cells: u16,
    },
}

/// Edge of the cubes of bricks the classification starts from: a power of two.
const BLOCK: u32 = 16;
/// Most boxes examined to tighten one brick's bound.
const REFINEMENTS: usize = 48;

/// Classifies every brick of `grid`: stored when some point of it is within `reach` mm of the surface (possibly also when one is slightly farther),
/// else empty with a true lower bound. Whole blocks far from the surface cost one query. `alive` is polled regularly; when it returns false the work
/// ends early with the results so far.
pub(crate) fn classify(
    surface: &ExactSurface,
    grid: &Grid,
    reach: f64,
    alive: &(dyn Fn() -> bool + Sync),
) -> Vec<Class> {
    let mut classes = vec![Class::Stored; grid.entries() as usize];
    let mut blocks = Vec::new();
    for z in (0..grid.dims[2]).step_by(BLOCK as usize) {
        for y in (0..grid.dims[1]).step_by(BLOCK as usize) {
            for x in (0..grid.dims[0]).step_by(BLOCK as usize) {
                blocks.push([x, y, z]);
            }
        }
    }
    let found: Vec<Vec<(usize, Class)>> = blocks
        .par_iter()
        .map(|&first| {
            let mut out = Vec::new();
            if alive() {
                let mut scratch = Scratch::default();
                descend(surface, grid, reach, first, BLOCK, &mut scratch, &mut out);
            }
            out
        })
        .collect();
    for (index, class) in found.into_iter().flatten() {
        classes[index] = class;
    }
    classes
}

/// Half the diagonal of a cube of `edge` bricks, mm.
fn half_diagonal(grid: &Grid, edge: f64) -> f64 {
    edge * BRICK_CELLS as f64 * grid.cell() * 0.75f64.sqrt()
}

fn descend(
    surface: &ExactSurface,
    grid: &Grid,
    reach: f64,
    first: [u32; 3],
    edge: u32,
    scratch: &mut Scratch,
    out: &mut Vec<(usize, Class)>,
) {
    if (0..3).any(|axis| first[axis] >= grid.dims[axis]) {
        return;
    }
    let half = f64::from(edge) / 2.0;
    let center = grid.at((DVec3::from_array(first.map(f64::from)) + half) * BRICK_CELLS as f64);
    let half_diagonal = half_diagonal(grid, f64::from(edge));
    let Some(far) = surface.at_least(center, f64::INFINITY) else {
        return;
    };
    if edge > 1 && far > half_diagonal + reach {
        // Far from the surface: one sign for the whole block. Each brick's bound comes from the distance at its own centre, which is at least the
        // block's distance less the distance between the two centres.
        let inside = is_inside(surface, center, scratch);
        for z in first[2]..(first[2] + edge).min(grid.dims[2]) {
            for y in first[1]..(first[1] + edge).min(grid.dims[1]) {
                for x in first[0]..(first[0] + edge).min(grid.dims[0]) {
                    let bound = lower_bound(surface, grid, [x, y, z]);
                    out.push((grid.index([x, y, z]), empty(grid, inside, bound)));
                }
            }
        }
        return;
    }
    if edge > 1 {
        let h = edge / 2;
        for dz in [0, h] {
            for dy in [0, h] {
                for dx in [0, h] {
                    let child = [first[0] + dx, first[1] + dy, first[2] + dz];
                    descend(surface, grid, reach, child, h, scratch, out);
                }
            }
        }
        return;
    }
    let class = if far > half_diagonal + reach || lower_bound(surface, grid, first) > reach {
        let bound = lower_bound(surface, grid, first);
        empty(grid, is_inside(surface, center, scratch), bound)
    } else {
        Class::Stored
    };
    out.push((grid.index(first), class));
}

fn is_inside(surface: &ExactSurface, p: DVec3, scratch: &mut Scratch) -> bool {
    surface
        .query(p, f64::INFINITY, scratch)
        .is_some_and(|n| n.distance < 0.0)
}

fn empty(grid: &Grid, inside: bool, bound_mm: f64) -> Class {
    // Margins: a millionth for the board's f32 product, a thousandth of a cell for its f32 brick index.
    let cells = (bound_mm * (1.0 - 1e-6) / grid.cell() - 1e-3).floor().max(0.0);
    Class::Empty {
        inside,
        cells: cells.min(f64::from(GridEntry::MAX_CELLS)) as u16,
    }
}

/// Lower bound of the distance from any point of a brick to the surface, mm: branch and bound over boxes, each bounded by the distance at
/// its centre less half its diagonal, until the gap is below half a cell or a tenth of the bound.
fn lower_bound(surface: &ExactSurface, grid: &Grid, brick: [u32; 3]) -> f64 {
    struct Box {
        center: DVec3,
        edge: f64,
        low: f64,
    }
    let origin = DVec3::from_array(brick.map(f64::from));
    let evaluate = |center: DVec3, edge: f64| {
        let p = grid.at(center * BRICK_CELLS as f64);
        let distance = surface.at_least(p, f64::INFINITY).unwrap_or(f64::INFINITY);
        (
            Box {
                center,
                edge,
                low: (distance - half_diagonal(grid, edge)).max(0.0),
            },
            distance,
        )
    };
    let (first, mut high) = evaluate(origin + 0.5, 1.0);
    let mut open = vec![first];
    for _ in 0..REFINEMENTS {
        // Few boxes: a linear search is cheaper than a heap.
        let Some(lowest) = (0..open.len()).min_by(|&a, &b| open[a].low.total_cmp(&open[b].low)) else {
            break;
        };
        let low = open[lowest].low;
        if high - low <= (0.5 * grid.cell()).max(0.1 * low) {
            break;
        }
        let parent = open.swap_remove(lowest);
        let quarter = parent.edge / 4.0;
        for corner in 0..8u32 {
            let sign = |bit: u32| if corner >> bit & 1 == 0 { -quarter } else { quarter };
            let center = parent.center + DVec3::new(sign(0), sign(1), sign(2));
            let (child, distance) = evaluate(center, parent.edge / 2.0);
            high = high.min(distance);
            open.push(Box {
                low: child.low.max(parent.low),
                ..child
            });
        }
    }
    open.iter().map(|b| b.low).fold(f64::INFINITY, f64::min)
}

//! Local patches of a shape's free-form faces, and the cells that name them.
//!
//! The cells near a face are divided in space, by the median of their longer extent, until one cubic patch fits all points of the face that are
//! nearest to the cells of a part within the tolerance, also at points that it was not fitted to. Nothing is divided in the surface's own parameters,
//! so poles, seams and two sheets in one face need no rule. A single cell takes a patch that errs more, for
//! interpolation there would err far more still.
//!
//! Cost: five exact queries for each cell near a free-form face; fits cost little beside them.

use std::collections::HashMap;

use glam::DVec3;
use mortise_brep::Surface;
use mortise_protocol::image::{BRICK_CELLS, CELLS_PER_BRICK, NO_FACE, Nearby, PatchRecord};
use rayon::prelude::*;

use crate::cell_features::places_on_faces;
use crate::cell_samples::{ExactSample, Place, about, corner_places, index};
use crate::distance::{ExactSurface, Scratch};
use crate::grid::Grid;
use crate::local_patch::{FacePoint, board_distance, fit, is_foot};

/// Distance from the surface up to which patches hold their tolerance, cells. Farther off the feet of a cell spread: a cell deep inside a sharply
/// curved face would need a patch of half of that face.
pub(crate) const NEAR_CELLS: f64 = 0.6;
/// Distance up to which patches are fitted, cells: that of a corner of a cell that the surface crosses.
const FITTED_CELLS: f64 = 0.9;
/// Share of the tolerance that a patch may use at the places verified: between them it errs a little more.
const FIT_SHARE: f64 = 0.75;
/// Factors by which the tolerance is relaxed in a cell where no surface keeps it: the error is measured, and interpolation there errs far more.
pub(crate) const RELAXED: [f64; 3] = [1.0, 4.0, 16.0];
/// Edge of the cube from which a patch is fitted at a face's border, as a multiple of a cell's edge, and share of the edge by which it holds beyond.
const AROUND: f64 = 1.4;
const BEYOND: f64 = 0.01;
/// Error of patches farther off than [`NEAR_CELLS`], as a share of the distance.
const FAR_ERROR: f64 = 0.02;
/// A cell with no corner this near to the surface has no point within [`NEAR_CELLS`], cells.
const REACH_CELLS: f64 = NEAR_CELLS + 0.87;
/// Most points of one fit: more of them change a cubic by less than its tolerance.
const MOST_POINTS: usize = 600;
/// With fewer cells a patch is fitted to a lattice of points in each instead of its corners alone.
const FEW_CELLS: usize = 3;
/// Places in a cell that are verified, and not fitted to.
pub(crate) const VERIFIED: [[f64; 3]; 5] = [
    [0.5, 0.5, 0.5],
    [0.2, 0.3, 0.25],
    [0.8, 0.7, 0.2],
    [0.25, 0.75, 0.8],
    [0.7, 0.2, 0.75],
];
/// Points along a cell's edge at which a patch must have a foot.
const ANSWERED: usize = 4;

/// Largest error of a patch at this distance from the surface, mm.
pub(crate) fn tolerance_at(tolerance_mm: f64, cell_mm: f64, distance: f64) -> f64 {
    if distance.abs() <= NEAR_CELLS * cell_mm {
        tolerance_mm
    } else {
        tolerance_mm + FAR_ERROR * distance.abs()
    }
}

/// A brick's place in the grid and its exact samples.
pub(crate) type Sampled = ([u32; 3], Vec<ExactSample>);

/// Patches of a shape.
#[derive(Default)]
pub(crate) struct LocalPatches {
    /// In the image's order.
    pub records: Vec<PatchRecord>,
    /// Patch of a face in a cell, by the cell's place in the grid.
    cells: HashMap<([u32; 3], u16), u16>,
    /// Exact samples at [`VERIFIED`] in the cells near free-form faces.
    verified: HashMap<[u32; 3], [Place; VERIFIED.len()]>,
}

/// A cell near a free-form face.
struct NearCell {
    /// Its place in the grid.
    cell: [u32; 3],
    corners: [Place; 8],
    verified: [Place; VERIFIED.len()],
    faces: Vec<u16>,
    /// Points of free-form faces in and around a cell that several faces enter, where few other places have a foot; whether each is in the cell.
    on: Vec<(u16, FacePoint, bool)>,
}

impl LocalPatches {
    /// Patches for all faces of `surface` that have an exact free-form surface. `alive` is polled regularly; when it returns false the work ends early
    /// with some of them.
    pub fn cover(
        surface: &ExactSurface,
        grid: &Grid,
        bricks: &[Sampled],
        tolerance_mm: f64,
        alive: &(dyn Fn() -> bool + Sync),
    ) -> Self {
        let near: Vec<NearCell> = (bricks.par_iter())
            .filter(|_| alive())
            .flat_map_iter(|(at, samples)| near_cells(surface, grid, *at, samples))
            .collect();
        let mut by_face: HashMap<u16, Vec<&NearCell>> = HashMap::new();
        for cell in &near {
            for &face in &cell.faces {
                by_face.entry(face).or_default().push(cell);
            }
        }
        let mut faces: Vec<_> = by_face.into_iter().collect();
        faces.sort_by_key(|(face, _)| *face);
        let found: Vec<Vec<Part<'_>>> = (faces.into_par_iter())
            .map(|(face, mut cells)| {
                let fitter = Fitter {
                    surface,
                    face,
                    cell: grid.cell(),
                    tolerance_mm: FIT_SHARE * tolerance_mm,
                    alive,
                };
                fitter.divide(&mut cells)
            })
            .collect();
        let mut all = Self::default();
        let most = usize::from(Nearby::MAX_FACES).saturating_sub(surface.shape().faces.len());
        for part in found.into_iter().flatten().take(most) {
            let number = all.records.len() as u16;
            let face = part.patch.face;
            all.cells
                .extend(part.cells.iter().map(|cell| ((cell.cell, face), number)));
            all.records.push(part.patch);
        }
        all.verified = near.into_iter().map(|cell| (cell.cell, cell.verified)).collect();
        all
    }

    /// Patch of `face` in a cell.
    pub fn patch(&self, cell: [u32; 3], face: u16) -> Option<u16> {
        self.cells.get(&(cell, face)).copied()
    }

    /// Whether a patch has a unique foot all over the cell with the lowest corner `low`, by a lattice of its points.
    pub fn answers(&self, patch: usize, low: DVec3, cell: f64) -> bool {
        let Some(patch) = self.records.get(patch) else {
            return false;
        };
        let steps = 0..ANSWERED * ANSWERED * ANSWERED;
        steps.into_iter().all(|i| {
            let place = [i % ANSWERED, i / ANSWERED % ANSWERED, i / ANSWERED / ANSWERED];
            let share = DVec3::from_array(place.map(|i| i as f64)) / (ANSWERED - 1) as f64;
            !board_distance(patch, low + share * cell).is_nan()
        })
    }

    /// Exact samples at [`VERIFIED`] of a cell, for cells near a free-form face.
    pub fn verified(&self, cell: [u32; 3]) -> Option<&[Place; VERIFIED.len()]> {
        self.verified.get(&cell)
    }
}

/// Whether any face has an exact surface without closed form.
pub(crate) fn has_free_forms(surface: &ExactSurface) -> bool {
    (0..surface.shape().faces.len()).any(|face| is_free_form(surface, face as u16))
}

/// Whether a face has an exact surface without closed form.
fn is_free_form(surface: &ExactSurface, face: u16) -> bool {
    let of = surface.shape().faces.get(usize::from(face));
    of.is_some_and(|f| matches!(f.surface, Surface::Spline))
        && surface.topology.free_forms.patch(u32::from(face)).is_some()
}

/// Exact samples at [`VERIFIED`] of the cell with the lowest corner `corner`.
fn verify_places(
    surface: &ExactSurface,
    corner: Place,
    cell: f64,
    scratch: &mut Scratch,
) -> [Place; VERIFIED.len()] {
    VERIFIED.map(|f| beside(surface, corner, DVec3::from_array(f) * cell, scratch))
}

/// Exact sample at `step` from a place; the place's distance bounds the search.
fn beside(surface: &ExactSurface, from: Place, step: DVec3, scratch: &mut Scratch) -> Place {
    let at = from.at + step;
    let known = from.exact.distance.abs();
    let within = if known.is_nan() {
        f64::INFINITY
    } else {
        (known + step.length()) * (1.0 + 1e-9)
    };
    let exact = surface
        .query(at, within, scratch)
        .map_or(ExactSample::NONE, ExactSample::of);
    Place { at, exact }
}

/// Cells of a brick that need a patch.
fn near_cells<'a>(
    surface: &'a ExactSurface,
    grid: &'a Grid,
    brick: [u32; 3],
    samples: &'a [ExactSample],
) -> impl Iterator<Item = NearCell> + 'a {
    let mut scratch = Scratch::default();
    (0..CELLS_PER_BRICK).filter_map(move |i| {
        let at = [i & 7, i >> 3 & 7, i >> 6];
        let corners = corner_places(at).map(|place| Place {
            at: grid.sample(brick, place),
            exact: samples[index(place)],
        });
        let nearest = corners.iter().map(|c| c.exact.distance.abs());
        if nearest.fold(f64::INFINITY, f64::min) > REACH_CELLS * grid.cell() {
            return None;
        }
        let mut faces: Vec<u16> = about(at).map(|place| samples[index(place)].face).collect();
        faces.sort_unstable();
        faces.dedup();
        faces.retain(|&face| face != NO_FACE && is_free_form(surface, face));
        if faces.is_empty() {
            return None;
        }
        let center = corners[0].at + DVec3::splat(0.5 * grid.cell());
        Some(NearCell {
            on: points_at_borders(surface, center, grid.cell()),
            cell: std::array::from_fn(|a| brick[a] * BRICK_CELLS as u32 + at[a] as u32),
            verified: verify_places(surface, corners[0], grid.cell(), &mut scratch),
            corners,
            faces,
        })
    })
}

/// Points of free-form faces in and around the cell with this centre and edge if more than one face is there.
fn points_at_borders(surface: &ExactSurface, center: DVec3, cell: f64) -> Vec<(u16, FacePoint, bool)> {
    let places = places_on_faces(surface, center, AROUND * cell);
    if places.iter().all(|place| place.0 == places[0].0) {
        return Vec::new();
    }
    let topology = &surface.topology;
    (places.into_iter())
        .filter_map(|(face, triangle, p)| {
            let on = topology.free_forms.beside(u32::from(face), triangle, p)?;
            let outward = on.normal * topology.sense[usize::from(face)];
            let within = (on.point - center).abs().max_element() <= (0.5 + BEYOND) * cell;
            let point = FacePoint {
                at: on.point,
                outward,
            };
            Some((face, point, within))
        })
        .collect()
}

/// Cells of one patch.
struct Part<'a> {
    patch: PatchRecord,
    cells: Vec<&'a NearCell>,
}

/// Patches of one face.
struct Fitter<'a> {
    surface: &'a ExactSurface,
    face: u16,
    /// Cell edge, mm.
    cell: f64,
    tolerance_mm: f64,
    alive: &'a (dyn Fn() -> bool + Sync),
}

impl Fitter<'_> {
    /// Patches for these cells: one for all, or those of two halves.
    fn divide<'c>(&self, cells: &mut [&'c NearCell]) -> Vec<Part<'c>> {
        if !(self.alive)() {
            return Vec::new();
        }
        let patch = fit(&self.points(cells), self.face);
        // A single cell is not divided: it takes a patch that errs more.
        let relaxed = if cells.len() < 2 { RELAXED[2] } else { 1.0 };
        let holds = |patch: &PatchRecord| cells.iter().all(|cell| self.holds(patch, cell, relaxed));
        if let Some(patch) = patch.filter(holds) {
            let cells = cells.to_vec();
            return vec![Part { patch, cells }];
        }
        if cells.len() < 2 {
            return Vec::new();
        }
        let range = |axis: usize| {
            let along = cells.iter().map(|c| c.cell[axis]);
            along.clone().max().unwrap_or(0) - along.min().unwrap_or(0)
        };
        let axis = (0..3).max_by_key(|&axis| range(axis)).unwrap_or(0);
        cells.sort_unstable_by_key(|c| (c.cell[axis], c.cell));
        let (low, high) = cells.split_at_mut(cells.len() / 2);
        let (mut first, second) = rayon::join(|| self.divide(low), || self.divide(high));
        first.extend(second);
        first
    }

    /// Points of the face nearest to the corners of the cells; where there are few cells, nearest to a lattice of points in them.
    fn points(&self, cells: &[&NearCell]) -> Vec<FacePoint> {
        let mut all: Vec<FacePoint> = (cells.iter())
            .flat_map(|cell| cell.corners)
            .filter_map(|place| self.foot(&place))
            .collect();
        all.extend(
            cells
                .iter()
                .flat_map(|cell| self.on(cell))
                .map(|(point, _)| point),
        );
        if all.len() > MOST_POINTS {
            let (count, step) = (all.len(), all.len() as f64 / MOST_POINTS as f64);
            return (0..MOST_POINTS)
                .map(|i| all[((i as f64 * step) as usize).min(count - 1)])
                .collect();
        }
        if cells.len() < FEW_CELLS {
            let mut scratch = Scratch::default();
            for cell in cells {
                let lattice = (0..27).map(|i| DVec3::new((i % 3) as f64, (i / 3 % 3) as f64, (i / 9) as f64));
                all.extend(lattice.filter_map(|i| {
                    let step = (i + 0.5) * (self.cell / 3.0);
                    self.foot(&beside(self.surface, cell.corners[0], step, &mut scratch))
                }));
            }
        }
        all
    }

    /// Points of the face in and around a cell at its border, and whether each is in the cell.
    fn on<'c>(&self, cell: &'c NearCell) -> impl Iterator<Item = (FacePoint, bool)> + use<'c> {
        let face = self.face;
        let own = cell.on.iter().filter(move |(of, ..)| *of == face);
        own.map(|&(_, point, within)| (point, within))
    }

    /// Foot of a place near the surface if it lies on the face.
    fn foot(&self, place: &Place) -> Option<FacePoint> {
        let near = place.exact.distance.abs() <= FITTED_CELLS * self.cell;
        (near && place.exact.face == self.face).then_some(FacePoint {
            at: place.exact.foot,
            outward: (place.at - place.exact.foot) * place.exact.distance.signum(),
        })
    }

    /// Whether the patch passes through the feet of a cell's places, and gives their distances, within the tolerance times `relaxed`.
    fn holds(&self, patch: &PatchRecord, cell: &NearCell, relaxed: f64) -> bool {
        let tolerance_mm = relaxed * self.tolerance_mm;
        let passes = |p: FacePoint| board_distance(patch, p.at).abs() <= tolerance_mm;
        if !self.on(cell).all(|(point, within)| !within || passes(point)) {
            return false;
        }
        cell.corners.iter().chain(&cell.verified).all(|place| {
            let Some(foot) = self.foot(place) else { return true };
            let distance = place.exact.distance;
            let tolerance = tolerance_at(tolerance_mm, self.cell, distance);
            // False for NaN.
            let within = |p: DVec3, distance: f64| (board_distance(patch, p) - distance).abs() <= tolerance;
            // On the border of the face the cell is decided together with its neighbours.
            within(foot.at, 0.0) && (!is_foot(patch, place) || within(place.at, distance))
        })
    }
}

//! Local patches of a shape's free-form faces, and the cells that name them.
//!
//! The sheets of a face in the cells near it ([`crate::sheets`]) are divided until one cubic patch fits all points of a part within the tolerance, also
//! at points that it was not fitted to: first by the direction of their normals, then in space, by the median along the axis that leaves the least
//! bending in the halves. Nothing is divided in the surface's own parameters, so poles and seams need no rule. A single cell takes a patch that errs
//! more where no finer bricks can do better, for interpolation there would err far more still.
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
use crate::format::FieldOptions;
use crate::grid::Grid;
use crate::local_patch::{FacePoint, board_distance, fit, is_foot};
use crate::sheets::{OnFace, nearest_sheet, sheets};

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
/// Surface indices kept for sides of smooth edges.
pub(crate) const MOST_SIDES: usize = 2048;
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
/// Feet farther than this outside the fitted points mean nothing, cells: rules extend a patch over the cells that name it.
const BEYOND_CELLS: f64 = 1.0;
/// Cosine of the largest angle between normals of one part: beyond it the height over one plane is steep.
const MOST_TURNED: f64 = 0.7;
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

/// Patches of the cells of one size.
#[derive(Default)]
pub(crate) struct LocalPatches {
    /// In the image's order, those of larger cells first.
    pub records: Vec<PatchRecord>,
    /// Sheets of a face in a cell, by the cell's place in the grid.
    cells: HashMap<([u32; 3], u16), Vec<Covered>>,
    /// Exact samples at [`VERIFIED`] in the cells near free-form faces.
    verified: HashMap<[u32; 3], [Place; VERIFIED.len()]>,
}

/// A sheet of a face in a cell and its patch.
pub(crate) struct Covered {
    pub patch: u16,
    /// Points of the sheet.
    points: Vec<OnFace>,
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

/// A sheet of a face in a cell, with what is known of it.
struct Sheet<'a> {
    of: &'a NearCell,
    /// Places of the cell with a foot on it.
    places: Vec<Place>,
    /// Points of it at a border, and whether each is in the cell.
    on: Vec<(FacePoint, bool)>,
    /// Sum of its normals.
    normal: DVec3,
}

impl<'a> Sheet<'a> {
    /// The sheets of `face` in a cell of this edge.
    fn all(of: &'a NearCell, face: u16, cell_mm: f64) -> Vec<Self> {
        let near = |place: &&Place| is_fitted(place, face, cell_mm);
        let places: Vec<Place> = of
            .corners
            .iter()
            .chain(&of.verified)
            .filter(near)
            .copied()
            .collect();
        let own = of.on.iter().filter(|(of, ..)| *of == face);
        let on: Vec<(FacePoint, bool)> = own.map(|&(_, point, within)| (point, within)).collect();
        let points: Vec<OnFace> = (places.iter().map(|place| (place.exact.foot, place.exact.normal)))
            .chain(on.iter().map(|(point, _)| (point.at, point.outward)))
            .collect();
        let numbers = sheets(&points, cell_mm);
        let count = numbers.iter().max().map_or(0, |most| most + 1);
        (0..count)
            .map(|sheet| {
                let is_own = |i: &usize| numbers[*i] == sheet;
                let own = (0..places.len()).filter(is_own).map(|i| places[i]);
                let on_own = (0..on.len())
                    .filter(|i| is_own(&(places.len() + i)))
                    .map(|i| on[i]);
                Self {
                    of,
                    places: own.collect(),
                    on: on_own.collect(),
                    normal: (0..points.len()).filter(is_own).map(|i| points[i].1).sum(),
                }
            })
            .collect()
    }

    /// Its points.
    fn points(&self) -> Vec<OnFace> {
        let feet = self
            .places
            .iter()
            .map(|place| (place.exact.foot, place.exact.normal));
        feet.chain(self.on.iter().map(|(point, _)| (point.at, point.outward)))
            .collect()
    }
}

/// Whether a place is so near to the surface that its foot on this face is fitted.
fn is_fitted(place: &Place, face: u16, cell_mm: f64) -> bool {
    place.exact.face == face && place.exact.distance.abs() <= FITTED_CELLS * cell_mm
}

impl LocalPatches {
    /// Patches for all faces of `surface` that have an exact free-form surface, behind those of larger cells, `before`. `alive` is polled regularly;
    /// when it returns false the work ends early with some of them.
    pub fn cover(
        surface: &ExactSurface,
        grid: &Grid,
        bricks: &[Sampled],
        options: &FieldOptions,
        before: Vec<PatchRecord>,
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
        let found: Vec<Vec<Part>> = (faces.into_par_iter())
            .map(|(face, cells)| {
                let fitter = Fitter {
                    surface,
                    face,
                    cell: grid.cell(),
                    tolerance_mm: FIT_SHARE * options.patch_tolerance_mm * options.factor(face),
                    relaxed: if options.finer.is_some() { 1.0 } else { RELAXED[2] },
                    alive,
                };
                let mut sheets: Vec<Sheet<'_>> = (cells.into_iter())
                    .flat_map(|cell| Sheet::all(cell, face, grid.cell()))
                    .collect();
                fitter.divide(&mut sheets)
            })
            .collect();
        let mut all = Self {
            records: before,
            ..Self::default()
        };
        let most = usize::from(Nearby::MAX_FACES)
            .saturating_sub(surface.shape().faces.len() + all.records.len() + MOST_SIDES);
        for part in found.into_iter().flatten().take(most) {
            let patch = all.records.len() as u16;
            let face = part.patch.face;
            for (cell, points) in part.sheets {
                let sheets = all.cells.entry((cell, face)).or_default();
                sheets.push(Covered { patch, points });
            }
            all.records.push(part.patch);
        }
        all.verified = near.into_iter().map(|cell| (cell.cell, cell.verified)).collect();
        all
    }

    /// The sheets of `face` in a cell that have a patch.
    pub fn sheets(&self, cell: [u32; 3], face: u16) -> &[Covered] {
        self.cells.get(&(cell, face)).map_or(&[], Vec::as_slice)
    }

    /// The sheet of a face in a cell to which the foot of a place belongs.
    pub fn sheet_of(sheets: &[Covered], place: &Place) -> Option<usize> {
        let points = sheets.iter().map(|sheet| sheet.points.as_slice());
        nearest_sheet(points, (place.exact.foot, place.exact.normal))
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
            let outward = (on.normal * topology.sense[usize::from(face)]).normalize_or_zero();
            let within = (on.point - center).abs().max_element() <= (0.5 + BEYOND) * cell;
            let point = FacePoint {
                at: on.point,
                outward,
            };
            Some((face, point, within))
        })
        .collect()
}

/// Sheets of one patch: their cells and points.
struct Part {
    patch: PatchRecord,
    sheets: Vec<([u32; 3], Vec<OnFace>)>,
}

/// Patches of one face.
struct Fitter<'a> {
    surface: &'a ExactSurface,
    face: u16,
    /// Cell edge, mm.
    cell: f64,
    tolerance_mm: f64,
    /// Factor of the tolerance of a patch for a single cell.
    relaxed: f64,
    alive: &'a (dyn Fn() -> bool + Sync),
}

impl Fitter<'_> {
    /// Patches for these sheets: one for all, or those of two parts of them.
    fn divide(&self, sheets: &mut [Sheet<'_>]) -> Vec<Part> {
        if !(self.alive)() || sheets.is_empty() {
            return Vec::new();
        }
        let turned = turned(sheets);
        if turned.is_none() || sheets.len() == 1 {
            let patch = fit(&self.points(sheets), self.face, BEYOND_CELLS * self.cell);
            // A single cell is not divided: it takes a patch that errs more.
            let relaxed = if sheets.len() == 1 { self.relaxed } else { 1.0 };
            let holds = |patch: &PatchRecord| sheets.iter().all(|sheet| self.holds(patch, sheet, relaxed));
            if let Some(patch) = patch.filter(holds) {
                let sheets = sheets.iter().map(|sheet| (sheet.of.cell, sheet.points()));
                return vec![Part {
                    patch,
                    sheets: sheets.collect(),
                }];
            }
            if sheets.len() == 1 {
                return Vec::new();
            }
        }
        let middle = match turned {
            Some(towards) => {
                // Between the two directions farthest apart; each has a sheet.
                let side = |sheet: &Sheet| sheet.normal.normalize_or_zero().dot(towards);
                sheets.sort_by(|a, b| side(a).total_cmp(&side(b)).then(a.of.cell.cmp(&b.of.cell)));
                let middle = sheets.partition_point(|sheet| side(sheet) < 0.0);
                middle.clamp(1, sheets.len() - 1)
            }
            None => {
                let axis = flattest_axis(sheets);
                sheets.sort_by_key(|s| (s.of.cell[axis], s.of.cell));
                sheets.len() / 2
            }
        };
        let (low, high) = sheets.split_at_mut(middle);
        let (mut first, second) = rayon::join(|| self.divide(low), || self.divide(high));
        first.extend(second);
        first
    }

    /// Points of the face nearest to the corners of the cells; where there are few cells, nearest to a lattice of points in them.
    fn points(&self, sheets: &[Sheet<'_>]) -> Vec<FacePoint> {
        let corners = sheets.iter().flat_map(|sheet| {
            let is_corner = |place: &&Place| sheet.of.corners.iter().any(|corner| corner.at == place.at);
            sheet.places.iter().filter(is_corner).map(foot)
        });
        let mut all: Vec<FacePoint> = corners.collect();
        all.extend(
            sheets
                .iter()
                .flat_map(|sheet| sheet.on.iter().map(|(point, _)| *point)),
        );
        if all.len() > MOST_POINTS {
            let (count, step) = (all.len(), all.len() as f64 / MOST_POINTS as f64);
            return (0..MOST_POINTS)
                .map(|i| all[((i as f64 * step) as usize).min(count - 1)])
                .collect();
        }
        if sheets.len() < FEW_CELLS {
            let mut scratch = Scratch::default();
            for sheet in sheets {
                let own = sheet.points();
                let others: Vec<Vec<OnFace>> = (Sheet::all(sheet.of, self.face, self.cell).iter())
                    .map(Sheet::points)
                    .collect();
                let is_own = |place: &Place| {
                    let of = others.iter().map(Vec::as_slice);
                    let found = nearest_sheet(of, (place.exact.foot, place.exact.normal));
                    found.is_none_or(|found| others[found] == own)
                };
                let lattice = (0..27).map(|i| DVec3::new((i % 3) as f64, (i / 3 % 3) as f64, (i / 9) as f64));
                all.extend(lattice.filter_map(|i| {
                    let step = (i + 0.5) * (self.cell / 3.0);
                    let place = beside(self.surface, sheet.of.corners[0], step, &mut scratch);
                    (is_fitted(&place, self.face, self.cell) && is_own(&place)).then(|| foot(&place))
                }));
            }
        }
        all
    }

    /// Whether the patch passes through the feet of a sheet's places, and gives their distances, within the tolerance times `relaxed`.
    fn holds(&self, patch: &PatchRecord, sheet: &Sheet<'_>, relaxed: f64) -> bool {
        let tolerance_mm = relaxed * self.tolerance_mm;
        let passes = |p: FacePoint| board_distance(patch, p.at).abs() <= tolerance_mm;
        if !(sheet.on.iter()).all(|(point, within)| !within || passes(*point)) {
            return false;
        }
        sheet.places.iter().all(|place| {
            let distance = place.exact.distance;
            let tolerance = tolerance_at(tolerance_mm, self.cell, distance);
            // False for NaN.
            let within = |p: DVec3, distance: f64| (board_distance(patch, p) - distance).abs() <= tolerance;
            // On the border of the face the cell is decided together with its neighbours.
            within(place.exact.foot, 0.0) && (!is_foot(patch, place) || within(place.at, distance))
        })
    }
}

/// Foot of a place, and the direction out of the solid there.
fn foot(place: &Place) -> FacePoint {
    let exact = place.exact;
    let outward = if exact.normal == DVec3::ZERO {
        (place.at - exact.foot) * exact.distance.signum()
    } else {
        exact.normal
    };
    FacePoint {
        at: exact.foot,
        outward,
    }
}

/// The difference of the two directions farthest apart of these sheets, as found from the first one, if one patch cannot serve both.
fn turned(sheets: &[Sheet<'_>]) -> Option<DVec3> {
    let normals: Vec<DVec3> = (sheets.iter())
        .filter_map(|sheet| sheet.normal.try_normalize())
        .collect();
    let farthest = |from: DVec3| {
        let others = normals.iter().copied();
        others.min_by(|a, b| a.dot(from).total_cmp(&b.dot(from)))
    };
    let one = farthest(*normals.first()?)?;
    let other = farthest(one)?;
    (one.dot(other) < MOST_TURNED).then_some(one - other)
}

/// The axis whose halves bend least: by the spread of the normals in them, and by their extent where nothing bends.
fn flattest_axis(sheets: &mut [Sheet<'_>]) -> usize {
    let spread = |axis: usize, sheets: &mut [Sheet<'_>]| {
        let along = |s: &Sheet<'_>| s.of.cell[axis];
        let least = sheets.iter().map(along).min().unwrap_or(0);
        let range = sheets.iter().map(along).max().unwrap_or(0) - least;
        if range == 0 {
            return (f64::INFINITY, range);
        }
        sheets.sort_by_key(|s| (s.of.cell[axis], s.of.cell));
        let halves = sheets.split_at(sheets.len() / 2);
        let bending = |half: &[Sheet<'_>]| {
            let normals: Vec<DVec3> = half.iter().map(|s| s.normal.normalize_or_zero()).collect();
            let mean = normals.iter().sum::<DVec3>() / normals.len().max(1) as f64;
            normals.iter().map(|n| n.distance_squared(mean)).sum::<f64>()
        };
        (bending(halves.0) + bending(halves.1), range)
    };
    let found = [0, 1, 2].map(|axis| spread(axis, sheets));
    let flat = 1e-4 * sheets.len() as f64;
    let longest = (0..3).max_by_key(|&axis| found[axis].1).unwrap_or(0);
    let least = (0..3)
        .min_by(|&a, &b| found[a].0.total_cmp(&found[b].0))
        .unwrap_or(longest);
    // A difference that only rounding or noise makes does not choose.
    if found[least].0 + flat < found[longest].0 {
        least
    } else {
        longest
    }
}

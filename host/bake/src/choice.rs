//! What the requested accuracy demands of one shape's field, and the cells that meet it.
//!
//! The requested accuracy applies where parts fit into one another. Everywhere else, where parts merely collide, errors may be [`ELSEWHERE`] times
//! larger. Interpolation alone allows the largest cell that satisfies every face that fits, every other curved face, and every wall or slot; of the
//! two number formats, the one that then takes fewer bytes is chosen. Where exact surfaces answer nothing is interpolated, and larger cells may do:
//! they are accepted by the measured error of their field ([`crate::field_error`]).

use mortise_brep::Surface;

use crate::accuracy::{
    NEAR_CELLS, REACH_CELLS, face_bend, interpolation_error, is_resolvable, largest_cell, rounding_error,
    step_error,
};
use crate::distance::ExactSurface;
use crate::field_error::FaceError;
use crate::format::{NOT_REACHED, SampleFormat};
use crate::free_form_error::FreeFormError;
use crate::plan::{ELSEWHERE, ShapePlan};
use crate::scene::longest_side;

/// Share of the requested accuracy in fits that the field may use; the rest is the shell's.
const FIELD_SHARE: f64 = 0.75;
/// Share of the requested accuracy that the local patches of free-form faces may use.
pub(crate) const PATCH_SHARE: f64 = 0.5;
/// Share of the accuracy elsewhere that the field may use.
const FIELD_SHARE_ELSEWHERE: f64 = 0.5;
/// Largest error bound of the shell, in cells of interpolation alone: at sharp edges the field's error is that large in any case.
const MOST_EPSILON_CELLS: f64 = 0.5;
/// Measured errors are stated with this margin: between the places measured they may be larger.
const SAFETY: f64 = 1.5;
/// Proved bound of the error of interpolated distances, cells: √3/2 (see [`crate::sign_check`]).
const PROVED_CELLS: f64 = 0.8661;
/// Cells along a shape's longest side from which larger cells are tried, and the factor from one to the next.
const FEWEST_CELLS: f64 = 4.0;
const LADDER: f64 = 1.5;
/// The same for a shape with many faces, times the root of their number.
const CELLS_PER_FACE: f64 = 1.5;
/// Fewest cells along a shape's longest side.
const LEAST_CELLS: f64 = 20.0;
/// Faces with a smaller share of the shape's area are not walls: where they are thin they are treated as edges.
const WALL_AREA: f64 = 0.02;
/// Formats to choose from, with the band used for each, cells.
const FORMATS: [(SampleFormat, f64); 2] = [(SampleFormat::Int16, 2.0), (SampleFormat::Int8, 1.0)];

/// Cells and number format of a shape's field.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choice {
    pub cell_mm: f64,
    pub format: SampleFormat,
    pub band_cells: f64,
    /// Smallest size that the shell resolves, mm: the cell of interpolation alone.
    pub resolution_mm: f64,
    /// Reason why the cell cannot be larger.
    pub why: String,
    /// Faces too sharply curved for the cell.
    pub edges: Vec<u32>,
}

impl Choice {
    /// Distance from the surface up to which errors are bounded, mm.
    pub fn reach_mm(&self) -> f64 {
        NEAR_CELLS * self.resolution_mm
    }
}

/// Requirements of a shape, collected before its model is chosen.
pub(crate) struct Demand {
    name: String,
    size_mm: f64,
    /// Faces that fit another part's: number, curvatures, relative difference of curvatures, description.
    fits: Vec<(u32, [f64; 2], f64, String)>,
    /// Other curved faces: number, curvatures, description.
    others: Vec<(u32, [f64; 2], String)>,
    /// Largest cell that resolves the walls and slots, and its description.
    walls: (f64, String),
    left_out: Vec<u32>,
    flats: Vec<u32>,
    /// Number of faces.
    faces: usize,
    /// Whether any face is free-form.
    free_form: bool,
}

impl Demand {
    /// `fits`: face, relative difference of curvatures, partner's name.
    pub fn new(name: &str, surface: &ExactSurface, fits: &[(u32, f64, String)], left_out: Vec<u32>) -> Self {
        let shape = surface.shape();
        let faces = 0..shape.faces.len() as u32;
        let words = |face: u32| {
            let what = match shape.faces[face as usize].surface {
                Surface::Plane { .. } => "flat".to_owned(),
                Surface::Cylinder { radius, .. } => format!("cylinder of radius {radius:.3} mm"),
                Surface::Cone { .. } => "cone".to_owned(),
                Surface::Sphere { radius, .. } => format!("sphere of radius {radius:.3} mm"),
                Surface::Torus { minor, .. } => format!("torus of tube radius {minor:.3} mm"),
                Surface::Spline => "spline".to_owned(),
            };
            format!("{what} (face {face})")
        };
        let others = faces
            .filter(|&face| !fits.iter().any(|f| f.0 == face) && !left_out.contains(&face))
            .map(|face| (face, face_bend(surface, face), words(face)))
            .filter(|(_, bend, _)| *bend != [0.0; 2])
            .collect();
        Self {
            name: name.to_owned(),
            size_mm: longest_side(shape),
            fits: fits
                .iter()
                .map(|(face, difference, partner)| {
                    let why = format!("{} fits \"{partner}\"", words(*face));
                    (*face, face_bend(surface, *face), *difference, why)
                })
                .collect(),
            others,
            walls: walls(surface, &words),
            left_out,
            faces: shape.faces.len(),
            flats: (0..)
                .zip(&shape.faces)
                .filter(|(_, face)| matches!(face.surface, Surface::Plane { .. }))
                .map(|(number, _)| number)
                .collect(),
            free_form: shape.faces.iter().any(|f| matches!(f.surface, Surface::Spline)),
        }
    }

    /// The coarsest cell of which the interpolation error alone stays within the bounds for an accuracy of `accuracy_mm` in fits.
    pub fn choose(&self, accuracy_mm: f64) -> Choice {
        let models = FORMATS.map(|(format, band)| self.with_format(accuracy_mm, format, band));
        // The number of bricks in the band over the surface is proportional to (8 + 2·band)/cell², and so are their bytes.
        let bytes =
            |m: &Choice| (8.0 + 2.0 * m.band_cells) * m.format.bytes() as f64 / (m.cell_mm * m.cell_mm);
        let [a, b] = models;
        // Beside free-form faces the wider band is needed: gaps there have no other source than the field.
        if bytes(&b) < bytes(&a) && !self.free_form {
            b
        } else {
            a
        }
    }

    /// Cells to try that are larger than those of `finest`, the largest first: where exact surfaces answer, no interpolation limits them.
    pub fn coarser(&self, finest: &Choice) -> Vec<Choice> {
        let cells = std::iter::successors(Some(self.size_mm / self.cells_along()), |cell| {
            Some(cell / LADDER)
        });
        cells
            .take_while(|&cell| cell > finest.cell_mm * 1.05)
            .map(|cell_mm| self.larger(cell_mm, finest))
            .collect()
    }

    /// Still larger cells, for the smallest field whatever its error, and the largest of [`Self::coarser`].
    pub fn coarsest(&self, finest: &Choice) -> Vec<Choice> {
        let ends = self.size_mm / self.cells_along();
        let cells = std::iter::successors(Some(ends), |cell| Some(cell * LADDER));
        cells
            .take_while(|&cell| cell <= self.size_mm / FEWEST_CELLS * (1.0 + 1e-9))
            .map(|cell_mm| self.larger(cell_mm, finest))
            .collect()
    }

    /// Cells along the longest side from which fields are tried: faces are typically as far apart as one over the root of their number, and larger
    /// cells would meet more of them than a group names.
    fn cells_along(&self) -> f64 {
        (CELLS_PER_FACE * (self.faces as f64).sqrt()).max(FEWEST_CELLS)
    }

    /// A cell larger than the finest. Few samples are interpolated in it, so the shorter format costs no accuracy.
    fn larger(&self, cell_mm: f64, finest: &Choice) -> Choice {
        let (format, band_cells) = FORMATS[usize::from(!self.free_form)];
        Choice {
            cell_mm,
            format,
            band_cells,
            resolution_mm: finest.cell_mm,
            why: "its faces, which answer in every cell".to_owned(),
            edges: finest.edges.clone(),
        }
    }

    fn with_format(&self, accuracy: f64, format: SampleFormat, band_cells: f64) -> Choice {
        let base = |h: f64| step_error(h, band_cells, format) + rounding_error(self.size_mm);
        let mut cell = self.walls.0;
        let mut why = self.walls.1.clone();
        let mut take = |most: f64, reason: &dyn Fn() -> String| {
            if most < cell {
                cell = most;
                why = reason();
            }
        };
        // Flats fit flats: only the quantisation step matters there.
        take(largest_cell(self.walls.0, FIELD_SHARE * accuracy, base), &|| {
            "a step of the number format on its flats".to_owned()
        });
        for (_, bend, _, words) in &self.fits {
            let error = |h: f64| interpolation_error(h, *bend) + base(h);
            take(largest_cell(self.walls.0, FIELD_SHARE * accuracy, error), &|| {
                words.clone()
            });
        }
        let elsewhere = ELSEWHERE * accuracy;
        let mut edges = Vec::new();
        for (face, bend, words) in &self.others {
            if !is_resolvable(FIELD_SHARE_ELSEWHERE * elsewhere, *bend) {
                edges.push(*face);
                continue;
            }
            let error = |h: f64| interpolation_error(h, *bend) + base(h);
            take(
                largest_cell(self.walls.0, FIELD_SHARE_ELSEWHERE * elsewhere, error),
                &|| format!("{words}, which fits nothing"),
            );
        }
        Choice {
            cell_mm: cell,
            format,
            band_cells,
            resolution_mm: cell,
            why,
            edges,
        }
    }

    /// Whether parts can touch this face: it is neither left out nor too sharp for the cells of `choice`.
    fn counts(&self, face: u32, choice: &Choice) -> bool {
        !self.left_out.contains(&face) && !choice.edges.contains(&face)
    }

    /// Whether the face fits another part's. Flats fit flats.
    fn is_fit(&self, face: u32) -> bool {
        self.flats.contains(&face) || self.fits.iter().any(|fit| fit.0 == face)
    }

    /// Largest field error that an accuracy in fits allows at a face, mm.
    fn allowed_mm(&self, face: u32, accuracy_mm: f64) -> f64 {
        if self.is_fit(face) {
            FIELD_SHARE * accuracy_mm
        } else {
            FIELD_SHARE_ELSEWHERE * ELSEWHERE * accuracy_mm
        }
    }

    /// Bound of the field's error at a face away from other faces, mm: of the surfaces' rounding, where they answer, and of interpolation only where
    /// it takes place.
    fn bound_mm(&self, face: u32, choice: &Choice, found: &FaceError) -> f64 {
        let rounding = rounding_error(self.size_mm);
        let by_surfaces = SAFETY * found.by_surfaces_mm + rounding;
        let Some(measured) = found.interpolated_mm else {
            return by_surfaces;
        };
        let bend = (self.fits.iter().map(|fit| (fit.0, fit.1)))
            .chain(self.others.iter().map(|other| (other.0, other.1)))
            .find(|(other, _)| *other == face)
            .map_or([0.0; 2], |(_, bend)| bend);
        let by_curvature = interpolation_error(choice.cell_mm, bend)
            + step_error(choice.cell_mm, choice.band_cells, choice.format)
            + rounding;
        let interpolated = if by_curvature.is_finite() && measured <= by_curvature {
            by_curvature
        } else {
            SAFETY * measured
        };
        by_surfaces.max(interpolated)
    }

    /// By how many times the tolerance of local patches a field may err near each face, for [`crate::FieldOptions::finer`].
    pub fn factors(&self) -> Vec<f64> {
        let factor = |face: u32| {
            if self.left_out.contains(&face) {
                NOT_REACHED
            } else if self.is_fit(face) {
                1.0
            } else {
                FIELD_SHARE_ELSEWHERE * ELSEWHERE / FIELD_SHARE
            }
        };
        (0..self.faces as u32).map(factor).collect()
    }

    /// Largest measured error of a field over what `accuracy_mm` in fits allows it there, away from edges and at them: both at most 1 where it is
    /// accurate enough.
    pub fn excess(
        &self,
        accuracy_mm: f64,
        choice: &Choice,
        found: &[FaceError],
        free_form: &FreeFormError,
    ) -> [f64; 2] {
        let elsewhere = FIELD_SHARE_ELSEWHERE * ELSEWHERE * accuracy_mm;
        let mut away =
            (free_form.worst_mm() / (FIELD_SHARE * accuracy_mm)).max(free_form.elsewhere_mm / elsewhere);
        let mut at_edges = free_form.at_edges_mm / elsewhere;
        for (face, error) in (0..).zip(found) {
            if self.left_out.contains(&face) {
                continue;
            }
            let allowed = self.allowed_mm(face, accuracy_mm);
            if self.counts(face, choice) {
                away = away.max(self.bound_mm(face, choice, error) / allowed);
            }
            let edge = SAFETY * error.at_edges_mm.unwrap_or(0.0);
            at_edges = at_edges.max(edge.max(self.bound_mm(face, choice, error)) / allowed);
        }
        [away, at_edges]
    }

    /// The model of `choice` with the errors measured of its field, and the shell that they leave room for. Where they
    /// exceed what the accuracy `trusted_mm` in fits allows, at least what is proved of interpolated cells of up to `rough_mm` near the surface is stated:
    /// a few of them may err by far more than all places measured.
    pub fn state(
        &self,
        accuracy_mm: f64,
        choice: &Choice,
        found: &[FaceError],
        (free_form, rough_mm): (&FreeFormError, f64),
        trusted_mm: f64,
    ) -> ShapePlan {
        let is_trusted =
            (self.excess(trusted_mm, choice, found, free_form).iter()).all(|excess| *excess <= 1.0);
        let least = if is_trusted {
            0.0
        } else {
            PROVED_CELLS * rough_mm
                + step_error(choice.cell_mm, choice.band_cells, choice.format)
                + rounding_error(self.size_mm)
        };
        let elsewhere = ELSEWHERE * accuracy_mm;
        let bounds: Vec<(u32, f64)> = ((0..).zip(found))
            .filter(|(face, _)| self.counts(*face, choice))
            .map(|(face, error)| {
                let bound = self.bound_mm(face, choice, error);
                let bound = bound.max(SAFETY * error.at_edges_mm.unwrap_or(0.0));
                let is_small = bound <= self.allowed_mm(face, trusted_mm);
                (face, if is_small { bound } else { bound.max(least) })
            })
            .collect();
        let most = |of: &dyn Fn(u32) -> bool| {
            let of = bounds.iter().filter(|(face, _)| of(*face));
            of.map(|(_, bound)| *bound).fold(free_form.worst_mm(), f64::max)
        };
        let in_fits = most(&|face| self.is_fit(face));
        let field = most(&|_| true).max(free_form.elsewhere_mm);
        let at_edges = found.iter().filter_map(|error| error.at_edges_mm);
        let at_edges = SAFETY * at_edges.fold(free_form.at_edges_mm / SAFETY, f64::max);
        let at_edges = if at_edges > 0.0 { at_edges.max(least) } else { 0.0 };
        // The shell gets the share that the field leaves, and half of it at least where the field needs more than its own.
        let left = (elsewhere - field).max(FIELD_SHARE_ELSEWHERE * elsewhere);
        let difference = self.fits.iter().map(|f| f.2).fold(0.0, f64::max);
        let mut epsilon = left.min(MOST_EPSILON_CELLS * choice.resolution_mm);
        if difference > 0.0 {
            epsilon =
                epsilon.min((accuracy_mm - in_fits).max((1.0 - FIELD_SHARE) * accuracy_mm) / difference);
        }
        ShapePlan {
            name: self.name.clone(),
            cell_mm: choice.cell_mm,
            format: choice.format,
            band_cells: choice.band_cells,
            reach_mm: choice.reach_mm(),
            epsilon_mm: epsilon,
            crossing_epsilon_mm: epsilon,
            field_error_in_fits_mm: in_fits,
            shell_error_in_fits_mm: epsilon * difference,
            error_elsewhere_mm: field + epsilon,
            error_at_edges_mm: at_edges,
            faces_that_fit: faces_that_fit(&self.fits),
            faces_taken_as_edges: choice.edges.clone(),
            faces_left_out: self.left_out.clone(),
            why: choice.why.clone(),
        }
    }
}

fn faces_that_fit(fits: &[(u32, [f64; 2], f64, String)]) -> Vec<u32> {
    let mut faces: Vec<u32> = fits.iter().map(|f| f.0).collect();
    faces.sort_unstable();
    faces.dedup();
    faces
}

/// Largest cell that still resolves the walls and slots beside the larger faces: no corner of a cell near one surface may be nearer to another. Their
/// width is measured from the middle of each face's largest triangle, inward and outward, by bisection.
fn walls(surface: &ExactSurface, words: &dyn Fn(u32) -> String) -> (f64, String) {
    let shape = surface.shape();
    let size = longest_side(shape);
    let mut best = (
        size / LEAST_CELLS,
        format!("{LEAST_CELLS} cells along its longest side"),
    );
    let total: f64 = shape.faces.iter().map(|f| f.area_mm2).sum();
    for (face, of) in shape.faces.iter().enumerate() {
        // Beside free-form faces the field's error is measured.
        if of.area_mm2 < WALL_AREA * total || matches!(of.surface, Surface::Spline) {
            continue;
        }
        let area = |t: usize| {
            let [a, b, c] = surface.triangles.corners(t as u32);
            (b - a).cross(c - a).length()
        };
        let own = (0..shape.mesh.triangles.len()).filter(|&t| shape.mesh.triangle_face[t] as usize == face);
        let Some(t) = own.max_by(|&s, &t| area(s).total_cmp(&area(t))) else {
            continue;
        };
        let [a, b, c] = surface.triangles.corners(t as u32);
        let Some(at) = surface.nearest((a + b + c) / 3.0) else {
            continue;
        };
        let normal = surface.topology.outward(shape, t as u32, at.point);
        for (side, what) in [(-1.0, "wall"), (1.0, "slot")] {
            let mut cell = best.0;
            let clear = |cell: f64| {
                let depth = REACH_CELLS * cell;
                surface
                    .nearest(at.point + normal * side * depth)
                    .is_some_and(|n| n.distance.abs() > 0.99 * depth)
            };
            while cell > size / 1000.0 && !clear(cell) {
                cell *= 0.8;
            }
            if cell < best.0 {
                best = (cell, format!("{what} at {}", words(face as u32)));
            }
        }
    }
    best
}

//! The coarsest model of one shape that meets the requested accuracy.
//!
//! The requested accuracy applies where parts fit into one another. Everywhere else, where parts merely collide, errors may be [`ELSEWHERE`] times
//! larger. The cell is the largest one that satisfies every face that fits, every other curved face, and every wall or slot; of the two number
//! formats, the one that then takes fewer bytes is chosen.

use mortise_brep::Surface;

use crate::accuracy::{
    REACH_CELLS, face_bend, interpolation_error, is_resolvable, largest_cell, rounding_error, step_error,
};
use crate::distance::ExactSurface;
use crate::format::SampleFormat;
use crate::plan::ShapePlan;
use crate::scene::longest_side;

/// Factor by which errors may be larger on faces that fit nothing.
pub const ELSEWHERE: f64 = 10.0;
/// Share of the requested accuracy in fits that the field may use; the rest is the shell's.
pub(crate) const FIELD_SHARE: f64 = 0.75;
/// Share of the requested accuracy that the local patches of free-form faces may use.
pub(crate) const PATCH_SHARE: f64 = 0.5;
/// Share of the accuracy elsewhere that the field may use.
const FIELD_SHARE_ELSEWHERE: f64 = 0.5;
/// Largest error bound of the shell, in cells: at sharp edges the field's error is that large in any case.
const MOST_EPSILON_CELLS: f64 = 0.5;
/// Fewest cells along a shape's longest side.
const LEAST_CELLS: f64 = 20.0;
/// Faces with a smaller share of the shape's area are not walls: where they are thin they are treated as edges.
const WALL_AREA: f64 = 0.02;
/// Formats to choose from, with the band used for each, cells.
const FORMATS: [(SampleFormat, f64); 2] = [(SampleFormat::Int16, 2.0), (SampleFormat::Int8, 1.0)];

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
            free_form: shape.faces.iter().any(|f| matches!(f.surface, Surface::Spline)),
        }
    }

    /// The model for an accuracy of `accuracy_mm` in fits.
    pub fn choose(&self, accuracy_mm: f64) -> ShapePlan {
        let models = FORMATS.map(|(format, band)| self.with_format(accuracy_mm, format, band));
        // The number of bricks in the band over the surface is proportional to (8 + 2·band)/cell², and so are their bytes.
        let bytes =
            |m: &ShapePlan| (8.0 + 2.0 * m.band_cells) * m.format.bytes() as f64 / (m.cell_mm * m.cell_mm);
        let [a, b] = models;
        // Beside free-form faces the wider band is needed: gaps there have no other source than the field.
        if bytes(&b) < bytes(&a) && !self.free_form {
            b
        } else {
            a
        }
    }

    fn with_format(&self, accuracy: f64, format: SampleFormat, band: f64) -> ShapePlan {
        let base = |h: f64| step_error(h, band, format) + rounding_error(self.size_mm);
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
        let worst = |bends: &mut dyn Iterator<Item = [f64; 2]>| {
            let errors = bends.map(|bend| interpolation_error(cell, bend));
            errors.filter(|e| e.is_finite()).fold(0.0, f64::max) + base(cell)
        };
        let resolved = self.others.iter().map(|o| o.1);
        let resolved = resolved.filter(|b| is_resolvable(FIELD_SHARE_ELSEWHERE * elsewhere, *b));
        let patches = if self.free_form {
            PATCH_SHARE * accuracy
        } else {
            0.0
        };
        let in_fits = worst(&mut self.fits.iter().map(|f| f.1)).max(patches);
        let field = worst(&mut self.fits.iter().map(|f| f.1).chain(resolved));
        // The shell gets the share that the field leaves.
        let difference = self.fits.iter().map(|f| f.2).fold(0.0, f64::max);
        let mut epsilon = (elsewhere - field).min(MOST_EPSILON_CELLS * cell);
        if difference > 0.0 {
            epsilon = epsilon.min((accuracy - in_fits) / difference);
        }
        ShapePlan {
            name: self.name.clone(),
            cell_mm: cell,
            format,
            band_cells: band,
            epsilon_mm: epsilon,
            crossing_epsilon_mm: epsilon,
            field_error_in_fits_mm: in_fits,
            shell_error_in_fits_mm: epsilon * difference,
            error_elsewhere_mm: field + epsilon,
            error_at_edges_mm: 0.0,
            faces_that_fit: faces_that_fit(&self.fits),
            faces_taken_as_edges: edges,
            faces_left_out: self.left_out.clone(),
            why,
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

//! Measured error of a field, face by face, as the board evaluates it.
//!
//! Places are spread evenly over every face and along every edge, at offsets up to a given reach, half of them within an eighth of it. At each
//! place the board's own query of the packed field is compared with the exact distance. Where the board's distance is by design only a bound (outside
//! a convex edge, inside a re-entrant one), only what exceeds the bound counts.
//!
//! Cost: one exact query for each place, a few microseconds; nine where the distance is interpolated.

use glam::{DAffine3, DVec3};
use mortise_haptics::{Rendered, Vec3, rendered_distance};
use mortise_protocol::image::{Nearby, SceneImage, Shape};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::distance::{ExactSurface, Scratch};
use crate::field::BakedField;
use crate::image::{ImageBuilder, PartPlacement};
use crate::rule::SAME_MM;
use crate::shell::Pointshell;

/// Places for each square cell of a face's area, and for each cell along an edge.
const PER_CELL: f64 = 4.0;
/// Places on a small face or edge: errors of large cells vary with the faces, not with the cells. Fewest of them where all would be too many.
const FEWEST: f64 = 128.0;
const FEWEST_OF_MANY: usize = 24;
/// Most places of a shape, about.
const MOST: f64 = 20_000.0;
/// Most places on one face or edge.
const MOST_OF_ONE: f64 = 4_000.0;

/// Largest errors near one face, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct FaceError {
    /// Where surfaces give the distance.
    pub by_surfaces_mm: f64,
    /// Where the distance is interpolated and all points within a cell have this face nearest; `None` where there is no such place.
    pub interpolated_mm: Option<f64>,
    /// Where the distance is interpolated within a cell of another face; `None` where there is no such place.
    pub at_edges_mm: Option<f64>,
}

impl FaceError {
    fn and(self, other: Self) -> Self {
        let larger = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (one, none) => one.or(none),
        };
        Self {
            by_surfaces_mm: self.by_surfaces_mm.max(other.by_surfaces_mm),
            interpolated_mm: larger(self.interpolated_mm, other.interpolated_mm),
            at_edges_mm: larger(self.at_edges_mm, other.at_edges_mm),
        }
    }
}

/// Errors of `field` within `reach_mm` of each face of `surface`.
pub(crate) fn field_errors(surface: &ExactSurface, field: &BakedField, reach_mm: f64) -> Vec<FaceError> {
    let shape = surface.shape();
    let cell_mm = f64::from(field.record.cell) * 1000.0;
    let mut builder = ImageBuilder::new();
    let (number, _) = builder.add_shape(shape, field.clone(), &Pointshell::default(), &[], false);
    builder.add_part(&PartPlacement {
        shape: number,
        placement: DAffine3::IDENTITY,
        grabbable: true,
    });
    let bytes = builder.finish();
    // Aligned as in flash.
    let mut words = vec![0u32; bytes.len().div_ceil(4)];
    bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..bytes.len()].copy_from_slice(&bytes);
    let none = || vec![FaceError::default(); shape.faces.len()];
    let Ok(image) = SceneImage::open(&bytemuck::cast_slice(&words)[..bytes.len()]) else {
        // The builder's own image opens; without one every place would err.
        return vec![
            FaceError {
                by_surfaces_mm: f64::INFINITY,
                ..FaceError::default()
            };
            shape.faces.len()
        ];
    };
    let board = image.shape(0);
    let measure = Measure {
        surface,
        board,
        cell_mm,
        reach_mm,
    };
    let lines = lines(surface, cell_mm);
    (lines.par_iter())
        .map(|line| {
            let mut found = none();
            measure.along(line, &mut found);
            found
        })
        .reduce(none, |a, b| a.into_iter().zip(b).map(|(a, b)| a.and(b)).collect())
}

/// Triangles of a face, or segments of an edge, with their cumulative area or length, and the number of places on them.
struct Line {
    corners: Vec<[DVec3; 3]>,
    cumulative: Vec<f64>,
    places: usize,
}

impl Line {
    fn new(corners: Vec<[DVec3; 3]>, sizes: impl Iterator<Item = f64>, size_of_cell: f64) -> Option<Self> {
        let cumulative: Vec<f64> = sizes
            .scan(0.0, |sum, size| {
                *sum += size;
                Some(*sum)
            })
            .collect();
        let all = cumulative.last().copied().filter(|all| *all > 0.0)?;
        let places = (PER_CELL * all / size_of_cell).clamp(FEWEST, MOST_OF_ONE) as usize;
        Some(Self {
            corners,
            cumulative,
            places,
        })
    }

    /// Place for numbers from 0 to 1.
    fn at(&self, [which, x, y]: [f64; 3]) -> DVec3 {
        let all = self.cumulative.last().copied().unwrap_or(0.0);
        let index = self.cumulative.partition_point(|&sum| sum < which * all);
        let [a, b, c] = self.corners[index.min(self.corners.len() - 1)];
        let (x, y) = if x + y > 1.0 { (1.0 - x, 1.0 - y) } else { (x, y) };
        a + (b - a) * x + (c - a) * y
    }
}

fn lines(surface: &ExactSurface, cell_mm: f64) -> Vec<Line> {
    let shape = surface.shape();
    let mesh = &shape.mesh;
    let mut faces: Vec<Vec<[DVec3; 3]>> = vec![Vec::new(); shape.faces.len()];
    for (triangle, &face) in mesh.triangles.iter().zip(&mesh.triangle_face) {
        faces[face as usize].push(triangle.map(|v| mesh.vertices[v as usize]));
    }
    let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
    let faces = faces.into_iter().filter_map(|corners| {
        let sizes: Vec<f64> = corners.iter().map(|&t| area(t)).collect();
        Line::new(corners, sizes.into_iter(), cell_mm * cell_mm)
    });
    let edges = shape.edges.iter().filter_map(|edge| {
        let pairs = edge.polyline.windows(2);
        let corners: Vec<[DVec3; 3]> = pairs.map(|pair| [pair[0], pair[1], pair[0]]).collect();
        let sizes: Vec<f64> = corners.iter().map(|[a, b, _]| a.distance(*b)).collect();
        Line::new(corners, sizes.into_iter(), cell_mm)
    });
    let mut all: Vec<Line> = faces.chain(edges).collect();
    let places: usize = all.iter().map(|line| line.places).sum();
    let share = MOST / places as f64;
    if share < 1.0 {
        for line in &mut all {
            line.places = ((line.places as f64 * share) as usize).max(FEWEST_OF_MANY);
        }
    }
    all
}

struct Measure<'a> {
    surface: &'a ExactSurface,
    board: Shape<'a>,
    cell_mm: f64,
    reach_mm: f64,
}

impl Measure<'_> {
    /// Measures the places of a face or edge.
    fn along(&self, line: &Line, found: &mut [FaceError]) {
        let mut scratch = Scratch::default();
        for i in 0..line.places {
            // Additive recurrences of irrational steps (R-sequence in seven dimensions, Roberts 2018): evenly spread.
            let r = |step: f64| ((i as f64 + 0.5) * step).fract();
            let on = line.at([r(0.911_592), r(0.831_000), r(0.757_533)]);
            let way = [0.690_561, 0.629_510, 0.573_856].map(|step| 2.0 * r(step) - 1.0);
            // The cube keeps half of the places within an eighth of the reach.
            let aside = DVec3::from_array(way).normalize_or_zero() * self.reach_mm * r(0.523_123).powi(3);
            self.place(on + aside, &mut scratch, found);
        }
    }

    fn place(&self, p: DVec3, scratch: &mut Scratch, found: &mut [FaceError]) {
        // The place as the board receives it.
        let at = (p / 1000.0).as_vec3();
        let p = at.as_dvec3() * 1000.0;
        let Some(nearest) = self.surface.query(p, f64::INFINITY, scratch) else {
            return;
        };
        if nearest.distance.abs() > self.reach_mm {
            return;
        }
        let Some(own) = found.get_mut(nearest.face as usize) else {
            return;
        };
        let Some(rendered) = rendered_distance(&self.board, Vec3::from_array(at.to_array())) else {
            own.by_surfaces_mm = f64::INFINITY;
            return;
        };
        let off = error(&rendered, nearest.distance);
        if !rendered.interpolated {
            own.by_surfaces_mm = own.by_surfaces_mm.max(off);
            return;
        }
        let mut alone = (0..8).map(|k| {
            let side = DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * 2.0 - 1.0;
            let other = (self.surface).query(p + side * self.cell_mm, f64::INFINITY, scratch);
            other.is_some_and(|other| other.face == nearest.face)
        });
        let worst = if alone.all(|same| same) {
            &mut own.interpolated_mm
        } else {
            &mut own.at_edges_mm
        };
        *worst = Some(worst.unwrap_or(0.0).max(off));
    }
}

/// Error of the board's distance where the exact one is `exact`, mm.
fn error(rendered: &Rendered, exact: f64) -> f64 {
    let distance = f64::from(rendered.distance) * 1000.0;
    let off = (distance - exact).abs();
    let (group, sign) = match rendered.nearby {
        _ if rendered.interpolated => return off,
        Nearby::Convex(group) => (group, 1.0),
        Nearby::Reentrant(group) => (group, -1.0),
        _ => return off,
    };
    let is_bound = if group.is_plain() {
        sign * exact > SAME_MM
    } else {
        exact.abs() > SAME_MM
    };
    if is_bound && distance * exact >= 0.0 {
        (distance.abs() - exact.abs()).max(0.0)
    } else {
        off
    }
}

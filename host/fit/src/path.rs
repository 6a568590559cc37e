//! The way in: the motion along which a fit is reached without overlap.
//!
//! Directions come from the mobility of the mating faces: the cone of free translations, and the motions that they leave free (a screw's twist). Each
//! is swept outward in steps until the solids are apart, with the exact distance of samples and edge points of both at each step; the way that keeps
//! the largest clearance is reported, the shorter one of equals. Between two steps, and between samples, nothing is proven.

use std::f64::consts::TAU;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_brep::Surface;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3, Vector6};

use crate::gaps::Pair;
use crate::mobility::Cone;
use crate::refine::Refined;

/// Kind of a way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathKind {
    /// One straight line.
    Line,
    /// A turn about an axis with a travel along it.
    Screw,
    /// Two straight lines.
    Polyline,
}

/// The way in, in the assembly's frame.
#[derive(Clone, Debug)]
pub struct Path {
    /// Kind of the motion.
    pub kind: PathKind,
    /// Unit direction of the last straight line, or of a screw's axis, in which the part moves while it goes in.
    pub direction: DVec3,
    /// Length of the way, mm: of a screw, its travel along the axis.
    pub length_mm: f64,
    /// Smallest clearance found on the way, mm; negative by at most the tolerated overlap.
    pub smallest_clearance_mm: f64,
    /// Corners of the way from outside to the fit, as displacements from the fit, mm; of a screw empty.
    pub corners_mm: Vec<DVec3>,
    /// Point on a screw's axis, mm, and its pitch, mm a turn, positive for a right-hand thread.
    pub screw: Option<(DVec3, f64)>,
    /// Point on the axis along `direction` about which the mating faces leave the part free to turn, mm; `None` where they do not.
    pub spin: Option<DVec3>,
    /// Whether the mating faces hold the part along the way once it is in.
    pub ends: bool,
    /// Pairs of mating faces, of the moving part and of the other, that slide along each other on the last straight line, the largest area first.
    pub sliding: Vec<[u32; 2]>,
}

impl Path {
    /// A way of this kind, of which what the mating faces leave free is not known yet.
    fn new(kind: PathKind, direction: DVec3, length_mm: f64, smallest_clearance_mm: f64) -> Self {
        Self {
            kind,
            direction,
            length_mm,
            smallest_clearance_mm,
            corners_mm: Vec::new(),
            screw: None,
            spin: None,
            ends: true,
            sliding: Vec::new(),
        }
    }

    /// Takes from the mating faces what they leave free, and which of them slide.
    fn learn(&mut self, fit: &Refined) {
        if self.kind == PathKind::Screw {
            return;
        }
        let d = self.direction;
        self.spin = spin(fit, d);
        self.ends = !leaves_slide(fit, d);
        let mut pairs: Vec<([u32; 2], f64, bool)> = Vec::new();
        for gap in &fit.mating {
            let slides = gap.away.dot(d).abs() < ALONG_WALL;
            match pairs.iter_mut().find(|(faces, ..)| *faces == gap.faces) {
                Some((_, area, all)) => {
                    *area += gap.area;
                    *all &= slides;
                }
                None => pairs.push((gap.faces, gap.area, slides)),
            }
        }
        pairs.retain(|(.., all)| *all);
        pairs.sort_by(|a, b| b.1.total_cmp(&a.1));
        self.sliding = pairs.into_iter().map(|(faces, ..)| faces).collect();
    }
}

/// Steps of a straight line, and directions tried.
const STEPS: usize = 48;
const MOST_DIRECTIONS: usize = 14;
/// Step of a screw, rad, and turns at most.
const SCREW_STEP: f64 = 0.1;
const MOST_TURNS: f64 = 12.0;
/// Clearances within this are equal, mm.
const SAME_CLEARANCE_MM: f64 = 1e-3;
/// Cosine between a wall's normal and the way below which the faces slide along each other.
const ALONG_WALL: f64 = 0.02;
/// Largest remainder of a motion that counts as free.
const FREE: f64 = 0.02;
/// Samples taken at a step: one in so many.
const STRIDE: usize = 4;
/// Points measured on the exact surfaces at a step: those nearest by the facets.
const MEASURED: usize = 24;

/// The way in to a refined fit, in the fixed solid's frame; `overlap` mm is tolerated. `known` are ways out that led to other fits: one that serves
/// here too is taken at once.
pub(crate) fn way_in(
    pair: &Pair<'_>,
    fit: &Refined,
    clearance: f64,
    overlap: f64,
    known: &[DVec3],
) -> Option<Path> {
    let enough = clearance.min(0.0) - overlap;
    let line = |out: DVec3| -> Option<Path> {
        let out = along_walls(fit, out);
        let length = apart(pair, &fit.pose, out);
        let smallest = swept(pair, &fit.pose, out, length, enough)?.min(clearance);
        let mut path = Path::new(PathKind::Line, -out, length, smallest);
        path.corners_mm = vec![length * out, DVec3::ZERO];
        Some(path)
    };
    let full = |path: &Path| path.smallest_clearance_mm > clearance - SAME_CLEARANCE_MM;
    let learnt = |mut path: Path| {
        path.learn(fit);
        path
    };
    if let Some(path) = known.iter().filter_map(|&out| line(out)).find(full) {
        return Some(learnt(path));
    }
    let cone = Cone::new(&fit.mating);
    let directions = cone.candidates(&suggested(pair, fit));
    let mut best: Option<Path> = None;
    for &out in directions.iter().take(MOST_DIRECTIONS) {
        let Some(path) = line(out) else {
            continue;
        };
        let better = best.as_ref().is_none_or(|known| {
            let more = path.smallest_clearance_mm - known.smallest_clearance_mm;
            more > SAME_CLEARANCE_MM || more > -SAME_CLEARANCE_MM && path.length_mm < known.length_mm - 1e-3
        });
        if better {
            best = Some(path);
        }
    }
    best.or_else(|| screw(pair, fit, clearance, enough))
        .or_else(|| two_lines(pair, fit, &cone, &directions, clearance, enough))
        .map(learnt)
}

/// Directions that the geometry suggests: normals and axes of the mating faces, and translations among the free motions.
fn suggested(pair: &Pair<'_>, fit: &Refined) -> Vec<DVec3> {
    let mut out: Vec<DVec3> = Vec::new();
    let mut add = |d: DVec3| {
        if out.len() < 24 && out.iter().all(|known| known.cross(d).length() > 1e-3) {
            out.push(d);
        }
    };
    free_directions(fit).into_iter().for_each(&mut add);
    let mut faces: Vec<u32> = fit.mating.iter().map(|gap| gap.faces[1]).collect();
    faces.sort_unstable();
    faces.dedup();
    for face in faces {
        match pair.fixed.exact.shape().faces[face as usize].surface {
            Surface::Plane { frame }
            | Surface::Cylinder { frame, .. }
            | Surface::Cone { frame, .. }
            | Surface::Torus { frame, .. } => add(frame.z),
            Surface::Sphere { .. } | Surface::Spline => {}
        }
    }
    out
}

/// Translations among the motions that the faces leave free.
fn free_directions(fit: &Refined) -> Vec<DVec3> {
    (fit.free.iter())
        .filter_map(|twist| {
            let (turn, shift) = (
                DVec3::new(twist[0], twist[1], twist[2]),
                DVec3::new(twist[3], twist[4], twist[5]),
            );
            // A slide and a spin about the same axis come mixed; the slide is along both.
            let d = if shift.length() > 0.05 { shift } else { turn };
            d.try_normalize()
        })
        .collect()
}

/// The direction next to `out` that runs along the walls: the one across the normals of all mating faces that nearly are. Normals and axes of faces are
/// exact, but free-form walls have neither, and a thousandth of a radian is the clearance of a close fit over its length.
fn along_walls(fit: &Refined, out: DVec3) -> DVec3 {
    let mut sum = Matrix3::<f64>::zeros();
    for gap in fit
        .mating
        .iter()
        .filter(|gap| gap.away.dot(out).abs() < ALONG_WALL)
    {
        let n = Vector3::new(gap.away.x, gap.away.y, gap.away.z);
        sum += gap.area * n * n.transpose();
    }
    let eigen = sum.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let v = eigen.eigenvectors.column(order[0]);
    let v = DVec3::new(v[0], v[1], v[2]);
    let along = v * v.dot(out).signum();
    // Walls across one direction alone leave the other open.
    let is_sure = eigen.eigenvalues[order[1]] > 0.01 * eigen.eigenvalues[order[2]];
    if is_sure && along.distance(out) < ALONG_WALL {
        along
    } else {
        out
    }
}

/// Travel along `out` after which the boxes of the samples are apart, mm.
fn apart(pair: &Pair<'_>, pose: &DAffine3, out: DVec3) -> f64 {
    let far = (pair.fixed.exact.shape().mesh.vertices.iter())
        .map(|p| p.dot(out))
        .fold(f64::NEG_INFINITY, f64::max);
    let near = (pair.moving.exact.shape().mesh.vertices.iter())
        .map(|&p| pose.transform_point3(p).dot(out))
        .fold(f64::INFINITY, f64::min);
    (far - near).max(0.0) + 0.02 * pair.moving.size()
}

/// Smallest clearance of a straight line, `None` where it falls below `enough`.
fn swept(pair: &Pair<'_>, pose: &DAffine3, out: DVec3, length: f64, enough: f64) -> Option<f64> {
    let mut smallest = f64::INFINITY;
    // The end, a quarter and the middle first: a blocked way ends early.
    let order = |k: usize| (k * 29) % STEPS + 1;
    for k in 0..STEPS {
        let share = order(k) as f64 / STEPS as f64;
        let there = DAffine3::from_translation(share * length * out) * *pose;
        smallest = smallest.min(pair.least(&there, STRIDE, MEASURED, enough));
        if smallest < enough {
            return None;
        }
    }
    Some(smallest)
}

/// Two straight lines: a slide along a free direction, then out along another.
fn two_lines(
    pair: &Pair<'_>,
    fit: &Refined,
    cone: &Cone,
    directions: &[DVec3],
    clearance: f64,
    enough: f64,
) -> Option<Path> {
    let turns: Vec<DVec3> = DVec3::AXES.iter().flat_map(|&d| [d, -d]).collect();
    for &first in directions.iter().take(6) {
        let length = apart(pair, &fit.pose, first);
        let mut smallest = f64::INFINITY;
        for k in 1..=16 {
            let slide = f64::from(k) / 16.0 * length;
            let there = DAffine3::from_translation(slide * first) * fit.pose;
            smallest = smallest.min(pair.least(&there, STRIDE, MEASURED, enough));
            if smallest < enough {
                break;
            }
            for &second in turns.iter().filter(|d| !cone.holds(**d)) {
                let rest = apart(pair, &there, second);
                let Some(then) = swept(pair, &there, second, rest, enough) else {
                    continue;
                };
                let Some(before) = swept(pair, &fit.pose, first, slide, enough) else {
                    continue;
                };
                let smallest = then.min(before).min(clearance);
                let mut path = Path::new(PathKind::Polyline, -first, slide + rest, smallest);
                path.corners_mm = vec![slide * first + rest * second, slide * first, DVec3::ZERO];
                return Some(path);
            }
        }
    }
    None
}

/// A screw: the motion that opens all gaps, or the only free one, either way round.
fn screw(pair: &Pair<'_>, fit: &Refined, clearance: f64, enough: f64) -> Option<Path> {
    let mut twists: Vec<Vector6<f64>> = fit.opening.into_iter().collect();
    if let [twist] = fit.free.as_slice() {
        twists.extend([*twist, -twist]);
    }
    (twists.iter()).find_map(|twist| along_screw(pair, fit, twist, clearance, enough))
}

fn along_screw(
    pair: &Pair<'_>,
    fit: &Refined,
    twist: &Vector6<f64>,
    clearance: f64,
    enough: f64,
) -> Option<Path> {
    let turn = DVec3::new(twist[0], twist[1], twist[2]) / fit.length;
    let shift = DVec3::new(twist[3], twist[4], twist[5]);
    let rate = turn.length();
    if rate * fit.length < 0.01 * twist.norm() {
        return None;
    }
    let axis = turn / rate;
    let pitch = shift.dot(axis) / rate * TAU;
    let point = fit.center + turn.cross(shift) / (rate * rate);
    if pitch.abs() < 1e-2 * fit.length {
        return None;
    }
    let out = axis * pitch.signum();
    let length = apart(pair, &fit.pose, out);
    let angle = length / pitch.abs() * TAU;
    if angle > MOST_TURNS * TAU {
        return None;
    }
    let steps = ((angle / SCREW_STEP).ceil() as usize).max(STEPS);
    let mut smallest = clearance;
    for k in 1..=steps {
        // Mixed, so that a blocked way ends early.
        let share = ((k * 7919) % steps + 1) as f64 / steps as f64;
        let rotation = DMat3::from_quat(DQuat::from_axis_angle(axis, share * angle));
        let moved =
            DAffine3::from_mat3_translation(rotation, point + share * length * out - rotation * point);
        smallest = smallest.min(pair.least(&(moved * fit.pose), 2 * STRIDE, MEASURED, enough));
        if smallest < enough {
            return None;
        }
    }
    let mut path = Path::new(PathKind::Screw, -out, length, smallest);
    path.screw = Some((point, pitch));
    Some(path)
}

/// Combination of the free motions that comes nearest to the motion whose first entries, by `rows` of the twists, are `wanted`: the twist (ω·L, v) and
/// what remains.
fn nearest_free(
    fit: &Refined,
    rows: impl Fn(&Vector6<f64>) -> [f64; 4],
    wanted: [f64; 4],
) -> Option<(Vector6<f64>, f64)> {
    if fit.free.is_empty() {
        return None;
    }
    let columns: Vec<[f64; 4]> = fit.free.iter().map(rows).collect();
    let matrix = DMatrix::from_fn(4, columns.len(), |i, j| columns[j][i]);
    let wanted = DVector::from_column_slice(&wanted);
    let shares = matrix.clone().svd(true, true).solve(&wanted, 1e-6).ok()?;
    let remainder = (&matrix * &shares - wanted).norm();
    let twist = (fit.free.iter().zip(shares.iter()))
        .fold(Vector6::zeros(), |sum, (twist, share)| sum + twist * *share);
    Some((twist, remainder))
}

/// Point on the axis along `d` about which the mating faces leave the part free to turn.
fn spin(fit: &Refined, d: DVec3) -> Option<DVec3> {
    let rows = |t: &Vector6<f64>| [t[0], t[1], t[2], d.dot(DVec3::new(t[3], t[4], t[5]))];
    let (twist, remainder) = nearest_free(fit, rows, [d.x, d.y, d.z, 0.0])?;
    let shift = DVec3::new(twist[3], twist[4], twist[5]);
    // ω = d/L: the axis passes at ω × v/|ω|² from the centre.
    (remainder < FREE).then(|| fit.center + fit.length * d.cross(shift))
}

/// Whether the mating faces leave a slide along `d`.
fn leaves_slide(fit: &Refined, d: DVec3) -> bool {
    // A slide alone: no turn, and the way across the direction is none either, which the length of the twist shows.
    let rows = |t: &Vector6<f64>| [t[0], t[1], t[2], d.dot(DVec3::new(t[3], t[4], t[5]))];
    nearest_free(fit, rows, [0.0, 0.0, 0.0, 1.0])
        .is_some_and(|(twist, remainder)| remainder < FREE && twist.norm() < 1.0 + FREE)
}

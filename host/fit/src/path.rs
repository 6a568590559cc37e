//! The way in: the motion along which a fit is reached without overlap.
//!
//! Directions come from the mobility of the mating faces: the cone of free translations, and the motions that they leave free (a screw's twist). Each
//! is swept outward in steps until the solids are apart, with the exact distance of samples and edge points of both at each step; the way that keeps
//! the largest clearance is reported, the shorter one of equals. Between two steps, and between samples, nothing is proven.

use std::f64::consts::TAU;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_brep::Surface;

use nalgebra::Vector6;

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
}

/// Steps of a straight line, and directions tried.
const STEPS: usize = 48;
const MOST_DIRECTIONS: usize = 14;
/// Step of a screw, rad, and turns at most.
const SCREW_STEP: f64 = 0.1;
const MOST_TURNS: f64 = 12.0;
/// Clearances within this are equal, mm.
const SAME_CLEARANCE_MM: f64 = 1e-3;
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
        let length = apart(pair, &fit.pose, out);
        let smallest = swept(pair, &fit.pose, out, length, enough)?.min(clearance);
        Some(Path {
            kind: PathKind::Line,
            direction: -out,
            length_mm: length,
            smallest_clearance_mm: smallest,
            corners_mm: vec![length * out, DVec3::ZERO],
            screw: None,
        })
    };
    let full = |path: &Path| path.smallest_clearance_mm > clearance - SAME_CLEARANCE_MM;
    if let Some(path) = known.iter().filter_map(|&out| line(out)).find(full) {
        return Some(path);
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
                return Some(Path {
                    kind: PathKind::Polyline,
                    direction: -first,
                    length_mm: slide + rest,
                    smallest_clearance_mm: then.min(before).min(clearance),
                    corners_mm: vec![slide * first + rest * second, slide * first, DVec3::ZERO],
                    screw: None,
                });
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
    Some(Path {
        kind: PathKind::Screw,
        direction: -out,
        length_mm: length,
        smallest_clearance_mm: smallest,
        corners_mm: Vec::new(),
        screw: Some((point, pitch)),
    })
}

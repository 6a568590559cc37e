//! Fits of faces without a common round form: where the exact surfaces of two placed parts run along each other as designed.
//!
//! Points of one shape's faces are projected to the other shape, placed as in the assembly. Two faces fit where a tenth of the first one's area has the
//! other within a clearance, with opposed normals. Their relative curvature follows from distances alone: in the tangent plane of a point with gap g,
//! at a step s, d_A + d_B − g = ½(κ_A + κ_B)s², and d_A = ½κ_A·s² for the own surface. It is taken also with the other part shifted by the clearance,
//! for a part that moves within its fit meets other curvatures.
//!
//! Cost: some thousand exact queries for a pair of placed shapes.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};
use mortise_brep::Surface;

use crate::distance::ExactSurface;
use crate::fits::{Fit, is_round};
use crate::scene::longest_side;

/// Most points projected for one pair of placed shapes.
const MOST_POINTS: usize = 4000;
/// Most points of a pair of faces at which curvatures are compared.
const MOST_CURVATURES: usize = 40;
/// Largest clearance of a fit, as a share of the smaller shape's longest side.
const LOOSEST: f64 = 0.01;
/// Cosine between the outward normals of surfaces that oppose each other.
const OPPOSED: f64 = -0.9;
/// Share of a face's area that must have the other face along it.
const LEAST_AREA: f64 = 0.1;
/// Step of the curvature's finite difference, as a share of the longest side.
const STEP: f64 = 0.005;

/// A point of the first shape with the second one along it.
struct Along {
    at: DVec3,
    normal: DVec3,
    gap: f64,
}

/// Fits of `a` in or around `b`, with `to_b` from the frame of `a` to that of `b`; round faces that fit by their radii are left out.
pub(crate) fn placed_fits(a: &ExactSurface, b: &ExactSurface, to_b: &DAffine3) -> Vec<Fit> {
    let shape = a.shape();
    let size = longest_side(shape).min(longest_side(b.shape()));
    let mut areas = vec![0.0; shape.faces.len()];
    let mut found: BTreeMap<(u32, u32), (f64, Vec<Along>)> = BTreeMap::new();
    let stride = shape.mesh.triangles.len().div_ceil(MOST_POINTS).max(1);
    for t in (0..shape.mesh.triangles.len()).step_by(stride) {
        let [p, q, r] = a.triangles.corners(t as u32);
        let area = (q - p).cross(r - p).length() / 2.0;
        let face = shape.mesh.triangle_face[t];
        areas[face as usize] += area;
        let Some(at) = a.nearest((p + q + r) / 3.0).map(|n| n.point) else {
            continue;
        };
        let Some(other) = b.nearest(to_b.transform_point3(at)) else {
            continue;
        };
        if other.distance.abs() > LOOSEST * size || !may_fit(a, face, b, other.face) {
            continue;
        }
        let normal = a.topology.outward(shape, t as u32, at);
        if gradient(b, to_b, at, size).dot(normal) > OPPOSED {
            continue;
        }
        let entry = found.entry((face, other.face)).or_default();
        entry.0 += area;
        entry.1.push(Along {
            at,
            normal,
            gap: other.distance,
        });
    }
    (found.into_iter())
        .filter(|((face, _), (area, _))| *area >= LEAST_AREA * areas[*face as usize])
        .map(|((face, other), (_, along))| {
            let (difference, hollow) = compare(a, b, to_b, &along, size);
            Fit {
                faces: [face, other],
                hollow,
                difference,
            }
        })
        .collect()
}

/// Whether the rule by radii does not decide on these faces, and they are not both flat.
fn may_fit(a: &ExactSurface, face: u32, b: &ExactSurface, other: u32) -> bool {
    let kinds = [
        &a.shape().faces[face as usize].surface,
        &b.shape().faces[other as usize].surface,
    ];
    let flat = kinds.iter().all(|kind| matches!(kind, Surface::Plane { .. }));
    !flat && !kinds.iter().all(|kind| is_round(kind))
}

/// Direction in which the distance to `b` grows at a point of `a`, in the frame of `a`.
fn gradient(b: &ExactSurface, to_b: &DAffine3, at: DVec3, size: f64) -> DVec3 {
    let step = 1e-4 * size;
    let along = |axis: DVec3| distance(b, to_b, at + axis * step) - distance(b, to_b, at - axis * step);
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)) / (2.0 * step)
}

fn distance(b: &ExactSurface, to_b: &DAffine3, p: DVec3) -> f64 {
    b.nearest(to_b.transform_point3(p))
        .map_or(f64::NAN, |n| n.distance)
}

/// Ratio of the relative curvature to the own one, at most 1, that four fifths of the points keep; and whether the own face is hollow where most curved.
fn compare(a: &ExactSurface, b: &ExactSurface, to_b: &DAffine3, along: &[Along], size: f64) -> (f64, bool) {
    let step = STEP * size;
    let stride = along.len().div_ceil(MOST_CURVATURES).max(1);
    let mut sharpest = 0.0f64;
    let mut each: Vec<(f64, f64)> = Vec::new();
    for point in along.iter().step_by(stride) {
        let x = point.normal.any_orthonormal_vector();
        let y = point.normal.cross(x);
        let diagonal = std::f64::consts::FRAC_1_SQRT_2;
        let (mut own, mut relative) = (0.0f64, 0.0f64);
        for direction in [x, y, (x + y) * diagonal, (x - y) * diagonal] {
            let ends = [point.at + direction * step, point.at - direction * step];
            let bend = ends
                .iter()
                .filter_map(|&p| a.nearest(p))
                .map(|n| n.distance)
                .sum::<f64>()
                / (step * step);
            if bend.abs() > own.abs() {
                own = bend;
            }
            for shift in [DVec3::ZERO, x, -x, y, -y].map(|way| way * point.gap.abs()) {
                let middle = distance(b, to_b, point.at + shift);
                let sum: f64 = ends.iter().map(|&p| distance(b, to_b, p + shift)).sum();
                relative = relative.max((bend + (sum - 2.0 * middle) / (step * step)).abs());
            }
        }
        if own.abs() > sharpest.abs() {
            sharpest = own;
        }
        each.push((own.abs(), relative));
    }
    // Where the face is nearly flat its samples are as far apart as those of a tenth of its curvature.
    let least = (0.1 * sharpest.abs()).max(1e-9);
    let mut ratios: Vec<f64> = each
        .iter()
        .map(|(own, relative)| relative / own.max(least))
        .collect();
    ratios.sort_by(f64::total_cmp);
    // Points at the border of a face meet an edge, which has samples of its own.
    let worst = ratios.get(ratios.len() * 4 / 5).copied().unwrap_or(1.0);
    (worst.min(1.0), sharpest < 0.0)
}

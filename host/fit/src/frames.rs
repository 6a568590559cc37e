//! Candidate poses from free-form faces: points of equal curvature, laid on each other with their principal directions.
//!
//! At a point of a face the principal curvatures κ₁ ≥ κ₂ do not depend on the frame, and the principal directions with the normal are a frame of the
//! surface. A face and its counterpart have opposite normals and opposite curvatures, so each pair of points whose curvatures agree gives two poses.
//! Curvatures are differences of exact normals over a short step (Rusinkiewicz 2004, on the surface instead of a mesh); flat and umbilic points, where
//! the directions are undefined, are left out. The poses are as accurate as the samples are dense: refinement makes them exact.
//!
//! Cost: nine nearest points a sample; then the product of the numbers of samples in comparisons of two numbers.

use glam::{DAffine3, DMat3, DVec3};
use mortise_brep::Surface;

use crate::solid::{Sample, Solid};
use crate::translations::Candidate;

/// Points of the moving and of the fixed solid, and poses returned.
const MOST_POINTS: [usize; 2] = [96, 384];
const MOST_POSES: usize = 3000;
/// Most relative difference of curvatures.
const ALIKE: f64 = 0.08;
/// Smallest difference of the principal curvatures over the larger one.
const DIRECTED: f64 = 0.12;

#[derive(Clone, Copy, Debug)]
struct CurvatureFrame {
    p: DVec3,
    n: DVec3,
    /// Direction of κ₁.
    along: DVec3,
    curvatures: [f64; 2],
}

/// Poses that lay free-form points of `moving` on points of `fixed`, best agreement of curvatures first.
pub(crate) fn poses(moving: &Solid, fixed: &Solid) -> Vec<Candidate> {
    let [from, to] = [(moving, 0), (fixed, 1)].map(|(solid, which)| frames(solid, MOST_POINTS[which]));
    let mut found: Vec<(f64, CurvatureFrame, CurvatureFrame)> = Vec::new();
    for a in &from {
        for b in &to {
            // Seen from the other side: normal and curvatures change sign, and the larger is the other one.
            let other = CurvatureFrame {
                n: -b.n,
                along: b.n.cross(b.along),
                curvatures: [-b.curvatures[1], -b.curvatures[0]],
                ..*b
            };
            let size = a.curvatures[0].abs().max(a.curvatures[1].abs());
            let apart = (0..2)
                .map(|k| (a.curvatures[k] - other.curvatures[k]).abs())
                .fold(0.0, f64::max)
                / size;
            if apart < ALIKE {
                found.push((apart, *a, other));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Evenly from all of them: the nearest agreement is not the best place.
    let step = (2 * found.len()).div_ceil(MOST_POSES).max(1);
    found
        .into_iter()
        .step_by(step)
        .flat_map(|(_, a, b)| [1.0, -1.0].map(|sign| laid(&a, &b, sign)))
        .collect()
}

fn laid(a: &CurvatureFrame, b: &CurvatureFrame, sign: f64) -> Candidate {
    let basis = |f: &CurvatureFrame, sign: f64| {
        let x = sign * f.along;
        DMat3::from_cols(x, f.n.cross(x), f.n)
    };
    let rotation = basis(b, sign) * basis(a, 1.0).transpose();
    Candidate {
        pose: DAffine3::from_mat3_translation(rotation, b.p - rotation * a.p),
        gap: 0.0,
        rating: 0.0,
    }
}

fn frames(solid: &Solid, most: usize) -> Vec<CurvatureFrame> {
    let shape = solid.exact.shape();
    let free: Vec<&Sample> = (solid.samples.iter())
        .filter(|sample| matches!(shape.faces[sample.face as usize].surface, Surface::Spline))
        .collect();
    let stride = free.len().div_ceil(most).max(1);
    let size = solid.size();
    (free.iter().step_by(stride))
        .filter_map(|sample| frame(solid, sample, 0.004 * size))
        .filter(|frame| {
            let [a, b] = frame.curvatures;
            let largest = a.abs().max(b.abs());
            largest * size > 0.5 && (a - b) > DIRECTED * largest
        })
        .collect()
}

/// Principal curvatures and directions at a sample, by differences over `step` mm; `None` near the face's edges.
fn frame(solid: &Solid, sample: &Sample, step: f64) -> Option<CurvatureFrame> {
    let x = sample.n.any_orthonormal_vector();
    let y = sample.n.cross(x);
    let lift = solid.lift_mm().max(0.2 * step);
    let at = |d: DVec3| solid.lifted(sample.p + step * d, sample.n, sample.face, lift);
    let change = |d: DVec3| -> Option<[f64; 2]> {
        let ((p, n), (q, m)) = (at(d)?, at(-d)?);
        let length = (p - q).dot(d);
        Some([(n - m).dot(x) / length, (n - m).dot(y) / length])
    };
    let ([a, b], [c, d]) = (change(x)?, change(y)?);
    let (b, mean, half) = ((b + c) / 2.0, (a + d) / 2.0, (a - d) / 2.0);
    let radius = half.hypot(b);
    // The larger curvature is at half the angle of (half, b).
    let angle = b.atan2(half) / 2.0;
    Some(CurvatureFrame {
        p: sample.p,
        n: sample.n,
        along: angle.cos() * x + angle.sin() * y,
        curvatures: [mean + radius, mean - radius],
    })
}

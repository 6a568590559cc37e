//! Fit of a local patch: a cubic height over a tangent plane, by least squares to points of a face.
//!
//! The plane's origin is the mean of the points, its normal the mean direction out of the solid, so that it depends on no parameters of the surface:
//! poles and seams are points like any other. Heights are fitted in units of the points' radius, which keeps the normal equations well conditioned.
//! Cost: 55 multiplications per point.

use glam::DVec3;
use mortise_haptics::{Vec3, distance_to_patch};
use mortise_protocol::image::{PatchRecord, patch_kind};

use crate::cell_samples::Place;

/// Coefficients of a cubic in two variables.
const TERMS: usize = 10;
/// Fewest points of a fit.
const LEAST_POINTS: usize = 12;
/// Weight of the coefficients themselves: decides those that the points leave open, at a millionth of a micrometre in heights of a millimetre.
const RIDGE: f64 = 1e-9;

/// A foot whose direction is farther than this from the surface's normal is on the face's border: cosine.
const ALONG_NORMAL: f64 = 0.9999;

/// A point of a face, and the direction out of the solid there (of any length), mm.
#[derive(Clone, Copy)]
pub(crate) struct FacePoint {
    pub at: DVec3,
    pub outward: DVec3,
}

/// Powers of u and v in the order of [`PatchRecord::height`].
fn terms(u: f64, v: f64) -> [f64; TERMS] {
    [
        1.0,
        u,
        v,
        u * u,
        u * v,
        v * v,
        u * u * u,
        u * u * v,
        u * v * v,
        v * v * v,
    ]
}

/// Degree of each of the [`terms`].
const DEGREES: [i32; TERMS] = [0, 1, 1, 2, 2, 2, 3, 3, 3, 3];

/// Patch of face `face` fitted to these points, with feet as far as `beyond` mm outside them; `None` with too few points, or without a common
/// direction out of the solid.
pub(crate) fn fit(points: &[FacePoint], face: u16, beyond: f64) -> Option<PatchRecord> {
    if points.len() < LEAST_POINTS {
        return None;
    }
    let outward: DVec3 = points.iter().map(|p| p.outward).sum();
    // The stored frame is what the board uses: single precision, in metres.
    let normal = outward.try_normalize()?.as_vec3().normalize();
    let x = normal.any_orthonormal_vector();
    let mean = points.iter().map(|p| p.at).sum::<DVec3>() / points.len() as f64;
    let origin = (mean / 1000.0).as_vec3();
    let from = origin.as_dvec3() * 1000.0;
    let (ex, ey, ez) = (x.as_dvec3(), normal.cross(x).as_dvec3(), normal.as_dvec3());
    let local = |p: DVec3| {
        let q = p - from;
        [q.dot(ex), q.dot(ey), q.dot(ez)]
    };
    let radius = (points.iter())
        .map(|p| local(p.at))
        .map(|[u, v, _]| u.hypot(v))
        .fold(1e-6, f64::max);
    let mut matrix = [[0.0; TERMS]; TERMS];
    let mut right = [0.0; TERMS];
    for point in points {
        let [u, v, w] = local(point.at);
        let row = terms(u / radius, v / radius);
        for i in 0..TERMS {
            right[i] += row[i] * w;
            for j in 0..=i {
                matrix[i][j] += row[i] * row[j];
            }
        }
    }
    for (i, row) in matrix.iter_mut().enumerate() {
        row[i] += RIDGE * points.len() as f64;
    }
    let solution = solve(matrix, right)?;
    // From millimetres and the radius to metres.
    let scale = radius / 1000.0;
    let height = std::array::from_fn(|i| (solution[i] / 1000.0 / scale.powi(DEGREES[i])) as f32);
    Some(PatchRecord {
        origin: origin.to_array(),
        x: x.to_array(),
        normal: normal.to_array(),
        height,
        radius: ((radius + beyond) / 1000.0) as f32,
        face,
        kind: patch_kind::HEIGHT,
    })
}

/// Signed distance from `p` to a patch as the board computes it, mm; NaN where there is none.
pub(crate) fn board_distance(patch: &PatchRecord, p: DVec3) -> f64 {
    let found = distance_to_patch(patch, Vec3::from_array((p / 1000.0).as_vec3().to_array()));
    found.map_or(f64::NAN, |(distance, _)| f64::from(distance) * 1000.0)
}

/// Whether the direction to a place from its nearest point is along the normal of the patch there: if not, that point is on the face's border.
pub(crate) fn is_foot(patch: &PatchRecord, place: &Place) -> bool {
    let distance = place.exact.distance;
    let outward = (place.at - place.exact.foot) * distance.signum();
    let at = Vec3::from_array((place.exact.foot / 1000.0).as_vec3().to_array());
    distance_to_patch(patch, at).is_some_and(|(_, normal)| {
        outward.dot(DVec3::from_array(normal.to_array().map(f64::from))) >= ALONG_NORMAL * distance.abs()
    })
}

/// Foot of `p` on a patch as the board finds it, mm.
pub(crate) fn board_foot(patch: &PatchRecord, p: DVec3) -> Option<DVec3> {
    let at = Vec3::from_array((p / 1000.0).as_vec3().to_array());
    let (distance, normal) = distance_to_patch(patch, at)?;
    Some(p - DVec3::from_array(normal.to_array().map(f64::from)) * (f64::from(distance) * 1000.0))
}

/// Solution of a positive definite system whose lower triangle is given (Cholesky).
fn solve(mut m: [[f64; TERMS]; TERMS], mut x: [f64; TERMS]) -> Option<[f64; TERMS]> {
    for i in 0..TERMS {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| m[i][k] * m[j][k]).sum();
            let rest = m[i][j] - sum;
            m[i][j] = if i == j {
                if rest <= 0.0 {
                    return None;
                }
                rest.sqrt()
            } else {
                rest / m[j][j]
            };
        }
    }
    for i in 0..TERMS {
        let sum: f64 = (0..i).map(|k| m[i][k] * x[k]).sum();
        x[i] = (x[i] - sum) / m[i][i];
    }
    for i in (0..TERMS).rev() {
        let sum: f64 = (i + 1..TERMS).map(|k| m[k][i] * x[k]).sum();
        x[i] = (x[i] - sum) / m[i][i];
    }
    x.iter().all(|c| c.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A cubic sheet in any frame is found again, at points that it was not fitted to: 40 m/2²⁴ of rounding is 2 nm, times a few operations.
        #[test]
        fn a_cubic_is_found_again(
            k in prop::array::uniform10(-1.0f64..1.0),
            n in prop::array::uniform3(-1.0f64..1.0),
            at in prop::array::uniform3(-40.0f64..40.0),
        ) {
            let normal = DVec3::from_array(n);
            prop_assume!(normal.length() > 0.1);
            let normal = normal.normalize();
            let x = normal.any_orthonormal_vector();
            let y = normal.cross(x);
            let on = |u: f64, v: f64| {
                let c = terms(u / 2.0, v / 2.0);
                // Slopes up to a tenth: a cubic over one plane is nearly one over another.
                let h: f64 = (3..TERMS).map(|i| 0.02 * k[i] * c[i]).sum();
                DVec3::from_array(at) + x * u + y * v + normal * h
            };
            let points: Vec<FacePoint> = (0..49)
                .map(|i| FacePoint {
                    at: on(f64::from(i % 7) / 2.0 - 1.5, f64::from(i / 7) / 2.0 - 1.5),
                    outward: normal,
                })
                .collect();
            let patch = fit(&points, 5, 1.0).unwrap();
            for (u, v) in [(0.3, 0.2), (-1.2, 0.7), (1.4, -1.3)] {
                prop_assert!(board_distance(&patch, on(u, v)).abs() < 5e-5, "{}", board_distance(&patch, on(u, v)));
                let above = board_distance(&patch, on(u, v) + normal * 0.2);
                prop_assert!((0.198..=0.2001).contains(&above), "{above}");
            }
        }
    }

    #[test]
    fn too_few_points_are_no_patch() {
        let point = FacePoint {
            at: DVec3::ZERO,
            outward: DVec3::Z,
        };
        assert!(fit(&[point; 11], 0, 1.0).is_none());
        let both = [DVec3::Z, -DVec3::Z].map(|outward| FacePoint { outward, ..point });
        assert!(fit(&both.repeat(10), 0, 1.0).is_none());
    }
}

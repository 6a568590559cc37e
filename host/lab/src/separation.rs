//! Signed distance of two convex solids: the gap, or minus the least translation that separates them.
//!
//! For any unit direction n the solids are apart by s(n) = min_B n·b − max_A n·a along it, and the signed distance is the largest s(n). Gaps are those
//! of parry's GJK in double precision. Where the solids overlap, the largest s(n) belongs to the point of the difference body's boundary that is
//! nearest to the origin. A ball inside that body touches it at a point with one normal only, which is on
//!
//! * a face: n is a face's normal, or the cross product of two straight edges or generators (separating axes; Gottschalk, Lin & Manocha 1996);
//! * a patch swept by a rim along a straight edge, or by a vertex or rim along a cylinder's side: n is perpendicular to that edge or axis, and is searched on
//!   that circle of directions;
//! * a patch swept by two rims: n is searched on the sphere, where s is smooth.
//!
//! For polytopes the first case is all, and exact.

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec3};
use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query::details::{
    distance_support_map_support_map_with_params, intersection_test_support_map_support_map,
};
use parry3d_f64::query::gjk::VoronoiSimplex;
use parry3d_f64::shape::SupportMap;

use crate::convex::Convex;
use crate::exact_fit::golden;

/// Steps round a circle of directions.
const CIRCLE_STEPS: usize = 720;
/// Directions tried on the sphere, and how many of the best the search starts from.
const DIRECTIONS: u32 = 512;
const STARTS: usize = 8;
/// Angle of the first and last step of the search on the sphere, rad, and most steps. The value is stationary at its direction, so that its error is of
/// second order: below a nanometre for parts of a metre.
const FIRST_STEP: f64 = 1e-2;
const LAST_STEP: f64 = 1e-7;
const MOST_STEPS: u32 = 500;

impl SupportMap for Convex {
    fn local_support_point(&self, direction: Vector) -> Vector {
        let p = self.support(DVec3::new(direction.x, direction.y, direction.z));
        Vector::new(p.x, p.y, p.z)
    }
}

/// Signed distance of `a` and of `b` at `pose` in `a`'s frame, mm.
pub(crate) fn signed_distance_mm(a: &Convex, b: &Convex, pose: &DAffine3) -> f64 {
    // A ball is its centre, grown by its radius.
    if let Convex::Ball { radius } = *b
        && radius > 0.0
    {
        return signed_distance_mm(a, &Convex::Ball { radius: 0.0 }, pose) - radius;
    }
    gap(a, b, pose).unwrap_or_else(|| depth_by_directions(a, b, pose))
}

/// Least distance over several starts of GJK, which on cylinders now and then stops early: it returns the distance of two points of the solids, so the
/// least of several is the best. `None` where they overlap, for which GJK returns 0, as where it does not converge.
fn gap(a: &Convex, b: &Convex, pose: &DAffine3) -> Option<f64> {
    let at = peer_pose(pose);
    let starts = [
        at.translation,
        Vector::X,
        Vector::Y,
        Vector::Z,
        -Vector::X,
        -Vector::Y,
        -Vector::Z,
    ];
    let gaps = starts.into_iter().map(|start| {
        let simplex = &mut VoronoiSimplex::new();
        distance_support_map_support_map_with_params(&at, a, b, simplex, Some(-start))
    });
    gaps.filter(|&gap| gap > 0.0).min_by(f64::total_cmp)
}

fn depth_by_directions(a: &Convex, b: &Convex, pose: &DAffine3) -> f64 {
    let along = |n: DVec3| apart_along(a, b, pose, n);
    let there = |directions: Vec<DVec3>| {
        directions
            .into_iter()
            .map(|d| pose.matrix3 * d)
            .collect::<Vec<_>>()
    };
    let (straight, turned) = (a.straight(), there(b.straight()));
    let faces = a.normals().into_iter().chain(there(b.normals()));
    let crossings = (straight.iter()).flat_map(|e| turned.iter().filter_map(|f| e.cross(*f).try_normalize()));
    let axes = faces.chain(crossings).flat_map(|n| [n, -n]).map(along);
    let round = [a, b]
        .iter()
        .any(|solid| matches!(solid, Convex::Cylinder { .. }));
    let circles = (straight.iter().chain(&turned))
        .filter(|_| round)
        .map(|&axis| most_on_circle(axis, &along));
    let both_round = matches!((a, b), (Convex::Cylinder { .. }, Convex::Cylinder { .. }));
    let sphere = both_round.then(|| most_on_sphere(&along));
    axes.chain(circles)
        .chain(sphere)
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Largest value over the directions perpendicular to `axis`: every local maximum of equal steps, refined.
fn most_on_circle(axis: DVec3, of: &dyn Fn(DVec3) -> f64) -> f64 {
    let x = axis.any_orthonormal_vector();
    let y = axis.cross(x);
    let step = TAU / CIRCLE_STEPS as f64;
    let at = |angle: f64| of(x * angle.cos() + y * angle.sin());
    let values: Vec<f64> = (0..CIRCLE_STEPS).map(|k| at(step * k as f64)).collect();
    (0..CIRCLE_STEPS)
        .filter(|&k| {
            let [before, after] = [k + CIRCLE_STEPS - 1, k + 1].map(|k| values[k % CIRCLE_STEPS]);
            values[k] >= before && values[k] >= after
        })
        .map(|k| golden(step * (k as f64 - 1.0), step * (k as f64 + 1.0), at))
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Largest value over all directions of a function that is smooth where it is largest.
fn most_on_sphere(of: &dyn Fn(DVec3) -> f64) -> f64 {
    let mut directions: Vec<(f64, DVec3)> = (0..DIRECTIONS).map(spiral).map(|n| (of(n), n)).collect();
    directions.sort_unstable_by(|m, n| n.0.total_cmp(&m.0));
    (directions[..STARTS].iter())
        .map(|&(most, n)| refined(of, most, n))
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Whether `a` and `b` at `pose` in `a`'s frame overlap; cheaper than the distance.
pub(crate) fn overlap(a: &Convex, b: &Convex, pose: &DAffine3) -> bool {
    intersection_test_support_map_support_map(&peer_pose(pose), a, b)
}

fn peer_pose(pose: &DAffine3) -> Pose {
    let [x, y, z, w] = DQuat::from_mat3(&pose.matrix3).normalize().to_array();
    Pose::from_parts(
        pose.translation.to_array().into(),
        Rotation::from_xyzw(x, y, z, w),
    )
}

/// Direction `index` of a spiral that covers the sphere evenly.
fn spiral(index: u32) -> DVec3 {
    let z = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(DIRECTIONS);
    let angle = TAU * 0.618_033_988_749_895 * f64::from(index);
    let across = (1.0 - z * z).sqrt();
    DVec3::new(across * angle.cos(), across * angle.sin(), z)
}

/// Distance by which the solids are apart along the unit direction `n`, from `a` to `b`; negative where their projections overlap.
pub(crate) fn apart_along(a: &Convex, b: &Convex, pose: &DAffine3, n: DVec3) -> f64 {
    let there = pose.matrix3.transpose() * -n;
    pose.transform_point3(b.support(there)).dot(n) - a.support(n).dot(n)
}

/// Largest value near the direction `n`: steps across it, doubled where one is better, halved where none is.
fn refined(of: &dyn Fn(DVec3) -> f64, mut most: f64, mut n: DVec3) -> f64 {
    let mut step = FIRST_STEP;
    for _ in 0..MOST_STEPS {
        let x = n.any_orthonormal_vector();
        let y = n.cross(x);
        let better = (0..8)
            .map(|k| {
                let (sin, cos) = (0.125 * TAU * f64::from(k)).sin_cos();
                (n + (x * cos + y * sin) * step).normalize()
            })
            .map(|n| (of(n), n))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match better {
            Some((value, better)) if value > most => {
                (most, n) = (value, better);
                step *= 2.0;
            }
            _ => step *= 0.5,
        }
        if step < LAST_STEP {
            break;
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convex::Polytope;

    fn pose(random: &mut fastrand::Rng, reach: f64) -> DAffine3 {
        let mut unit = || 2.0 * random.f64() - 1.0;
        let turn = DQuat::from_xyzw(unit(), unit(), unit(), unit() + 1e-3).normalize();
        DAffine3::from_rotation_translation(turn, reach * DVec3::new(unit(), unit(), unit()))
    }

    /// Prism with the cylinder's axis and length, its section a regular polygon of `sides` corners on (`around` false) or sides about the circle.
    fn as_prism(radius: f64, half: f64, sides: u32, around: bool) -> Polytope {
        let apothem = if around {
            radius
        } else {
            radius * (0.5 * TAU / f64::from(sides)).cos()
        };
        let mut planes = vec![(DVec3::Z, half), (-DVec3::Z, half)];
        planes.extend((0..sides).map(|side| {
            let (sin, cos) = (TAU * f64::from(side) / f64::from(sides)).sin_cos();
            (DVec3::new(cos, sin, 0.0), apothem)
        }));
        Polytope::of(&planes).expect("regular")
    }

    /// A cylinder lies between the prisms in and about it, and so does its signed distance.
    #[test]
    fn cylinders_lie_between_their_prisms() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..60 {
            let [a, b] = [0; 2].map(|_| (2.0 + 8.0 * random.f64(), 2.0 + 20.0 * random.f64()));
            let round = [a, b].map(|(radius, half)| Convex::Cylinder { radius, half });
            let [inner, outer] = [false, true].map(|around| {
                [a, b].map(|(radius, half)| Convex::Polytope(as_prism(radius, half, 32, around)))
            });
            let pose = pose(&mut random, 12.0);
            let of = |[a, b]: &[Convex; 2]| signed_distance_mm(a, b, &pose);
            let (most, least, found) = (of(&inner), of(&outer), of(&round));
            assert!(
                found <= most + 1e-9 && found >= least - 1e-9,
                "{least} {found} {most}"
            );
        }
    }

    /// Round against flat, nearly touching and apart: the distance is no larger than along the line on which one was moved away from contact.
    #[test]
    fn gaps_are_no_larger_than_the_way_from_contact() {
        let mut random = fastrand::Rng::with_seed(3);
        for kind in 0..2_000 {
            let [a, b] = [5, kind].map(|kind| Convex::random(kind, 30.0, &mut random));
            let line = pose_direction(&mut random);
            let turned = pose(&mut random, 0.0);
            let at = |t: f64| DAffine3::from_translation(line * t) * turned;
            let (mut inside, mut outside) = (0.0, 100.0);
            while outside - inside > 1e-6 {
                let middle = 0.5 * (inside + outside);
                let overlap = overlap(&a, &b, &at(middle));
                *(if overlap { &mut inside } else { &mut outside }) = middle;
            }
            let by = 1e-3 * 10f64.powf(3.0 * random.f64());
            let found = signed_distance_mm(&a, &b, &at(outside + by));
            assert!(found > 0.0 && found <= by + 2e-6, "{kind}: {found} {by}");
        }
    }

    /// No direction separates farther, for gaps and depths alike.
    #[test]
    fn separating_axes_agree_with_the_other_method() {
        let mut random = fastrand::Rng::with_seed(2);
        for kind in 0..300 {
            let [a, b] = [kind, kind / 6].map(|kind| Convex::random(kind, 30.0, &mut random));
            let pose = pose(&mut random, 12.0);
            let found = signed_distance_mm(&a, &b, &pose);
            for _ in 0..300 {
                let n = pose_direction(&mut random);
                let apart = apart_along(&a, &b, &pose, n);
                assert!(apart <= found + 1e-6, "{kind}: {apart} {found}");
            }
        }
    }

    fn pose_direction(random: &mut fastrand::Rng) -> DVec3 {
        pose(random, 1.0).matrix3.x_axis
    }
}

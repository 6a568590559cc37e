//! Least signed distance between two exact surfaces, by search from both sides.
//!
//! The distance meant is the least signed distance from any point of either part's surface to the other part: the gap, or minus the depth of the
//! deepest point. Samples of each surface are evaluated against the other; the best, some spacings apart, are moved in random directions and projected
//! back onto their surface, in steps that are halved where none is better. Directions out of the surface lead along its edges. Distances are those of
//! [`mortise_bake::ExactSurface`]; no field, pointshell or tree of a scene takes part. Cost: about 0.1 s a pose.

use glam::{DAffine3, DVec3};
use mortise_scenario::Body;

/// Places from which the search starts, of each part, and the share of the samples' spacing by which they are apart at least.
const STARTS: usize = 12;
const APART: f64 = 0.5;
/// Directions a step, and the smallest step, mm.
const DIRECTIONS: usize = 10;
const LAST_STEP_MM: f64 = 1e-5;
/// Most steps from one start.
const MOST_STEPS: usize = 200;

/// Least signed distance of `fixed` and of `moving` at `pose` in `fixed`'s frame, mm.
pub(crate) fn least_distance_mm(fixed: &Body, moving: &Body, pose: &DAffine3) -> f64 {
    one_way(moving, fixed, pose).min(one_way(fixed, moving, &pose.inverse()))
}

/// Least distance of points of `of`, transformed by `to`, in `other`.
fn one_way(of: &Body, other: &Body, to: &DAffine3) -> f64 {
    let distance = |p: DVec3| {
        let place = to.transform_point3(p);
        other
            .surface
            .nearest(place)
            .map_or(f64::INFINITY, |nearest| nearest.distance)
    };
    // Outside the bounding sphere the distance to it is a lower bound.
    let bound = |p: DVec3| to.transform_point3(p).distance(other.center) - other.radius;
    let mut near: Vec<(f64, DVec3)> = of.points.iter().map(|&p| (bound(p), p)).collect();
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let spacing = spacing_mm(of);
    let mut least = f64::INFINITY;
    let mut found: Vec<(f64, DVec3)> = Vec::new();
    for (bound, p) in near {
        if bound > least + spacing {
            break;
        }
        let value = distance(p);
        least = least.min(value);
        found.push((value, p));
    }
    found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut starts: Vec<(f64, DVec3)> = Vec::new();
    for (value, p) in found {
        if value > least + spacing || starts.len() == STARTS {
            break;
        }
        if starts.iter().all(|(_, q)| q.distance(p) > APART * spacing) {
            starts.push((value, p));
        }
    }
    (starts.iter())
        .map(|&(value, p)| descend(of, p, value, spacing, &distance))
        .fold(least, f64::min)
}

/// Typical spacing of a part's samples, mm: as if they were evenly spread over its sphere.
fn spacing_mm(of: &Body) -> f64 {
    of.radius * (4.0 * std::f64::consts::PI / of.points.len().max(1) as f64).sqrt()
}

fn descend(of: &Body, mut p: DVec3, mut least: f64, step_mm: f64, distance: &dyn Fn(DVec3) -> f64) -> f64 {
    let mut random = fastrand::Rng::with_seed(7);
    let mut step = step_mm;
    for _ in 0..MOST_STEPS {
        let mut better = false;
        for _ in 0..DIRECTIONS {
            let direction = DVec3::from_array([0; 3].map(|_| 2.0 * random.f64() - 1.0));
            let Some(nearest) = of.surface.nearest(p + step * direction) else {
                continue;
            };
            let value = distance(nearest.point);
            if value < least {
                (p, least, better) = (nearest.point, value, true);
            }
        }
        if !better {
            step *= 0.5;
        }
        if step < LAST_STEP_MM {
            break;
        }
    }
    least
}

//! Overlap of parts on their exact surfaces, at every sample.
//!
//! Points on the exact surface of the moving part are evaluated against the exact surface of each other part, and vice versa. An evaluation costs
//! microseconds and a run has millions of them. Most are skipped: a signed distance changes by at most the motion of its point, so a point need not
//! be evaluated again before it could be deeper than the deepest so far. Skipping does not change the result.

use glam::{DAffine3, DVec3};
use mortise_protocol::message::Telemetry;

use crate::scene::{Body, PreparedScene};
use crate::wire::pose_mm;

/// Last evaluated distances of a part's points in another part.
struct Known {
    /// Position of each point at its last evaluation, the other part's frame, mm.
    at: Vec<DVec3>,
    /// Signed distance at that position, mm.
    distance: Vec<f64>,
}

impl Known {
    fn nothing(points: &[DVec3]) -> Self {
        Self {
            at: points.to_vec(),
            distance: vec![f64::NEG_INFINITY; points.len()],
        }
    }

    /// Deepest of `points` (transformed by `to_body`) inside `body`, mm, or `most` if none is deeper.
    fn deeper(&mut self, points: &[DVec3], to_body: &DAffine3, body: &Body, most: f64) -> f64 {
        let mut deepest = most;
        let known = self.at.iter_mut().zip(&mut self.distance);
        for (&point, (at, distance)) in points.iter().zip(known) {
            let place = to_body.transform_point3(point);
            if *distance - place.distance(*at) >= -deepest {
                continue;
            }
            *at = place;
            // Outside the bounding sphere the distance to it is a lower bound.
            let off = place.distance(body.center) - body.radius;
            *distance = if off > 0.0 {
                off
            } else {
                (body.surface.nearest(place)).map_or(f64::INFINITY, |nearest| nearest.distance)
            };
            deepest = deepest.max(-*distance);
        }
        deepest
    }
}

/// Deepest point of the moving part in any other, or of any other in it, over all samples, mm; 0 without overlap. In closed form where the scene has
/// one.
pub fn penetration_mm(scene: &PreparedScene, samples: &[Telemetry]) -> f64 {
    match scene.closed_form() {
        Some(closed_form) => (samples.iter().filter_map(|sample| sample.object.as_ref()))
            .map(|(_, pose)| closed_form(&pose_mm(pose)))
            .fold(0.0, f64::max),
        None => penetration_by_points_mm(scene, samples),
    }
}

/// The same by sample points on either part's surface, mm: penetration between the points is not seen.
pub fn penetration_by_points_mm(scene: &PreparedScene, samples: &[Telemetry]) -> f64 {
    let poses = samples.iter().filter_map(|sample| sample.object.as_ref());
    penetration_of_poses_mm(scene, poses.map(|(_, pose)| pose_mm(pose)))
}

/// The same over poses of the moving part's shape in the world, mm.
pub fn penetration_of_poses_mm(scene: &PreparedScene, poses: impl Iterator<Item = DAffine3>) -> f64 {
    let bodies = scene.bodies();
    let moving = usize::from(scene.part);
    let Some(part) = bodies.get(moving) else {
        return 0.0;
    };
    let mut known: Vec<[Known; 2]> = (bodies.iter())
        .map(|other| [Known::nothing(&part.points), Known::nothing(&other.points)])
        .collect();
    let mut most = 0.0;
    for pose in poses {
        let here = pose.transform_point3(part.center);
        for (index, (other, [forward, backward])) in bodies.iter().zip(&mut known).enumerate() {
            let there = other.placement.transform_point3(other.center);
            if index == moving || here.distance(there) > part.radius + other.radius {
                continue;
            }
            let to_other = other.placement.inverse() * pose;
            most = forward.deeper(&part.points, &to_other, other, most);
            most = backward.deeper(&other.points, &to_other.inverse(), part, most);
        }
    }
    most
}

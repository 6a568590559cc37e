//! How deep parts overlap by their exact surfaces, at every sample.
//!
//! Points on the exact surface of the moving part are looked up in the exact surface of each other part, and the other way round. A look-up costs
//! microseconds and a run has millions of them; most are not needed: a signed distance changes by no more than its point has moved, so one looked up
//! once need not be again before it could be deeper than the deepest so far. What is left out changes nothing in the result.

use glam::{DAffine3, DVec3};
use mortise_protocol::message::Telemetry;

use super::measure::pose_mm;
use super::scene::{Body, PreparedScene};

/// What is known of a part's points in another part.
struct Known {
    /// Where each was looked up last, the other part's frame, mm.
    at: Vec<DVec3>,
    /// Signed distance there, mm.
    distance: Vec<f64>,
}

impl Known {
    fn nothing(points: &[DVec3]) -> Self {
        Self {
            at: points.to_vec(),
            distance: vec![f64::NEG_INFINITY; points.len()],
        }
    }

    /// Deepest of `points` (moved by `to_body`) inside `body`, mm, unless that is less than `most`.
    fn deeper(&mut self, points: &[DVec3], to_body: &DAffine3, body: &Body, most: f64) -> f64 {
        let mut deepest = most;
        let known = self.at.iter_mut().zip(&mut self.distance);
        for (&point, (at, distance)) in points.iter().zip(known) {
            let place = to_body.transform_point3(point);
            if *distance - place.distance(*at) >= -deepest {
                continue;
            }
            *at = place;
            // Outside the sphere about the body it is as far off as that at least.
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

/// Deepest point of the moving part in any other, or of any other in it, over all samples, mm; 0 when nowhere inside. In closed form where the scene
/// has one.
pub(crate) fn deepest(scene: &PreparedScene, samples: &[Telemetry]) -> f64 {
    match scene.closed_form() {
        Some(exact) => (samples.iter().filter_map(|sample| sample.object.as_ref()))
            .map(|(_, pose)| exact.penetration_mm(&pose_mm(pose)))
            .fold(0.0, f64::max),
        None => sampled(scene, samples),
    }
}

/// By points on either part's surface.
fn sampled(scene: &PreparedScene, samples: &[Telemetry]) -> f64 {
    let bodies = scene.bodies();
    let moving = usize::from(scene.part);
    let Some(part) = bodies.get(moving) else {
        return 0.0;
    };
    let mut known: Vec<[Known; 2]> = (bodies.iter())
        .map(|other| [Known::nothing(&part.points), Known::nothing(&other.points)])
        .collect();
    let mut most = 0.0;
    for (_, pose) in samples.iter().filter_map(|sample| sample.object.as_ref()) {
        let pose = pose_mm(pose);
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

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use mortise_protocol::message::{Telemetry, WirePose};

    use super::*;
    use crate::fit::Fit;
    use crate::guided::{SIM, play_to};
    use crate::motion::{Motion, script};
    use crate::variant::Variant;
    use mortise_bake::Grabbable;

    /// What is left out changes nothing, and closed form finds the same: a peg pressed to the wall, and one moved about at random into the block.
    #[test]
    fn leaving_out_what_cannot_be_deeper_changes_nothing() {
        let (fit, mut scenario) =
            script(&Fit::thesis(0.2), Motion::Pressed { mm_per_s: 40.0 }).expect("known");
        let file = fit.file().expect("written");
        scenario.scene.step = file.path().to_owned();
        scenario.run.telemetry_every_ticks = 20;
        let options = Variant::field(1.0).options(Grabbable::Named(vec!["peg".into()]));
        let scene = PreparedScene::with(&scenario, &options)
            .expect("baked")
            .made_from(fit);
        let mut samples: Vec<Telemetry> = play_to(&scenario, &scene, &SIM, &mut |_| Vec::new())
            .expect("played")
            .samples;
        let brute = |samples: &[Telemetry]| {
            let one = |sample: &Telemetry| sampled(&scene, std::slice::from_ref(sample));
            samples.iter().map(one).fold(0.0, f64::max)
        };
        let closed = |samples: &[Telemetry]| deepest(&scene, samples);
        let pressed = sampled(&scene, &samples);
        assert_eq!(pressed, brute(&samples));
        assert!(
            pressed > 0.0 && (pressed - closed(&samples)).abs() < 0.2e-3,
            "{pressed} {}",
            closed(&samples)
        );
        // Random poses: in by up to half a millimetre, tilted by up to three degrees.
        let mut random = fastrand::Rng::with_seed(3);
        let mut unit = || 2.0 * random.f64() - 1.0;
        let start = samples[0].object.expect("in hand");
        for sample in &mut samples {
            let pose = pose_mm(&start.1);
            let axis = DVec3::new(unit(), unit(), unit());
            let moved = DAffine3::from_rotation_translation(
                DQuat::from_scaled_axis(0.03 * axis),
                DVec3::new(0.4 * unit(), 0.4 * unit(), 15.0 * unit()),
            ) * pose;
            let rotation = DQuat::from_mat3(&moved.matrix3).normalize();
            sample.object = Some((
                start.0,
                WirePose {
                    position: (1e-3 * moved.translation).as_vec3().to_array(),
                    orientation: rotation.as_quat().to_array(),
                },
            ));
            let one = std::slice::from_ref(sample);
            // Points 4 mm apart leave out what lies between; closed form leaves out nothing.
            let (sampled, exact) = (sampled(&scene, one), closed(one));
            assert!(
                sampled <= exact + 1e-3 && sampled >= 0.9 * exact - 5e-3,
                "{sampled} {exact}"
            );
        }
        assert_eq!(sampled(&scene, &samples), brute(&samples));
    }
}

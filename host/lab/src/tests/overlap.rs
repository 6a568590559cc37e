//! Penetration by points on the surfaces against penetration in closed form.

use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::Grabbable;
use mortise_protocol::message::{Telemetry, WirePose};
use mortise_scenario::PreparedScene;
use mortise_scenario::overlap::{penetration_by_points_mm, penetration_mm};
use mortise_scenario::wire::pose_mm;

use crate::exact_fit::made_from;
use crate::fit::Fit;
use crate::guided::{SIM, play_to};
use crate::motion::{Motion, script};
use crate::variant::Variant;

/// Skipping queries that cannot find a deeper point changes nothing, and the closed form gives the same: a peg pressed to the wall, and one moved at
/// random into the block.
#[test]
fn leaving_out_what_cannot_be_deeper_changes_nothing() {
    let (fit, mut scenario) = script(&Fit::thesis(0.2), Motion::Pressed { mm_per_s: 40.0 }).expect("known");
    let file = fit.file().expect("written");
    scenario.scene.step = file.path().to_owned();
    scenario.run.telemetry_every_ticks = 20;
    let options = Variant::field(1.0).options(Grabbable::Named(vec!["peg".into()]));
    let scene = made_from(PreparedScene::with(&scenario, &options).expect("baked"), fit);
    let mut samples: Vec<Telemetry> = play_to(&scenario, &scene, &SIM, &mut |_| Vec::new())
        .expect("played")
        .samples;
    let brute = |samples: &[Telemetry]| {
        let one = |sample: &Telemetry| penetration_by_points_mm(&scene, std::slice::from_ref(sample));
        samples.iter().map(one).fold(0.0, f64::max)
    };
    let closed = |samples: &[Telemetry]| penetration_mm(&scene, samples);
    let pressed = penetration_by_points_mm(&scene, &samples);
    assert_eq!(pressed, brute(&samples));
    assert!(
        pressed > 0.0 && (pressed - closed(&samples)).abs() < 0.2e-3,
        "{pressed} {}",
        closed(&samples)
    );
    // Random poses: up to half a millimetre deep, tilted by up to three degrees.
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
        // Points 4 mm apart miss what lies between them; the closed form misses nothing.
        let (sampled, exact) = (penetration_by_points_mm(&scene, one), closed(one));
        assert!(
            sampled <= exact + 1e-3 && sampled >= 0.9 * exact - 5e-3,
            "{sampled} {exact}"
        );
    }
    assert_eq!(penetration_by_points_mm(&scene, &samples), brute(&samples));
}

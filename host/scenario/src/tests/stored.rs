//! Energy stored in the coupling, computed from wrenches and from poses.

use glam::DAffine3;
use mortise_protocol::message::Telemetry;
use mortise_rig::RigSpec;

use crate::measure::{Coupled, meters, turn};
use crate::run::{connect, record};
use crate::scenario::Scenario;
use crate::scene::PreparedScene;

/// Without slip the stretch also follows from the poses, however the hand moves: from the handle's true pose and the object's at the tick's start.
#[test]
fn what_is_stored_is_what_the_poses_say_where_nothing_slips() {
    let text = include_str!("../../../../hil-tests/scenarios/press_flat_5n.toml");
    let mut scenario = Scenario::parse(text, "press").expect("a scenario");
    let pair = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../app/samples/pair_d18.75_clear1.00.step"
    );
    scenario.scene.step = pair.into();
    scenario.run.telemetry_every_ticks = 1;
    let scene = PreparedScene::of(&scenario).expect("baked");
    let client = connect(&scenario, &RigSpec::Simulated { realtime: false }).expect("connected");
    let recording = record(&client, &scenario, &scene, None).expect("played");
    let (samples, felt) = (&recording.samples, &recording.felt);
    let settings = scenario.settings();
    let coupled = Coupled::new(&scene, &settings, samples).expect("in hand");
    let [k, k_r] = [settings.coupling.k_t_n_per_m, settings.coupling.k_r].map(f64::from);
    let grabbed = |sample: &Telemetry| meters(&sample.object.as_ref().expect("in hand").1);
    let offset = meters(&samples[0].handle).inverse() * grabbed(&samples[0]);
    let (mut most, mut worst) = (0.0f64, 0.0f64);
    // After the ramp that follows the grab, during which a part slips.
    for (three, felt) in samples.windows(3).zip(&felt[2..]).skip(200) {
        let place = meters(&felt.handle) * offset;
        let [before, at] = [grabbed(&three[0]), grabbed(&three[1])];
        let center = |pose: &DAffine3| pose.transform_point3(coupled.center);
        let speed = 1e3 * (center(&at) - center(&before));
        let exact = 0.5
            * (k * (center(&place) - center(&at)).length_squared()
                + k_r * turn(&at, &place).length_squared()
                + f64::from(settings.object.mass_kg) * speed.length_squared());
        let found = coupled.stored_mj(three, felt).expect("neighbours");
        most = most.max(1e3 * exact);
        worst = worst.max((found - 1e3 * exact).abs());
    }
    println!("up to {most} mJ stored, found to {worst} mJ");
    // 5 N on 1 N/mm store 12.5 mJ. The part's pose in the hand comes from the readings of the first sample, to a count: 5 µm by 5 N.
    assert!(most > 12.0, "{most} mJ");
    assert!(worst < 25e-3, "{worst} mJ of {most} mJ");
}

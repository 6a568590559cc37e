//! Energy that the rounding of readings makes, held against theory.

use glam::DVec3;
use mortise_haptics::Settings;
use mortise_mechanism::velocity::low_pass::VELOCITY_FILTER_S;
use mortise_protocol::message::WirePose;
use mortise_rig::RigSpec;
use mortise_simulation::simulated::RESOLUTION;

use crate::hand::{REACH_TICKS, REST_TICKS, reach, script};
use crate::measure::energy;
use crate::run::{connect, record};
use crate::scenario::Scenario;
use crate::scene::PreparedScene;
use crate::truth::replay;

/// g₀·u²/(12·h) on each axis, W; see [`crate::truth`].
fn made_by_rounding() -> f64 {
    let Settings {
        coupling,
        object,
        period_s,
        ..
    } = Settings::default();
    let [h, k, b, m, tau, u] = [
        period_s,
        coupling.k_t_n_per_m,
        coupling.b_t,
        object.mass_kg,
        VELOCITY_FILTER_S,
        RESOLUTION,
    ]
    .map(f64::from);
    let damper = b + h * k;
    let stiffness = m / (m + h * damper) * (k + damper / (tau + h));
    stiffness * u * u / (12.0 * h)
}

/// A part carried through free air by a hand that trembles by a few counts a tick: nothing is made in truth, and what readings make is what
/// theory says.
#[test]
fn readings_make_what_rounding_makes_and_the_true_motion_nothing() {
    const SECONDS: f64 = 6.0;
    let text = include_str!("../../../../hil-tests/scenarios/load.toml");
    let mut scenario = Scenario::parse(text, "carried").expect("a scenario");
    let pair = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../app/samples/pair_d18.75_clear1.00.step"
    );
    scenario.scene.step = pair.into();
    scenario.run.duration_s = SECONDS;
    scenario.run.telemetry_every_ticks = 1;
    scenario.run.parameter_every_ticks = None;
    scenario.hand.tremor_mm = 0.3;
    // No whole number of ticks: or the same roundings come again.
    scenario.hand.tremor_hz = 9.7183;
    scenario.hand.keyframes.truncate(2);
    scenario.hand.keyframes[1].t_s = SECONDS;
    scenario.hand.keyframes[1].offset_mm = [31.0, 23.0, 27.0];
    let scene = PreparedScene::of(&scenario).expect("baked");
    let client = connect(&scenario, &RigSpec::Simulated { realtime: false }).expect("connected");
    let recording = record(&client, &scenario, &scene, None).expect("played");
    let samples = &recording.samples;

    let before = (&reach(&scenario.hand), REACH_TICKS + REST_TICKS);
    let script = script(&scenario.hand);
    let felt = replay(before, &script, samples).expect("every reading as recorded");
    let (given, passed) = energy(&scene, &Settings::default(), samples, &felt);
    // Σ F·(e' − e), e the rounding, once the grip is firm.
    let error = |i: usize| {
        let position = |pose: &WirePose| DVec3::from_array(pose.position.map(f64::from));
        position(&samples[i].handle) - position(&felt[i].handle)
    };
    let force = |i: usize| DVec3::from_array(felt[i].wrench.force.map(f64::from));
    let made: f64 = (1000..felt.len() - 1)
        .map(|i| force(i).dot(error(i + 1) - error(i)))
        .sum();
    let predicted = 3.0 * made_by_rounding() * (SECONDS - 1.0);
    println!("true {given} of {passed} mJ; by rounding {made} J, predicted {predicted} J");
    assert!(passed > 1.0 && given < 1e-3 * passed, "{given} of {passed} mJ");
    // As white as a motion makes it: from 0.85 to 1.15 of the prediction in the linear loop, with how the tremor's period and the ticks fall.
    assert!((made / predicted - 1.0).abs() < 0.15, "{made} {predicted}");

    let mut other = samples.clone();
    other[700].wrench.force[0] += 0.1;
    assert!(
        replay(before, &script, &other).is_none(),
        "another force, the same motion"
    );
    assert!(replay(before, &script, &samples[1..]).is_none());
}

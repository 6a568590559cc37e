//! Where the simulated handle truly was, which its encoders round.
//!
//! Work of the device on the handle is Σ F_k·(x_{k+1} − x_k), with F_k held over the tick and x the handle's true position. Taken with readings
//! q = x + e in its place it is wrong by Σ F_k·(e_{k+1} − e_k), and not on average right: a count of size u shows at once in the force by −g₀·u,
//! which over the ticks until the next count resists a motion that readings do not have. While the handle moves by about a count a tick e is nearly
//! white, uniform within ±u/2, and
//!
//! P = g₀·u²/(12·h) on each axis, g₀ = m/(m + h·B)·(k + B·a/h), B = b + h·k, a = h/(τ + h) of the speed's filter
//!
//! is made out of nothing: 10.8 µW for 5 µm, 5.2 N/mm and 1 ms, 32 µW on three axes that tremble. So the mechanism is played again instead, with the
//! script and the wrenches of the recording. It computes the same bits on every rig; that it does, to the last reading, is checked.

use mortise_firmware::board::{Drive, Mechanism, Simulation};
use mortise_firmware::wire::{pose_to_wire, wrench_to_wire};
use mortise_haptics::{Vec3, Wrench};
use mortise_protocol::message::{HandScript, Telemetry};
use mortise_simulation::simulated::Simulated;

use super::measure::Felt;

/// What the motors did and where the handle truly was, tick by tick.
///
/// The mechanism starts as new, with nothing driven while `before` leads it for so many ticks; then `script` does, under the wrenches of `samples`.
/// `None` unless every reading is the one recorded there: a tick is missing, inputs were made to fail, or the rig has another mechanism.
pub(super) fn replay(
    before: (&HandScript, u32),
    script: &HandScript,
    samples: &[Telemetry],
) -> Option<Vec<Felt>> {
    let mut mechanism = Simulated::new();
    mechanism.set_hand(Some(before.0));
    for _ in 0..before.1 {
        mechanism.sense();
    }
    mechanism.set_hand(Some(script));
    let first = samples.first()?.tick;
    let felt = samples.iter().zip(0..).map(|(sample, age)| {
        let sensed = mechanism.sense();
        let reading = pose_to_wire(&sensed.handle);
        let handle = pose_to_wire(&mechanism.true_pose());
        // Encoders are watched while a part is in hand.
        mechanism.watch_encoders(sample.object.is_some());
        mechanism.drive(Drive::Wrench(Wrench {
            force: Vec3::from_array(sample.wrench.force),
            torque: Vec3::from_array(sample.wrench.torque),
        }));
        let known = reading == sample.handle && sample.tick == first.wrapping_add(age);
        known.then(|| Felt {
            tick: sample.tick,
            handle,
            wrench: wrench_to_wire(&mechanism.motors()),
            twist: Some(sensed.twist),
        })
    });
    felt.collect()
}

#[cfg(test)]
mod tests {
    use super::super::measure::energy;
    use super::super::run::{REACH_TICKS, REST_TICKS, reach, script};
    use super::super::{PreparedScene, Scenario, connect, record};
    use super::*;
    use glam::DVec3;
    use mortise_haptics::Settings;
    use mortise_mechanism::velocity::low_pass::VELOCITY_FILTER_S;
    use mortise_protocol::message::WirePose;
    use mortise_rig::RigSpec;
    use mortise_simulation::simulated::RESOLUTION;

    /// g₀·u²/(12·h) on each axis, W; see the module.
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
}

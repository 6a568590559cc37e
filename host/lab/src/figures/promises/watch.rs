//! Promises on the checks of every tick: dead encoders against still hands, and rotation.

use fastrand::Rng;
use mortise_rig::RigSpec;
use mortise_scenario::{Hand, Key, PreparedScene, Scenario, ScenarioError, connect, run_on};

use crate::LabError;
use crate::figures::stability::faults;
use crate::figures::{Plan, Row};

/// Duration of the still press, s.
const PRESS_S: f64 = 60.0;
/// Number of random cases, in the full and in the shorter form.
const CASES: [u32; 2] = [200, 24];
/// Seed of the cases, the same in every run.
const SEED: u64 = 0x5743_7a8d;

/// A still press, encoders that freeze under motion, and a handle that turns too fast.
///
/// # Errors
/// Anything that prevents the scene from being baked or a run from being played.
pub fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let text = include_str!("../../../../../hil-tests/scenarios/input_stuck.toml");
    let mut scenario = Scenario::parse(text, "input_stuck")?;
    scenario.scene.step = plan.pair.to_owned();
    let scene = PreparedScene::of(&scenario)?;
    out(still_press(&scenario, &scene)?);
    let [full, short] = CASES;
    let cases = if plan.quick { short } else { full };
    let mut random = Rng::with_seed(SEED);
    let (mut worst_ms, mut missed, mut false_alarms) = (0.0f64, 0u32, 0u32);
    for _ in 0..cases {
        let (moved, at_ms) = frozen(&scenario, &mut random);
        let client = connect(&moved, &RigSpec::Simulated { realtime: false })?;
        match run_on(&client, &moved, &scene)?.fault_at_ms {
            Some(fault_ms) if fault_ms >= at_ms => worst_ms = worst_ms.max(fault_ms - at_ms),
            Some(_) => false_alarms += 1,
            None => missed += 1,
        }
    }
    let what = format!("an encoder frozen under motion, {cases} random hands, motions, axes and moments");
    out(Row::at_most(
        format!("{what}: longest time to the fault"),
        worst_ms,
        "ms",
        200.0,
    ));
    out(Row::exactly(
        format!("{what}: not found"),
        f64::from(missed),
        "cases",
        0.0,
    ));
    out(Row::exactly(
        format!("{what}: faults before the encoder froze"),
        f64::from(false_alarms),
        "cases",
        0.0,
    ));
    let ticks = faults::ticks_until_off_when_turning(plan.pair)?;
    out(Row::at_most(
        "handle turning above the limit, at 40.1 and 900 rad/s: longest time to motors off",
        f64::from(ticks),
        "ticks",
        1.0,
    ));
    Ok(())
}

/// The peg pressed onto the block with 10 N by a hand that does not move.
fn still_press(scenario: &Scenario, scene: &PreparedScene) -> Result<Row, LabError> {
    let mut still = scenario.clone();
    still.hand.tremor_mm = 0.0;
    // 35 mm beyond touching, through 400 N/m and 1,000 N/m in series; a coupling that carries the force without slipping.
    if let Some(last) = still.hand.keyframes.last_mut() {
        last.offset_mm[2] = -55.0;
    }
    still.parameters.insert("CouplingForce".into(), 12.0);
    still.run.duration_s = PRESS_S;
    still.run.telemetry_every_ticks = 100;
    still.faults = None;
    let client = connect(&still, &RigSpec::Simulated { realtime: false })?;
    let faults = match run_on(&client, &still, scene) {
        Ok(outcome) => {
            // Without a press the row would prove nothing.
            if outcome.peak_force_n > 9.5 { 0.0 } else { f64::NAN }
        }
        Err(ScenarioError::Fault { .. }) => 1.0,
        Err(other) => return Err(other.into()),
    };
    let what = format!("still press of 10 N for {PRESS_S} s without tremor: faults");
    Ok(Row::exactly(what, faults, "", 0.0))
}

/// A random hand that is never at rest, in free air and pressed onto the block; which encoder freezes, and when.
fn frozen(scenario: &Scenario, random: &mut Rng) -> (Scenario, f64) {
    let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
    let mut moved = scenario.clone();
    let stiffness = 10f64.powf(between(1.7, 3.5));
    moved.hand = Hand {
        stiffness_n_per_m: stiffness as f32,
        damping_n_s_per_m: (stiffness * between(0.004, 0.02)) as f32,
        // Half of the hands do not tremble.
        tremor_mm: between(-0.2, 0.2).max(0.0),
        tremor_hz: between(6.0, 12.0) as f32,
        keyframes: (0..12)
            .map(|i| Key {
                t_s: 0.25 * f64::from(i),
                offset_mm: [between(0.0, 16.0), between(0.0, 16.0), between(-30.0, 0.0)],
                turn_deg: [(); 3].map(|()| between(-15.0, 15.0)),
                push_n: [0.0; 3],
            })
            .collect(),
        ..moved.hand
    };
    let at_ms = between(500.0, 2_000.0) as u32;
    if let Some(fault) = (moved.faults.as_mut()).and_then(|faults| faults.inputs.first_mut()) {
        fault.at_ms = at_ms;
        fault.axis = Some(random.u8(0..6));
    }
    moved.run.telemetry_every_ticks = 100;
    (moved, f64::from(at_ms))
}

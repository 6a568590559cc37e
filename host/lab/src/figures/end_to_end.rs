//! The whole chain on one sample: from a STEP file to an insertion with force feedback.

use glam::DVec3;
use mortise_protocol::message::Telemetry;
use mortise_rig::{EmulatedMode, RigSpec};
use mortise_scenario::{Key, Outcome, PreparedScene, Scenario, connect, record, run_on};

use super::{Plan, Row, link, parts};
use crate::LabError;
use crate::contact_law::pushed;

/// Press scenarios: the hand's slide after the press, mm, the tolerance of the force there, N, and its text.
const PRESSES: &[(&str, [f64; 3], f64, &str)] = &[
    (
        "flat face, 1 N",
        FLAT_MM,
        FLAT_OFF_N,
        include_str!("../../../../hil-tests/scenarios/press_flat_1n.toml"),
    ),
    (
        "flat face, 3 N",
        FLAT_MM,
        FLAT_OFF_N,
        include_str!("../../../../hil-tests/scenarios/press_flat_3n.toml"),
    ),
    (
        "flat face, 5 N",
        FLAT_MM,
        FLAT_OFF_N,
        include_str!("../../../../hil-tests/scenarios/press_flat_5n.toml"),
    ),
    (
        "hole wall, 1 N",
        WALL_MM,
        WALL_OFF_N,
        include_str!("../../../../hil-tests/scenarios/press_wall_1n.toml"),
    ),
    (
        "hole wall, 3 N",
        WALL_MM,
        WALL_OFF_N,
        include_str!("../../../../hil-tests/scenarios/press_wall_3n.toml"),
    ),
    (
        "hole wall, 5 N",
        WALL_MM,
        WALL_OFF_N,
        include_str!("../../../../hil-tests/scenarios/press_wall_5n.toml"),
    ),
];
/// Slides, mm: on the block's top, inside its outline; along the wall, with both rims of the hole at the peg's side.
const FLAT_MM: [f64; 3] = [-2.0, -2.0, 0.0];
const WALL_MM: [f64; 3] = [0.0, 0.0, -6.0];
/// Time of a slide in either direction, s.
const SLIDE_S: f64 = 0.3;
/// Largest difference between the contact force and that of the exact surfaces, N: a position 60 mm from its shape's origin is reported, and queried,
/// to 3.7 nm in single precision, which at 800 kN/m is twice 3 mN a span: of some thirty spans on the flat, of four on the two rims of the wall.
const FLAT_OFF_N: f64 = 0.18;
const WALL_OFF_N: f64 = 0.024;
/// Largest difference between the force on the handle and the contact force while the hand starts, turns and stops, N: 0.1 kg at 0.5 m/s².
const FELT_OFF_N: f64 = 0.05;
/// Deepest penetration, mm: 5 N on the two spans of a wall's rims, 800 kN/m each.
const DEEPEST_MM: f64 = 3.125e-3;
const TOUCHING: &str = include_str!("../../../../hil-tests/scenarios/insertion_touching.toml");
const LOAD: &str = include_str!("../../../../hil-tests/scenarios/load.toml");

const SIM: RigSpec = RigSpec::Simulated { realtime: false };

fn emulated() -> RigSpec {
    RigSpec::Emulated {
        mode: EmulatedMode::Lockstep,
        firmware: None,
    }
}

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    insertion(plan, out)?;
    touching(plan, out)?;
    presses(plan, out)?;
    load(plan, out)?;
    link::damage(out);
    link::cuts(plan, out)?;
    parts::inspect(plan, out)?;
    parts::assemblies(plan, out)
}

fn play(scenario: &Scenario, scene: &PreparedScene, spec: &RigSpec) -> Result<Outcome, LabError> {
    let client = mortise_rig::Client::connect(&spec.lockstep())?;
    Ok(run_on(&client, scenario, scene)?)
}

fn scenario(text: &str, plan: &Plan<'_>) -> Result<Scenario, LabError> {
    let mut scenario = Scenario::parse(text, "figures")?;
    scenario.scene.step = plan.pair.to_owned();
    Ok(scenario)
}

fn insertion(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let scenario = Scenario::insertion(plan.pair)?;
    let scene = PreparedScene::of(&scenario)?;
    let board = play(&scenario, &scene, &emulated())?;
    // Every tick of the second run is looked at. That it ends in the same state shows that both went the same way; telemetry costs a tick some
    // instructions more.
    let mut watched = scenario.clone();
    watched.run.telemetry_every_ticks = 1;
    let again = play(&watched, &scene, &emulated())?;
    let here = play(&scenario, &scene, &SIM)?;
    let hole = board.hole_mm.unwrap_or(f64::NAN);
    let what =
        |what: &str| format!("insertion, 1 mm clearance, hand 0.2 mm and 0.5° off, emulated board: {what}");
    out(Row::within(
        what("inserted"),
        board.inserted_mm.unwrap_or(f64::NAN),
        "mm",
        hole,
        f64::INFINITY,
    ));
    out(Row::exactly(
        what("missed ticks at shift=1"),
        f64::from(board.missed_ticks),
        "ticks",
        0.0,
    ));
    let budget = board.instructions_per_tick_budget.map_or(f64::NAN, f64::from);
    let most = board.instructions_per_tick_max.map_or(f64::NAN, f64::from);
    out(Row::at_most(
        what("instructions in the longest tick"),
        most,
        "instructions",
        budget,
    ));
    out(Row::exactly(
        what("ticks of it that left out points"),
        again.degraded_percent,
        "%",
        0.0,
    ));
    out(Row::at_most(
        what("deepest penetration by the exact surfaces in any tick"),
        again.penetration_mm,
        "mm",
        0.05,
    ));
    out(Row::exactly(
        what("impulse of contacts (it goes through without touching)"),
        again.contact_impulse_ns,
        "N s",
        0.0,
    ));
    out(Row::within(
        what("peak force, which is the coupling's lag"),
        board.peak_force_n,
        "N",
        0.01,
        3.0,
    ));
    out(Row::same(
        what("state hash of a second run, every tick of it looked at"),
        &again.state_hash,
        &board.state_hash,
    ));
    out(Row::same(
        what("state hash of the in-process rig"),
        &here.state_hash,
        &board.state_hash,
    ));
    Ok(())
}

/// A peg that lands on the rim of its hole and goes down pressed to the wall. Every tick is recorded in-process, which equals the board bit for bit.
fn touching(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let scenario = scenario(TOUCHING, plan)?;
    let scene = PreparedScene::of(&scenario)?;
    let recording = record(&connect(&scenario, &SIM)?, &scenario, &scene, None)?;
    let seen = &recording.outcome;
    let what = |what: &str| {
        format!("insertion that lands on the rim and leans to the wall, 1 mm clearance, every tick: {what}")
    };
    out(Row::within(
        what("inserted"),
        seen.inserted_mm.unwrap_or(f64::NAN),
        "mm",
        41.5,
        43.0,
    ));
    out(Row::within(
        what("deepest penetration by the exact surfaces"),
        1e3 * seen.penetration_mm,
        "µm",
        0.1,
        10.0,
    ));
    out(Row::within(
        what("impulse of contacts"),
        seen.contact_impulse_ns,
        "N s",
        0.5,
        3.0,
    ));
    out(Row::within(
        what("largest contact force on the object"),
        seen.peak_contact_n,
        "N",
        0.5,
        3.0,
    ));
    out(Row::within(
        what("largest force on the handle"),
        seen.peak_force_n,
        "N",
        0.5,
        3.0,
    ));
    out(Row::at_most(
        what("impulse of contacts that the hand did not feel"),
        seen.impulse_lost_ns,
        "N s",
        0.01,
    ));
    let board = play(&scenario, &scene, &emulated())?;
    out(Row::same(
        what("state hash of the emulated board"),
        &board.state_hash,
        &seen.state_hash,
    ));
    out(Row::exactly(
        what("missed ticks at shift=1"),
        f64::from(board.missed_ticks),
        "ticks",
        0.0,
    ));
    Ok(())
}

/// Presses at rest and sliding along the pressed face.
fn presses(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let mut scene = None;
    for &(name, slide_mm, off_by_n, text) in PRESSES {
        let mut scenario = scenario(text, plan)?;
        let scene = match &mut scene {
            Some(scene) => scene,
            none => none.insert(PreparedScene::of(&scenario)?),
        };
        scenario.run.telemetry_every_ticks = 1;
        let still = record(&connect(&scenario, &SIM)?, &scenario, scene, None)?;
        let what = |what: &str| format!("pressed on {name}, in-process: {what}");
        out(Row::at_most(
            what("force on the handle against the hand's"),
            still.outcome.press_error_percent.unwrap_or(f64::NAN),
            "%",
            2.0,
        ));
        out(Row::at_most(
            what("deepest penetration by the exact surfaces in any tick"),
            1e3 * still.outcome.penetration_mm,
            "µm",
            1e3 * DEEPEST_MM,
        ));
        let settled = still.samples.len().saturating_sub(500);
        out(Row::at_most(
            what("contact force on the object off what the exact surfaces give, worst tick at rest"),
            off_n(scene, &still.samples[settled..])?,
            "N",
            off_by_n,
        ));
        if !plan.quick {
            // Both rigs must give the same bits.
            let board = play(&scenario, scene, &emulated())?;
            out(Row::same(
                what("state hash of the emulated board"),
                &board.state_hash,
                &still.outcome.state_hash,
            ));
        }
        let begins = slid(&mut scenario, slide_mm);
        let moving = record(&connect(&scenario, &SIM)?, &scenario, scene, None)?;
        let samples = moving.samples.get(begins..).unwrap_or(&[]);
        let what = |what: &str| format!("pressed on {name}, slid, in-process: {what}");
        out(Row::at_most(
            what("contact force on the object off what the exact surfaces give, worst tick"),
            off_n(scene, samples)?,
            "N",
            off_by_n,
        ));
        let pressed = scenario
            .press
            .as_ref()
            .map_or(DVec3::NAN, |press| DVec3::from_array(press.direction));
        let felt = samples.iter().map(|sample| {
            let [contact, handle] =
                [sample.contact.force, sample.wrench.force].map(|f| DVec3::from_array(f.map(f64::from)));
            (contact - handle).dot(pressed).abs()
        });
        out(Row::at_most(
            what("force on the handle off the contact force, along the press, worst tick"),
            felt.fold(0.0, f64::max),
            "N",
            FELT_OFF_N,
        ));
        out(Row::at_most(
            what("deepest penetration by the exact surfaces in any tick"),
            1e3 * moving.outcome.penetration_mm,
            "µm",
            1e3 * DEEPEST_MM,
        ));
    }
    Ok(())
}

/// Appends a slide there and back after the hand has come to rest; returns the tick in which it begins.
fn slid(scenario: &mut Scenario, by_mm: [f64; 3]) -> usize {
    let begins = scenario.run.duration_s;
    if let Some(last) = scenario.hand.keyframes.last().cloned() {
        let mut there = last.offset_mm;
        for (place, by) in there.iter_mut().zip(by_mm) {
            *place += by;
        }
        for (t_s, offset_mm) in [
            (begins, last.offset_mm),
            (begins + SLIDE_S, there),
            (begins + 2.0 * SLIDE_S, last.offset_mm),
        ] {
            scenario.hand.keyframes.push(Key {
                t_s,
                offset_mm,
                ..last.clone()
            });
        }
    }
    scenario.run.duration_s = begins + 2.0 * SLIDE_S;
    (1e3 * begins) as usize
}

/// Largest difference between the contact force and the contact law on the exact surfaces, N; NaN where either is zero.
fn off_n(scene: &PreparedScene, samples: &[Telemetry]) -> Result<f64, LabError> {
    let pushed = pushed(scene, samples)?;
    let touched = pushed
        .iter()
        .all(|tick| tick.exact.length() > 0.5 && tick.reported.length() > 0.5);
    Ok(if touched && !pushed.is_empty() {
        (pushed.iter())
            .map(|tick| (tick.reported - tick.exact).length())
            .fold(0.0, f64::max)
    } else {
        f64::NAN
    })
}

fn load(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let mut scenario = scenario(LOAD, plan)?;
    if plan.quick {
        scenario.run.duration_s = 10.0;
    }
    let seconds = scenario.run.duration_s;
    let scene = PreparedScene::of(&scenario)?;
    let outcome = play(&scenario, &scene, &emulated())?;
    let what = |what: &str| {
        format!(
            "{seconds} s of virtual time, telemetry at 200 Hz, a parameter each 10 ms, emulated board: {what}"
        )
    };
    out(Row::exactly(
        what("missed ticks at shift=1"),
        f64::from(outcome.missed_ticks),
        "ticks",
        0.0,
    ));
    out(Row::exactly(
        what("telemetry that arrived"),
        f64::from(outcome.samples),
        "messages",
        200.0 * seconds,
    ));
    out(Row::exactly(
        what("parameters taken"),
        f64::from(outcome.parameter_messages),
        "messages",
        100.0 * seconds,
    ));
    Ok(())
}

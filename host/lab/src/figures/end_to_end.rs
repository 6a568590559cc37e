//! From a STEP file to a felt insertion: the whole chain on one sample.

use mortise_rig::{EmulatedMode, RigSpec};

use super::{Plan, Row, link, parts};
use crate::LabError;
use crate::scenario::{Outcome, PreparedScene, Scenario, run_on};

/// Scenarios that press, with the force in the name.
const PRESSES: &[(&str, &str)] = &[
    (
        "flat face, 1 N",
        include_str!("../../../../hil-tests/scenarios/press_flat_1n.toml"),
    ),
    (
        "flat face, 3 N",
        include_str!("../../../../hil-tests/scenarios/press_flat_3n.toml"),
    ),
    (
        "flat face, 5 N",
        include_str!("../../../../hil-tests/scenarios/press_flat_5n.toml"),
    ),
    (
        "hole wall, 1 N",
        include_str!("../../../../hil-tests/scenarios/press_wall_1n.toml"),
    ),
    (
        "hole wall, 3 N",
        include_str!("../../../../hil-tests/scenarios/press_wall_3n.toml"),
    ),
    (
        "hole wall, 5 N",
        include_str!("../../../../hil-tests/scenarios/press_wall_5n.toml"),
    ),
];
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
    presses(plan, out)?;
    load(plan, out)?;
    link::damage(out);
    link::cuts(plan, out)?;
    parts::inspect(plan, out)?;
    parts::assemblies(plan, out)
}

fn play(scenario: &Scenario, scene: &PreparedScene, spec: &RigSpec) -> Result<Outcome, LabError> {
    run_on(&mortise_rig::Client::connect(&spec.lockstep())?, scenario, scene)
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
    let again = play(&scenario, &scene, &emulated())?;
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
    out(Row::at_most(
        what("deepest penetration by the exact surfaces"),
        board.penetration_mm,
        "mm",
        0.05,
    ));
    out(Row::within(
        what("peak force"),
        board.peak_force_n,
        "N",
        0.01,
        3.0,
    ));
    out(Row::same(
        what("state hash of a second run"),
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

fn presses(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    // The same bits on both rigs (rows above): the quick form presses in-process.
    let (spec, on) = if plan.quick {
        (SIM, "in-process")
    } else {
        (emulated(), "emulated board")
    };
    let mut scene = None;
    for (name, text) in PRESSES {
        let scenario = scenario(text, plan)?;
        let scene = match &mut scene {
            Some(scene) => scene,
            none => none.insert(PreparedScene::of(&scenario)?),
        };
        let outcome = play(&scenario, scene, &spec)?;
        let what = |what: &str| format!("pressed on {name}, {on}: {what}");
        let error = outcome.press_error_percent.unwrap_or(f64::NAN);
        out(Row::at_most(
            what("force on the handle against the hand's"),
            error,
            "%",
            2.0,
        ));
        out(Row::at_most(
            what("deepest penetration by the exact surfaces"),
            outcome.penetration_mm,
            "mm",
            0.05,
        ));
    }
    Ok(())
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

//! Guidance over a faulty link.

use std::time::{Duration, Instant};

use mortise_bake::Grabbable;
use mortise_guide::GuideSettings;
use mortise_protocol::message::{DeviceState, Telemetry, ToDevice};
use mortise_rig::{Client, Faults, RigSpec, Window};
use mortise_scenario::{PreparedScene, Recording, Scenario, ScenarioError};

use crate::LabError;
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::guided::{SIM, inserted, insertion, key, largest_step, play_to};
use crate::variant::Variant;

/// Ticks between the samples that the guide receives.
const HEAR_TICKS: u32 = 10;
/// Largest change of force, N, and torque between two ticks while only guidance changes.
const FORCE_N: f64 = 0.05;
const TORQUE_MNM: f64 = 2.0;
/// Largest step and force over a faulty link as a multiple of those over a fault-free one; a step may also reach the limit of guidance alone.
const FACTOR: f64 = 1.2;
/// Growth of the force of a hand that has landed and is not yet guided: 22.5 mm/s on two springs in series, 400 and 1000 N/m.
const LANDING_N_PER_MS: f64 = 22.5e-6 * 286.0;
/// Longest gap between messages received, ms: where three of ten are lost, three in a row are lost in one of forty cases.
const LOST_MS: f64 = 30.0;
/// Largest step over the fault-free link, which has no reference: a hand of 400 N/m that lands 1 mm off at 23 mm/s, and guidance of 3 N and 0.1 N m.
const ALONE_STEP_N: f64 = 0.3;
const ALONE_STEP_NM: f64 = 0.01;
const ALONE_N: f64 = 4.0;
const ALONE_NM: f64 = 0.1;
/// Interval in which the link is cut while the peg is held half-way, ms.
const CUT: Window = Window {
    at_ms: 1500,
    for_ms: 450,
};

/// Interval in which the hand holds still and oscillations have decayed, ms.
const HELD_MS: [usize; 2] = [1450, 2350];

/// Half-way in at 1.2 s, held there until 2.4 s, through at 3.6 s.
fn prepared(clearance_mm: f64) -> Result<(Scenario, PreparedScene), LabError> {
    let fit = Fit::thesis(clearance_mm).engaged(-20.0);
    let file = fit.file()?;
    let mut scenario = insertion(&fit, file.path())?;
    let turn = [0.0, 2.0, 0.0];
    let down = |t: f64, z: f64| key(t, [1.0, 0.0, z], turn);
    scenario.hand.keyframes = vec![
        key(0.0, [0.0; 3], [0.0; 3]),
        down(0.3, -17.0),
        down(1.2, -40.0),
        down(2.4, -40.0),
        down(3.6, -62.0),
    ];
    scenario.run.duration_s = 4.0;
    scenario.run.telemetry_every_ticks = 1;
    let options = Variant::field(0.5).options(Grabbable::Named(vec!["peg".into()]));
    let scene = PreparedScene::with(&scenario, &options)?;
    Ok((scenario, scene))
}

/// Plays the scenario; a fault of the board is a result here, not an error.
fn play(scenario: &Scenario, scene: &PreparedScene) -> Result<Result<Recording, String>, LabError> {
    let mut guide = scene.guide(GuideSettings::default());
    let mut due = 0;
    let mut listener = |sample: &Telemetry| {
        if sample.tick < due {
            return Vec::new();
        }
        due = sample.tick + HEAR_TICKS;
        guide.hear(sample)
    };
    match play_to(scenario, scene, &SIM, &mut listener) {
        Ok(recording) => Ok(Ok(recording)),
        Err(fault @ LabError::Scenario(ScenarioError::Fault { .. })) => Ok(Err(fault.to_string())),
        Err(other) => Err(other),
    }
}

/// Every row about a link that fails.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let (mut still, held_scene) = prepared(1.0)?;
    still.hand.tremor_mm = 0.0;
    cut(&still, &held_scene, out)?;
    let (scenario, scene) = prepared(0.02)?;
    // Stalls shorter than a target's expiry, longer than it, and so long that most of the insertion is unguided.
    let stall = |for_ms| Faults {
        stall: vec![Window { at_ms: 1200, for_ms }],
        ..Faults::default()
    };
    let late = Faults {
        delay_ms: [100, 100],
        ..Faults::default()
    };
    let lost = |seed| Faults {
        seed,
        drop: 0.3,
        ..Faults::default()
    };
    let bad = |seed| Faults {
        seed,
        drop: 0.1,
        corrupt: 0.1,
        repeat: 0.2,
        reorder: 0.2,
        delay_ms: [0, 50],
        flood_per_s: 200,
        ..Faults::default()
    };
    // Each with the largest delay of the guide's first message, ms, and whether guidance lapses while the peg is held half-way.
    let mut cases = vec![
        ("nothing is wrong", Faults::default(), 0.0, false),
        ("nothing comes for 0.2 s", stall(200), 0.0, false),
        ("nothing comes for 0.5 s", stall(500), 0.0, true),
        ("nothing comes for 2 s", stall(2000), 0.0, true),
        ("everything 100 ms late", late, 100.0, false),
        ("30 % lost, first seed", lost(1), LOST_MS, false),
    ];
    if !plan.quick {
        cases.extend([
            ("30 % lost, second seed", lost(2), LOST_MS, false),
            ("30 % lost, third seed", lost(3), LOST_MS, false),
            (
                "lost, damaged, repeated, out of order, late, flooded",
                bad(1),
                50.0 + LOST_MS,
                false,
            ),
        ]);
    }
    let mut sound = None;
    for (name, faults, late_ms, lapses) in cases {
        held(&still, &held_scene, name, faults.clone(), lapses, out)?;
        let steps = through(&scenario, &scene, (name, late_ms), faults, sound, out)?;
        // The first case is the fault-free link, the reference.
        sound = sound.or(steps);
    }
    by_the_clock(&scene, out)
}

/// Forces of an insertion and their largest steps.
#[derive(Clone, Copy)]
struct FeltThere {
    /// Largest steps between two ticks, N and N m.
    force_step: f64,
    torque_step: f64,
    /// Largest force, N, and torque, N m.
    force: f64,
    torque: f64,
}

/// Plays the insertion of the 20 µm fit over a link with `faults` and compares its forces with those over a fault-free link (`sound`).
fn through(
    scenario: &Scenario,
    scene: &PreparedScene,
    (name, late_ms): (&str, f64),
    faults: Faults,
    sound: Option<FeltThere>,
    out: &mut dyn FnMut(Row),
) -> Result<Option<FeltThere>, LabError> {
    let scenario = Scenario {
        faults: Some(faults),
        ..scenario.clone()
    };
    let what = |what: &str| format!("guided insertion, 20 µm clearance, link on which {name}: {what}");
    let recording = match play(&scenario, scene)? {
        Ok(recording) => recording,
        Err(fault) => {
            out(Row::same(what("fault of the board"), &fault, "none"));
            return Ok(None);
        }
    };
    let counts = recording.faults;
    eprintln!("{name}: {counts:?}");
    out(Row::same(what("fault of the board"), "none", "none"));
    let seen = inserted(&scenario, scene, &recording.samples);
    out(Row::within(
        what("inserted by itself"),
        seen.depth_mm,
        "mm",
        seen.hole_mm,
        f64::INFINITY,
    ));
    let (force_step, torque_step) = largest_step(&recording.samples);
    let felt = FeltThere {
        force_step,
        torque_step,
        force: recording.outcome.peak_force_n,
        torque: recording.outcome.peak_torque_nm,
    };
    // The fault-free link has no reference: a hand that lands 1 mm off meets the block, and guidance pulls with 3 N.
    let bound = |sound_is: fn(&FeltThere) -> f64, slack: f64, alone: f64| {
        sound
            .as_ref()
            .map_or(alone, |sound| FACTOR * sound_is(sound) + slack)
    };
    out(Row::at_most(
        what("largest step of force between two ticks, landing included"),
        felt.force_step,
        "N",
        bound(|felt| felt.force_step, FORCE_N, ALONE_STEP_N),
    ));
    out(Row::at_most(
        what("largest step of torque likewise"),
        1e3 * felt.torque_step,
        "mN m",
        1e3 * bound(|felt| felt.torque_step, 1e-3 * TORQUE_MNM, ALONE_STEP_NM),
    ));
    out(Row::at_most(
        what("largest force"),
        felt.force,
        "N",
        bound(|felt| felt.force, LANDING_N_PER_MS * late_ms, ALONE_N),
    ));
    out(Row::at_most(
        what("largest torque"),
        1e3 * felt.torque,
        "mN m",
        1e3 * bound(|felt| felt.torque, 0.0, ALONE_NM),
    ));
    Ok(Some(felt))
}

/// A peg held half-way, 1 mm off without tremor, over a link with `faults`: only guidance can change the force on the handle.
fn held(
    still: &Scenario,
    scene: &PreparedScene,
    name: &str,
    faults: Faults,
    lapses: bool,
    out: &mut dyn FnMut(Row),
) -> Result<(), LabError> {
    let scenario = Scenario {
        faults: Some(faults),
        ..still.clone()
    };
    let what = |what: &str| format!("peg held half-way 1 mm and 2° off, link on which {name}: {what}");
    let recording = match play(&scenario, scene)? {
        Ok(recording) => recording,
        Err(fault) => {
            out(Row::same(what("fault of the board"), &fault, "none"));
            return Ok(());
        }
    };
    let held = while_held(&recording.samples);
    out(if lapses {
        let least = engagements(held).fold(1.0, f32::min);
        Row::exactly(what("least engagement, lapsed"), f64::from(least), "", 0.0)
    } else {
        let most = engagements(held).fold(0.0, f32::max);
        Row::exactly(what("largest engagement"), f64::from(most), "", 1.0)
    });
    steps(&what, held, out);
    Ok(())
}

/// The samples in which the hand holds still.
fn while_held(samples: &[Telemetry]) -> &[Telemetry] {
    &samples[HELD_MS[0].min(samples.len())..HELD_MS[1].min(samples.len())]
}

fn engagements(samples: &[Telemetry]) -> impl Iterator<Item = f32> {
    samples.iter().map(|sample| sample.guidance.engagement)
}

/// Steps of force and torque while only guidance changes.
fn steps(what: &dyn Fn(&str) -> String, samples: &[Telemetry], out: &mut dyn FnMut(Row)) {
    let (force, torque) = largest_step(samples);
    out(Row::at_most(
        what("largest step of force between two ticks"),
        force,
        "N",
        FORCE_N,
    ));
    out(Row::at_most(
        what("largest step of torque between two ticks"),
        1e3 * torque,
        "mN m",
        TORQUE_MNM,
    ));
}

/// The same steps with a cut link: targets expire and are sent again.
fn cut(still: &Scenario, scene: &PreparedScene, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let mut scenario = still.clone();
    scenario.faults = Some(Faults {
        disconnect: vec![CUT],
        ..Faults::default()
    });
    let what = |what: &str| {
        format!(
            "link cut for {} ms, peg held half-way 1 mm and 2° off: {what}",
            CUT.for_ms
        )
    };
    let recording = match play(&scenario, scene)? {
        Ok(recording) => recording,
        Err(fault) => {
            out(Row::same(what("fault of the board"), &fault, "none"));
            return Ok(());
        }
    };
    out(Row::same(what("fault of the board"), "none", "none"));
    let samples = &recording.samples;
    let held = while_held(samples);
    let least = engagements(held).fold(1.0, f32::min);
    out(Row::exactly(
        what("engagement when guidance had run out"),
        f64::from(least),
        "",
        0.0,
    ));
    steps(&what, held, out);
    let again = (held.iter().rev())
        .take_while(|sample| sample.guidance.engagement == 1.0)
        .count();
    let back = HELD_MS[1] as f64 - again as f64 - (CUT.at_ms + CUT.for_ms) as f64;
    out(Row::within(
        what("guided again by itself after the cut"),
        back,
        "ms",
        0.0,
        399.0,
    ));
    let seen = inserted(&scenario, scene, samples);
    out(Row::within(
        what("inserted in the end"),
        seen.depth_mm,
        "mm",
        seen.hole_mm,
        f64::INFINITY,
    ));
    Ok(())
}

/// In real time, in which the board measures the host's silence: the part stays in hand during a cut of 300 ms.
fn by_the_clock(scene: &PreparedScene, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let client = Client::connect_with_faults(&RigSpec::Simulated { realtime: true })?;
    client.upload(&scene.image, &mut |_| {})?;
    client.request(ToDevice::Arm)?;
    client.request(ToDevice::Grab { part: scene.part })?;
    let cut = Window {
        at_ms: 100,
        for_ms: 300,
    };
    if let Some(line) = client.fault_line() {
        line.begin(&Faults {
            disconnect: vec![cut],
            ..Faults::default()
        });
    }
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_millis(cut.at_ms + cut.for_ms + 200) {
        std::thread::sleep(Duration::from_millis(10));
    }
    let state = client.refresh_capabilities()?.state;
    let live = matches!(state, DeviceState::Armed | DeviceState::Active);
    out(Row::same(
        format!(
            "link cut for {} ms by the wall clock, part in hand, in-process at its own pace: state afterwards",
            cut.for_ms
        ),
        if live { "armed" } else { "faulted or stopped" },
        "armed",
    ));
    client.stop()?;
    Ok(())
}

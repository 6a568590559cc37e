//! Guidance over a link that fails.

use std::time::{Duration, Instant};

use mortise_bake::Grabbable;
use mortise_guide::GuideSettings;
use mortise_protocol::message::{DeviceState, Telemetry, ToDevice};
use mortise_protocol::parameter::ParameterId;
use mortise_rig::{Client, Faults, RigSpec, Window};

use crate::LabError;
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::guided::{SIM, inserted, insertion, key, largest_step, play_to};
use crate::scenario::{PreparedScene, Recording, Scenario};
use crate::variant::Variant;

/// Ticks between what the guide hears.
const HEAR_TICKS: u32 = 10;
/// Largest step between two ticks while only guidance changes.
const FORCE_N: f64 = 0.05;
const TORQUE_MNM: f64 = 2.0;
/// Cut of the link while the peg is held half-way, ms.
const CUT: Window = Window {
    at_ms: 1500,
    for_ms: 450,
};

/// When the hand holds still, and nothing swings any more, ms.
const HELD_MS: [usize; 2] = [1450, 2350];

/// Half-way in by 1.2 s, held there until 2.4 s, through by 3.6 s.
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

/// A fault of the board is an outcome here, not an error.
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
        Err(fault @ LabError::Fault { .. }) => Ok(Err(fault.to_string())),
        Err(other) => Err(other),
    }
}

/// Every row about a link that fails.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let (mut still, held_scene) = prepared(1.0)?;
    still.hand.tremor_mm = 0.0;
    cut(&still, &held_scene, out)?;
    let (scenario, scene) = prepared(0.02)?;
    let stall = Faults {
        stall: vec![
            Window {
                at_ms: 1600,
                for_ms: 200,
            },
            Window {
                at_ms: 500,
                for_ms: 200,
            },
        ],
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
    let mut cases = vec![
        ("nothing is wrong", Faults::default()),
        ("two stalls of 200 ms", stall),
        ("everything 100 ms late", late),
        ("30 % lost, first seed", lost(1)),
    ];
    if !plan.quick {
        cases.extend([
            ("30 % lost, second seed", lost(2)),
            ("30 % lost, third seed", lost(3)),
            ("lost, damaged, repeated, out of order, late, flooded", bad(1)),
        ]);
    }
    let mut sound = None;
    for (name, faults) in cases {
        held(&still, &held_scene, name, faults.clone(), out)?;
        let steps = through(&scenario, &scene, name, faults, sound, out)?;
        // The first is the sound one.
        sound = sound.or(steps);
    }
    by_the_clock(&scene, out)
}

/// The insertion of the 20 µm fit over a link with `faults`; its largest steps of force (N) and torque (N m), held against those over a `sound` link.
fn through(
    scenario: &Scenario,
    scene: &PreparedScene,
    name: &str,
    faults: Faults,
    sound: Option<(f64, f64)>,
    out: &mut dyn FnMut(Row),
) -> Result<Option<(f64, f64)>, LabError> {
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
    let limit = |id: ParameterId| f64::from(id.row().default);
    let (force, torque) = largest_step(&recording.samples);
    // A tick is 1 ms: slew limits of 1 N/s allow 1 mN in one.
    out(Row::at_most(
        what("largest step of force between two ticks, landing included"),
        force,
        "N",
        1e-3 * limit(ParameterId::ForceSlew),
    ));
    out(Row::at_most(
        what("largest step of torque likewise"),
        1e3 * torque,
        "mN m",
        limit(ParameterId::TorqueSlew),
    ));
    if let Some(sound) = sound {
        out(Row::at_most(
            what("largest step of force, more than over a sound link"),
            force - sound.0,
            "N",
            FORCE_N,
        ));
        out(Row::at_most(
            what("largest step of torque, more than over a sound link"),
            1e3 * (torque - sound.1),
            "mN m",
            TORQUE_MNM,
        ));
    }
    out(Row::at_most(
        what("largest force"),
        recording.outcome.peak_force_n,
        "N",
        limit(ParameterId::ForceLimit),
    ));
    Ok(Some((force, torque)))
}

/// A peg held half-way, 1 mm off without tremor, over a link with `faults`: only guidance could change what is felt.
fn held(
    still: &Scenario,
    scene: &PreparedScene,
    name: &str,
    faults: Faults,
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
    let most = engagements(held).fold(0.0, f32::max);
    out(Row::exactly(what("largest engagement"), f64::from(most), "", 1.0));
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

/// Steps while nothing but guidance changes.
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

/// The same when the link is cut: guidance runs out and comes again.
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

/// By the wall clock, where the board counts the host's silence: a part in hand outlives a cut of 300 ms.
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

//! Targets never switch abruptly: force when a target arrives, leaves or expires; and escape from it with a stronger hand.

use mortise_bake::Grabbable;
use mortise_protocol::message::{ConstraintTarget, Telemetry, ToDevice};
use mortise_scenario::wire::pose_mm;
use mortise_scenario::{PreparedScene, Recording, Scenario};

use super::cost::peg_in_hole;
use crate::LabError;
use crate::figures::Row;
use crate::fit::Fit;
use crate::guided::{SIM, insertion, key, largest_step, play_to};
use crate::variant::Variant;

/// Largest change of force, N, and torque between two ticks.
const FORCE_N: f64 = 0.05;
const TORQUE_MNM: f64 = 2.0;
/// Tolerance of the cap: the coupling's share of it that already sets the part in motion, N, and a share of the cap.
const CAP_WITHIN_N: f64 = 0.1;
const CAP_WITHIN_SHARE: f64 = 0.03;
/// Escaped: distance from the axis, mm, and the longest time that may take, ms.
const AWAY_MM: f64 = 5.0;
const AWAY_MS: f64 = 200.0;
/// Held: largest distance from the axis, mm.
const HELD_MM: f64 = 0.1;

/// The thesis pair with 1 mm clearance, and a hand that moves the peg along `keys`; telemetry each tick.
fn prepared(
    engaged_mm: f64,
    keys: &[(f64, [f64; 3], [f64; 3])],
) -> Result<(Scenario, PreparedScene), LabError> {
    let fit = Fit::thesis(1.0).engaged(engaged_mm);
    let file = fit.file()?;
    let mut scenario = insertion(&fit, file.path())?;
    scenario.hand.tremor_mm = 0.0;
    scenario.hand.keyframes = keys
        .iter()
        .map(|&(t, offset, turn)| key(t, offset, turn))
        .collect();
    scenario.run.telemetry_every_ticks = 1;
    let options = Variant::field(0.5).options(Grabbable::Named(vec!["peg".into()]));
    let scene = PreparedScene::with(&scenario, &options)?;
    Ok((scenario, scene))
}

fn target(cap_n: f32) -> Result<ConstraintTarget, LabError> {
    Ok(ConstraintTarget {
        force_cap: cap_n,
        ..peg_in_hole(&Fit::thesis(1.0).engaged(-20.0))?
    })
}

/// Number of ticks since the hand's start.
fn since_start() -> impl FnMut(&Telemetry) -> u32 {
    let mut start = None;
    move |sample| sample.tick - *start.get_or_insert(sample.tick)
}

/// A peg 20 mm in its hole, held 1 mm and 2° off: a target arrives and expires, another arrives and is cleared.
pub(super) fn come_and_go(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    const COMES: u32 = 1000;
    const RUNS_OUT: u32 = 1500;
    const COMES_AGAIN: u32 = 2200;
    const CLEARED: u32 = 2700;
    const END: u32 = 3400;
    let still = ([1.0, 0.0, 0.0], [0.0, 2.0, 0.0]);
    let (mut scenario, scene) = prepared(20.0, &[(0.0, [0.0; 3], [0.0; 3]), (0.3, still.0, still.1)])?;
    scenario.run.duration_s = 1e-3 * f64::from(END);
    let target = target(3.0)?;
    let set = |sequence: u16, expiry: u32| {
        ToDevice::SetTarget(ConstraintTarget {
            sequence,
            expiry_ticks: expiry as u16,
            ..target.clone()
        })
    };
    let mut at = since_start();
    let mut listener = |sample: &Telemetry| match at(sample) {
        COMES => vec![set(1, RUNS_OUT - COMES)],
        COMES_AGAIN => vec![set(2, 10_000)],
        CLEARED => vec![ToDevice::ClearTarget { id: target.id }],
        _ => Vec::new(),
    };
    let recording = play_to(&scenario, &scene, &SIM, &mut listener)?;
    let between = |from: u32, to: u32| &recording.samples[from as usize - 50..to as usize - 50];
    let engaged = |samples: &[Telemetry]| samples.iter().map(|s| s.guidance.engagement).fold(0.0, f32::max);
    for (name, from, to) in [
        ("engages", COMES, RUNS_OUT),
        ("expires", RUNS_OUT, COMES_AGAIN),
        ("is cleared", CLEARED, END),
    ] {
        let samples = between(from, to);
        // Without an engaged target the rows would prove nothing.
        let (force, torque) = if engaged(samples) == 1.0 {
            largest_step(samples)
        } else {
            (f64::NAN, f64::NAN)
        };
        let what = |of: &str| {
            format!("a target {name}, hand 1 mm and 2° off: largest step of {of} between two ticks")
        };
        out(Row::at_most(what("force"), force, "N", FORCE_N));
        out(Row::at_most(what("torque"), 1e3 * torque, "mN m", TORQUE_MNM));
    }
    Ok(())
}

/// Pulls a peg above its hole, where only the target holds it, aside at 40 mm/s.
pub(super) fn leave(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    for cap_n in [1.0, 3.0, 8.0] {
        let keys = [
            (0.0, [0.0; 3], [0.0; 3]),
            (0.5, [0.0; 3], [0.0; 3]),
            (1.75, [50.0, 0.0, 0.0], [0.0; 3]),
        ];
        let (mut scenario, scene) = prepared(-5.0, &keys)?;
        scenario.run.duration_s = 1.8;
        let target = target(cap_n)?;
        let mut at = since_start();
        let mut listener = |sample: &Telemetry| match at(sample) {
            50 => vec![ToDevice::SetTarget(ConstraintTarget {
                expiry_ticks: 10_000,
                ..target.clone()
            })],
            _ => Vec::new(),
        };
        let recording = play_to(&scenario, &scene, &SIM, &mut listener)?;
        let left = left(&recording);
        let what = |of: &str| format!("guided axis left sideways, cap {cap_n} N: {of}");
        let cap = f64::from(cap_n);
        let within = CAP_WITHIN_N + CAP_WITHIN_SHARE * cap;
        out(Row::within(
            what("force at the handle that overcomes it"),
            left.force_n,
            "N",
            cap - within,
            cap + within,
        ));
        out(Row::at_most(
            what(&format!("{AWAY_MM} mm away after")),
            left.ms,
            "ms",
            AWAY_MS,
        ));
        out(Row::at_most(
            what("largest step of force between two ticks"),
            left.step_n,
            "N",
            FORCE_N,
        ));
    }
    Ok(())
}

struct Left {
    force_n: f64,
    ms: f64,
    step_n: f64,
}

fn left(recording: &Recording) -> Left {
    let mut left = Left {
        force_n: f64::NAN,
        ms: f64::NAN,
        step_n: f64::NAN,
    };
    let mut held_until = None;
    for (i, sample) in recording.samples.iter().enumerate() {
        let Some((_, pose)) = &sample.object else { continue };
        let aside = pose_mm(pose).translation.x.abs();
        if aside <= HELD_MM {
            held_until = Some(i);
            left.force_n = f64::from(sample.wrench.force[0]).abs();
        } else if aside >= AWAY_MM
            && let Some(from) = held_until
        {
            left.ms = f64::from(sample.tick - recording.samples[from].tick);
            left.step_n = largest_step(&recording.samples[from..=i]).0;
            break;
        }
    }
    left
}

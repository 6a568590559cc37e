//! What targets cost the board: the dearest tick with four of them in force against the same motion without.

use mortise_bake::Grabbable;
use mortise_protocol::message::{ConstraintTarget, Telemetry, ToDevice};

use crate::LabError;
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::guided::{emulated, insertion, known_target, play_to};
use crate::motion::{Motion, script};
use crate::rate::{self, Mode};
use crate::scenario::{PreparedScene, Recording};
use crate::variant::Variant;

const TARGETS: u16 = 4;
/// Times the instructions without.
const RATIO: f64 = 1.2;
/// In a guided tick, at most.
const INSTRUCTIONS: f64 = 120_000.0;
/// Ticks between refreshes, and until a target that is not refreshed expires.
const REFRESH_TICKS: u32 = 100;
const EXPIRY_TICKS: u16 = 300;

/// Sends one target under four numbers, again and again.
fn four(target: &ConstraintTarget) -> impl FnMut(&Telemetry) -> Vec<ToDevice> {
    let (target, mut due, mut sequence) = (target.clone(), None, 0u16);
    move |sample| {
        if due.is_some_and(|due| sample.tick < due) {
            return Vec::new();
        }
        due = Some(sample.tick + REFRESH_TICKS);
        sequence += 1;
        (1..=TARGETS)
            .map(|id| {
                ToDevice::SetTarget(ConstraintTarget {
                    id,
                    sequence,
                    expiry_ticks: EXPIRY_TICKS,
                    ..target.clone()
                })
            })
            .collect()
    }
}

/// The target that the guide makes of the first touch of the pair.
pub(super) fn peg_in_hole(fit: &Fit) -> Result<ConstraintTarget, LabError> {
    let file = fit.file()?;
    let mut scenario = insertion(fit, file.path())?;
    scenario.run.telemetry_every_ticks = 10;
    let options = Variant::field(1.0).options(Grabbable::Named(vec!["peg".into()]));
    let scene = PreparedScene::with(&scenario, &options)?;
    known_target(&scenario, &scene)
}

/// Insertions with a hand off by four fifths of the play, the target known from the start or recognised on the desktop: no tick may take more
/// than contact alone is bounded by.
pub(super) fn guided_ticks(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let pairs = &rate::PAIRS[..rate::QUICK];
    let modes: &[Mode] = if plan.quick {
        &[Mode::Recognised]
    } else {
        &[Mode::Guided, Mode::Recognised]
    };
    for course in rate::played(pairs, modes, &mut |_| {})? {
        let pair = pairs.iter().find(|pair| pair.name == course.pair);
        let what = format!(
            "{}, {}, emulated board: largest instructions of a guided tick",
            pair.map_or(course.pair, |pair| pair.what),
            course.mode.name()
        );
        out(Row::at_most(
            what,
            f64::from(course.instructions_max),
            "instructions",
            INSTRUCTIONS,
        ));
    }
    Ok(())
}

/// The 20 µm fit pressed to the wall and slid, so that contact is at its dearest, and on its way in.
pub(super) fn four_targets(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let fit = Fit::thesis(0.02);
    let target = peg_in_hole(&fit.engaged(-20.0))?;
    let variant = Variant::field(0.5);
    let (pressed, mut scenario) = script(&fit, Motion::Pressed { mm_per_s: 10.0 })?;
    let file = pressed.file()?;
    scenario.scene.step = file.path().to_owned();
    let options = variant.options(Grabbable::Named(vec!["peg".into()]));
    let scene = PreparedScene::with(&scenario, &options)?;
    let without = {
        let mut silent = |_: &Telemetry| Vec::new();
        play_to(&scenario, &scene, &emulated(), &mut silent)?
    };
    // 4 × 0.5 N leave 3 of the 5 N to the wall: all contacts are still there. The default caps hold the peg off it.
    for (cap_n, what) in [
        (0.5, "which the hand overcomes"),
        (target.force_cap, "which hold it"),
    ] {
        let target = ConstraintTarget {
            force_cap: cap_n,
            ..target.clone()
        };
        let with = play_to(&scenario, &scene, &emulated(), &mut four(&target))?;
        let what = |of: &str| {
            format!(
                "20 µm fit fully inserted, pressed with 5 N and slid, {TARGETS} targets of {cap_n} N {what}, emulated board: {of}"
            )
        };
        let active = (with.samples.iter()).map(|sample| sample.guidance.active).max();
        out(Row::exactly(
            what("most targets active"),
            active.map_or(f64::NAN, f64::from),
            "targets",
            f64::from(TARGETS),
        ));
        out(Row::at_most(
            what("instructions of the longest tick over those without"),
            most(&with) / most(&without),
            "",
            RATIO,
        ));
    }
    out(Row::told(
        "the same without targets: instructions in the longest tick",
        most(&without),
        "instructions",
    ));
    Ok(())
}

fn most(recording: &Recording) -> f64 {
    (recording.outcome.instructions_per_tick_max).map_or(f64::NAN, f64::from)
}

//! Cost of targets on the board: the worst-case tick with four of them in force against the same motion without them.

use mortise_bake::Grabbable;
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Telemetry, ToDevice};
use mortise_scenario::{PreparedScene, Recording};

use crate::LabError;
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::guided::{emulated, insertion, known_target, play_to};
use crate::motion::{Motion, script};
use crate::rate::{self, Mode};
use crate::variant::Variant;

const TARGETS: f64 = 4.0;
/// Largest ratio of the instructions with targets to those without.
const RATIO: f64 = 1.2;
/// Largest number of instructions of a tick with targets and without: a quarter of the 480,000 of a millisecond, plus 10 µs' worth.
const GUIDED: f64 = 125_000.0;
const UNGUIDED: f64 = GUIDED;
/// Ticks between refreshes, and until a target that is not refreshed expires.
const REFRESH_TICKS: u32 = 100;
const EXPIRY_TICKS: u16 = 300;

/// Four different targets that a peg on its axis satisfies at once: the hole's axis, its top's plane, and each end of the peg's axis on the hole's,
/// as a ball in a bore and as a bore on a ball. Each adds rows of its own to every solve.
fn different(axis: &ConstraintTarget, fit: &Fit) -> [ConstraintTarget; 4] {
    let along = |by_mm: f64| {
        let mut target = axis.clone();
        let by = (1e-3 * by_mm) as f32;
        for i in 0..3 {
            target.moving.point[i] += by * target.moving.direction[i];
        }
        target.faces.clear();
        target
    };
    let end = 0.25 * fit.length_mm;
    [
        axis.clone(),
        ConstraintTarget {
            kind: ConstraintKind::Coplanar,
            ..along(0.0)
        },
        ConstraintTarget {
            kind: ConstraintKind::Annular,
            ..along(end)
        },
        ConstraintTarget {
            kind: ConstraintKind::AnnularBore,
            ..along(-end)
        },
    ]
}

/// Sends the targets under consecutive ids and refreshes them.
fn all_of(targets: [ConstraintTarget; 4]) -> impl FnMut(&Telemetry) -> Vec<ToDevice> {
    let (mut due, mut sequence) = (None, 0u16);
    move |sample| {
        if due.is_some_and(|due| sample.tick < due) {
            return Vec::new();
        }
        due = Some(sample.tick + REFRESH_TICKS);
        sequence += 1;
        (1..)
            .zip(&targets)
            .map(|(id, target)| {
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

/// The target that the guide creates at the first touch of the pair.
pub(super) fn peg_in_hole(fit: &Fit) -> Result<ConstraintTarget, LabError> {
    let file = fit.file()?;
    let mut scenario = insertion(fit, file.path())?;
    scenario.run.telemetry_every_ticks = 10;
    let options = Variant::field(1.0).options(Grabbable::Named(vec!["peg".into()]));
    let scene = PreparedScene::with(&scenario, &options)?;
    known_target(&scenario, &scene)
}

/// Insertions with a hand off by four fifths of the clearance: by collision alone, with the target known from the start, and with the target
/// recognised on the desktop.
pub(super) fn guided_ticks(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let pairs = &rate::PAIRS[..rate::QUICK];
    let modes: &[Mode] = if plan.quick {
        &[Mode::Collision, Mode::Recognised]
    } else {
        &rate::MODES
    };
    for course in rate::played(pairs, modes, &mut |_| {})? {
        let pair = pairs.iter().find(|pair| pair.name == course.pair);
        let what = |of: &str| {
            format!(
                "{}, {}, emulated board: {of}",
                pair.map_or(course.pair, |pair| pair.what),
                course.mode.name()
            )
        };
        let most = match course.mode {
            Mode::Collision => UNGUIDED,
            Mode::Guided | Mode::Recognised => GUIDED,
        };
        out(Row::at_most(
            what("largest instructions of a tick"),
            f64::from(course.instructions_max),
            "instructions",
            most,
        ));
        out(Row::reported(
            what("ticks that left out points"),
            course.left_out_percent,
            "%",
        ));
    }
    Ok(())
}

/// The 20 µm fit pressed to the wall and slid, where contact costs most, and during insertion.
pub(super) fn four_targets(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let fit = Fit::thesis(0.02);
    let axis = peg_in_hole(&fit.engaged(-20.0))?;
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
    counted(
        &|of| {
            format!(
                "20 µm fit fully inserted, {variant}, pressed with 5 N and slid, no target, emulated board: {of}"
            )
        },
        &without,
        out,
    );
    // 4 × 0.5 N leave 3 of the 5 N to the wall, so that all contacts remain. The default caps hold the peg off it.
    for (cap_n, how) in [
        (0.5, "which the hand overcomes"),
        (axis.force_cap, "which hold it"),
    ] {
        let mut targets = different(&axis, &fit);
        for target in &mut targets {
            target.force_cap = cap_n;
        }
        let with = play_to(&scenario, &scene, &emulated(), &mut all_of(targets))?;
        let what = |of: &str| {
            format!(
                "20 µm fit fully inserted, {variant}, pressed with 5 N and slid, {TARGETS} different targets of {cap_n} N {how}, emulated board: {of}"
            )
        };
        let active = (with.samples.iter()).map(|sample| sample.guidance.active).max();
        out(Row::exactly(
            what("most targets active"),
            active.map_or(f64::NAN, f64::from),
            "targets",
            TARGETS,
        ));
        out(Row::at_most(
            what("instructions of the longest tick over those without"),
            most(&with) / most(&without),
            "",
            RATIO,
        ));
        counted(&what, &with, out);
    }
    Ok(())
}

/// The longest tick, and how much it decimated.
fn counted(what: &dyn Fn(&str) -> String, recording: &Recording, out: &mut dyn FnMut(Row)) {
    out(Row::at_most(
        what("instructions in the longest tick"),
        most(recording),
        "instructions",
        GUIDED,
    ));
    out(Row::reported(
        what("ticks that left out points"),
        recording.outcome.degraded_percent,
        "%",
    ));
}

fn most(recording: &Recording) -> f64 {
    (recording.outcome.instructions_per_tick_max).map_or(f64::NAN, f64::from)
}

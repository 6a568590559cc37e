//! Insertions with guidance in the closed loop.

use mortise_bake::Grabbable;
use mortise_protocol::parameter::ParameterId;
use mortise_rig::RigSpec;
use mortise_scenario::{Key, Outcome, PreparedScene};

use crate::LabError;
use crate::exact_fit::{ExactFit, made_from};
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::guided::{Course, Inserted, SIM, course, emulated, inserted, insertion, key, play};
use crate::variant::Variant;

/// Cells, mm.
const CELL_MM: f64 = 0.5;
/// Longest insertion, s of virtual time.
const SECONDS: f64 = 3.0;
/// Largest distance from the axis, µm.
const OFF_AXIS_UM: f64 = 5.0;
/// Largest delay of a peg behind the hand's script, ms: springs in series lag by the root of m/k, a landing by the time guidance takes.
const BEHIND_MS: f64 = 50.0;
/// Deepest penetration, µm: contact between guided faces has an allowance of 0.1 mm, so that a target can pull the part through an edge that it would
/// rest on; and the limit once guidance has settled, when a part should be in place.
const DEEPEST_UM: f64 = 100.0;
const SETTLED_UM: f64 = 5.0;
/// Distance of the leading end from the axis, µm, and tilt, degrees, once guidance has settled: the end of a peg at rest is within 5 µm plus that
/// angle.
const TIP_UM: f64 = 10.0;
const TILT_DEG: f64 = 0.02;
/// The hand that pushes: its spring, N/m, damper, N s/m, and force, N; and the most time it may take beyond a handle alone.
const PUSHED_N_PER_M: f32 = 10.0;
const PUSHED_N_S_PER_M: f32 = 20.0;
const PUSHED_N: f64 = 2.0;
const PUSHED_TIMES: f64 = 1.5;
/// Clearances of the thesis pair, mm; 0 is an exact fit.
const CLEARANCES_MM: [f64; 7] = [1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.0];
/// The shorter form plays these on the emulated board, and all of them in-process.
const CLEARANCES_QUICK_MM: [f64; 2] = [1.0, 0.0];
/// Value of [`ParameterId::Guidance`] for the blend of the thesis.
const THESIS: f32 = 2.0;

/// ISO 286 H7/g6 at 18 mm at its tightest: the smallest hole (+0) and the largest shaft (−6 µm).
fn iso_fit() -> Fit {
    Fit {
        hole_mm: 18.0,
        peg_mm: 18.0 - 0.006,
        ..Fit::thesis(0.0)
    }
}

struct Played {
    seen: Inserted,
    course: Course,
    outcome: Outcome,
}

fn played(fit: &Fit, variant: &Variant, thesis: bool, specs: &[RigSpec]) -> Result<Vec<Played>, LabError> {
    let file = fit.file()?;
    let mut scenario = insertion(fit, file.path())?;
    if fit.height_mm > 100.0 {
        // Off by more than the clearance, so that they meet: 420 mm at 150 mm/s.
        let aside = 1.0 + 0.5 * fit.clearance_mm();
        scenario.hand.keyframes.truncate(1);
        for (t, down) in [(0.6, 17.0), (3.4, fit.height_mm - fit.engaged_mm + 2.0)] {
            (scenario.hand.keyframes).push(key(t, [aside, 0.0, -down], [0.0, 2.0, 0.0]));
        }
        scenario.run.duration_s = 3.9;
    }
    if thesis {
        let name = ParameterId::Guidance.row().name.to_owned();
        scenario.parameters.insert(name, THESIS);
    }
    // Every tick is recorded; the guide receives each tenth, as before.
    scenario.run.heed_every_ticks = Some(scenario.run.telemetry_every_ticks);
    scenario.run.telemetry_every_ticks = 1;
    let options = variant.options(Grabbable::Named(vec![scenario.scene.part.clone()]));
    let scene = made_from(PreparedScene::with(&scenario, &options)?, *fit);
    let exact = ExactFit::of(&scene, *fit);
    specs
        .iter()
        .map(|spec| {
            let recording = play(&scenario, &scene, spec)?;
            Ok(Played {
                seen: inserted(&scenario, &scene, &recording.samples),
                course: course(&exact, &recording.samples),
                outcome: recording.outcome,
            })
        })
        .collect()
}

/// Thesis pairs with clearances from 1 mm to none.
pub(super) fn fits(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let variant = Variant::field(CELL_MM);
    let fits = CLEARANCES_MM
        .iter()
        .map(|&clearance| {
            let quick = CLEARANCES_QUICK_MM.contains(&clearance);
            (Fit::thesis(clearance), format!("{clearance} mm clearance"), quick)
        })
        .chain([(iso_fit(), "H7/g6 at 18 mm, 6 µm clearance".to_owned(), true)]);
    let (mut missed, mut played_on_board) = (0u32, 0);
    let (mut farthest, mut tilt, mut tip, mut deep) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for (fit, name, quick) in fits {
        let specs = [SIM, emulated()];
        let specs = if plan.quick && !quick {
            &specs[..1]
        } else {
            &specs[..]
        };
        let fit = fit.engaged(-20.0);
        for (played, on) in played(&fit, &variant, false, specs)?
            .iter()
            .zip(["in-process", "emulated board"])
        {
            let what = |of: &str| {
                format!("guided insertion, hand 1 mm and 2° off, tremor 0.2 mm at 10 Hz, {name}, {on}: {of}")
            };
            out(Row::at_most(
                what("through after"),
                played.seen.after_s,
                "s",
                SECONDS,
            ));
            out(Row::at_most(
                what("through behind the hand's own way by"),
                1e3 * played.seen.behind_s,
                "ms",
                BEHIND_MS,
            ));
            out(Row::at_most(
                what("deepest penetration in any tick, closed form"),
                1e3 * played.outcome.penetration_mm,
                "µm",
                DEEPEST_UM,
            ));
            tilt = worse(tilt, played.course.tilt_deg);
            tip = worse(tip, played.course.tip_off_mm);
            deep = worse(deep, played.course.penetration_mm);
            farthest = worse(farthest, played.seen.off_axis_mm);
            if on != "in-process" {
                missed += played.outcome.missed_ticks;
                played_on_board += 1;
            }
        }
    }
    out(Row::exactly(
        format!("the {played_on_board} guided insertions on the emulated board: ticks missed at shift=1"),
        f64::from(missed),
        "ticks",
        0.0,
    ));
    out(Row::at_most(
        "all guided insertions: farthest off the axis once guidance has settled",
        1e3 * farthest,
        "µm",
        OFF_AXIS_UM,
    ));
    out(Row::at_most(
        "all guided insertions: farthest of the leading end's middle off the axis once guidance has settled",
        1e3 * tip,
        "µm",
        TIP_UM,
    ));
    out(Row::at_most(
        "all guided insertions: largest tilt once guidance has settled",
        tilt,
        "°",
        TILT_DEG,
    ));
    out(Row::at_most(
        "all guided insertions: deepest penetration once guidance has settled, closed form",
        1e3 * deep,
        "µm",
        SETTLED_UM,
    ));
    pushed(out)?;
    for clearance in [1.0, 0.02] {
        let fit = Fit::thesis(clearance).engaged(-20.0);
        let seen = played(&fit, &variant, true, &[SIM])?[0].seen;
        let what = |what: &str| format!("the same by the thesis' blend, {clearance} mm clearance: {what}");
        out(Row::reported(what("depth reached of 40 mm"), seen.depth_mm, "mm"));
        out(match seen.off_axis_mm {
            off if off.is_finite() => Row::reported(what("farthest off the axis"), 1e3 * off, "µm"),
            _ => Row::noted(what("farthest off the axis"), "guidance never settled"),
        });
    }
    Ok(())
}

/// The larger of the two; NaN where either was never measured.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        f64::NAN
    } else {
        a.max(b)
    }
}

/// A hand that follows no script: it holds the handle 1 mm and 2° off by a soft spring and pushes with a constant force, so contact determines how
/// long the peg takes. A handle alone, a spring and damper under a constant force, takes b/k·ln(1/(1 − k·z/F)).
fn pushed(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    for clearance in [1.0, 0.02] {
        let fit = Fit::thesis(clearance).engaged(-20.0);
        let file = fit.file()?;
        let mut scenario = insertion(&fit, file.path())?;
        let hand = &mut scenario.hand;
        hand.stiffness_n_per_m = PUSHED_N_PER_M;
        hand.damping_n_s_per_m = PUSHED_N_S_PER_M;
        let still = |t: f64, push: f64| Key {
            push_n: [0.0, 0.0, -push as f32],
            ..key(t, [1.0, 0.0, 0.0], [0.0, 2.0, 0.0])
        };
        hand.keyframes = vec![
            key(0.0, [0.0; 3], [0.0; 3]),
            still(0.3, 0.0),
            still(0.301, PUSHED_N),
        ];
        // Twice the time of a handle alone, which is then out at the other end.
        scenario.run.duration_s = 1.7;
        scenario.run.telemetry_every_ticks = 1;
        scenario.run.heed_every_ticks = Some(10);
        let options = Variant::field(CELL_MM).options(Grabbable::Named(vec!["peg".into()]));
        let scene = made_from(PreparedScene::with(&scenario, &options)?, fit);
        let recording = play(&scenario, &scene, &SIM)?;
        let seen = inserted(&scenario, &scene, &recording.samples);
        let what = |of: &str| {
            format!(
                "guided insertion, hand 1 mm and 2° off that pushes with {PUSHED_N} N instead of leading, {clearance} mm clearance, in-process: {of}"
            )
        };
        let way_m = 1e-3 * (fit.height_mm - fit.engaged_mm);
        let (k, b) = (f64::from(PUSHED_N_PER_M), f64::from(PUSHED_N_S_PER_M));
        let alone = b / k * (1.0 / (1.0 - k * way_m / PUSHED_N)).ln();
        out(Row::at_most(
            what("through after the push began, times a handle alone"),
            (seen.after_s - 0.3) / alone,
            "",
            PUSHED_TIMES,
        ));
        out(Row::at_most(
            what("deepest penetration in any tick, closed form"),
            1e3 * recording.outcome.penetration_mm,
            "µm",
            DEEPEST_UM,
        ));
    }
    Ok(())
}

/// Table 6 of the thesis: pegs of 0.65 and 0.69 m, voxels of 10 mm, recognition on.
pub(super) fn large(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    for peg_mm in [650.0, 690.0] {
        let fit = Fit::large(peg_mm).engaged(-20.0);
        let own = Variant::field(10.0);
        let textbook = Variant::textbook(10.0);
        for (variant, thesis) in [(own, false), (textbook, true)] {
            let method = if thesis { "the thesis' blend" } else { "guided" };
            let what = |what: &str| {
                format!(
                    "peg of {peg_mm} mm in the hole of 700 mm, hand off by 1 mm more than the play and 2°, {variant}, {method}: {what}"
                )
            };
            let played = &played(&fit, &variant, thesis, &[SIM])?[0];
            let seen = &played.seen;
            if thesis {
                out(Row::noted(what("what happened"), &happened(seen)));
            } else {
                out(Row::within(
                    what("inserted"),
                    seen.depth_mm,
                    "mm",
                    seen.hole_mm,
                    f64::INFINITY,
                ));
                out(Row::noted(what("what happened"), &happened(seen)));
            }
        }
    }
    Ok(())
}

fn happened(seen: &Inserted) -> String {
    let off = if seen.off_axis_mm.is_finite() {
        format!("at most {:.0} µm off the axis", 1e3 * seen.off_axis_mm)
    } else {
        "never fully engaged".into()
    };
    if seen.after_s.is_finite() {
        format!("inserted after {:.2} s, {off}", seen.after_s)
    } else {
        format!(
            "stuck {:.1} mm deep of {:.0} mm, {off}",
            seen.depth_mm, seen.hole_mm
        )
    }
}

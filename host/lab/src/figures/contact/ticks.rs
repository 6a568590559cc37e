//! Cost of a tick on the emulated board, counted in instructions.

use mortise_bake::SampleFormat;
use mortise_rig::{EmulatedMode, RigSpec};

use super::limits::{CELL_MM, TIGHT_MM};
use crate::LabError;
use crate::clearance::trial;
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::motion::{Motion, play, report};
use crate::variant::Variant;
use mortise_scenario::Outcome;

/// Largest number of instructions of a tick in contact.
const CONTACT: f64 = 120_000.0;
/// Largest number of instructions of a tick in contact with the textbook's shell of 35,000 points.
const CLASSIC: f64 = 240_000.0;
/// Voxels of the textbook's shell, mm: at the 10 mm that the thesis states, Mortise's rule for surface voxels gives fewer points than the thesis
/// counts.
const CLASSIC_VOXEL_MM: f64 = 8.33;
/// Point budget within that limit, in field queries; otherwise a scene is played with 520.
const CLASSIC_BUDGET: f32 = 1185.0;
/// Share of ticks that may decimate, %: the first search of everything around the peg takes more than one tick.
const FIRST_LOOK_PERCENT: f64 = 5.0;
/// Largest number of instructions of a tick in free motion.
const FREE: f64 = 20_000.0;
/// Smallest number of points of the dense shell, as a multiple of the sparse one's.
const DENSER: f64 = 10.0;
/// Largest cost of ten times the points, as a multiple.
const DENSER_COST: f64 = 1.5;

fn emulated() -> RigSpec {
    RigSpec::Emulated {
        mode: EmulatedMode::Lockstep,
        firmware: None,
    }
}

fn most(outcome: &Outcome) -> f64 {
    outcome.instructions_per_tick_max.map_or(f64::NAN, f64::from)
}

/// A scene and motion whose instructions are counted, with their bounds.
struct Counted<'a> {
    variant: &'a Variant,
    fit: &'a Fit,
    motion: Motion,
    /// Point budget other than the board's default.
    point_budget: Option<f32>,
    /// Largest number of instructions a tick.
    bound: f64,
    /// Largest share of ticks that may decimate, %; `None`: reported without a bound.
    degraded_percent: Option<f64>,
}

impl Counted<'_> {
    /// Plays the motion and reports its worst-case tick, the share of decimated ticks, and whether the motion was as specified.
    fn rows(&self, what: &str, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
        let (outcome, broken) = play(
            self.variant,
            self.fit,
            self.motion,
            self.point_budget,
            &emulated(),
        )?;
        out(Row::at_most(
            format!("{what}: instructions in the longest tick"),
            most(&outcome),
            "instructions",
            self.bound,
        ));
        let left_out = format!("{what}: ticks that left out points");
        out(match self.degraded_percent {
            Some(bound) => Row::at_most(left_out, outcome.degraded_percent, "%", bound),
            None => Row::reported(left_out, outcome.degraded_percent, "%"),
        });
        out(Row::same(
            format!("{what}: pressed or moved as meant, no tick missed"),
            if broken.is_empty() { "yes" } else { "no" },
            "yes",
        ));
        for broken in broken {
            eprintln!("{what}: {broken}");
        }
        Ok(())
    }
}

/// The tight fit at the wall, and the same peg in free air: at the cell of the claimed accuracy and insertions, and as a scene is baked by default.
pub(super) fn tight(_: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let fit = Fit::thesis(TIGHT_MM);
    // The finer shell exceeds the budget where it is pressed along both rims; the share of decimated ticks is reported beside.
    for (variant, left_out) in [
        (Variant::field(CELL_MM), None),
        (Variant::board(CELL_MM), Some(FIRST_LOOK_PERCENT)),
    ] {
        Counted {
            variant: &variant,
            fit: &fit,
            motion: Motion::Pressed { mm_per_s: 10.0 },
            point_budget: None,
            bound: CONTACT,
            degraded_percent: left_out,
        }
        .rows(
            &format!("20 µm fit, {variant}, fully inserted, pressed to the wall with 5 N, slid at 10 mm/s"),
            out,
        )?;
        Counted {
            variant: &variant,
            fit: &fit,
            motion: Motion::Free,
            point_budget: None,
            bound: FREE,
            degraded_percent: Some(0.0),
        }
        .rows(&format!("the same peg in free motion, {variant}"), out)?;
    }
    Ok(())
}

/// The thesis' 0.7 m block, with the shell of bounded error, at any speed.
pub(super) fn large(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let variant = Variant::field(10.0).epsilon_mm(0.05);
    let speeds: &[f64] = if plan.quick {
        &[20.0]
    } else {
        &[20.0, 200.0, 1000.0]
    };
    for peg_mm in [690.0, 699.8] {
        for &mm_per_s in speeds {
            Counted {
                variant: &variant,
                fit: &Fit::large(peg_mm),
                motion: Motion::Pressed { mm_per_s },
                point_budget: None,
                bound: CONTACT,
                degraded_percent: None,
            }
            .rows(
                &format!(
                    "hole of 700 mm, peg of {peg_mm} mm, {variant}, pressed to the wall with 5 N, slid at {mm_per_s} mm/s"
                ),
                out,
            )?;
        }
    }
    Ok(())
}

/// The same with the textbook's shell: a point for each voxel that the surface crosses. The thesis counts 35,304 on this peg with voxels of 10 mm and
/// its own rule for surface voxels; Mortise's rule gives as many at [`CLASSIC_VOXEL_MM`].
pub(super) fn large_classic(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let (variant, fit) = (
        Variant::field(10.0)
            .format(SampleFormat::Int8)
            .classic_shell(CLASSIC_VOXEL_MM),
        Fit::large(690.0),
    );
    let what = |what: &str| {
        format!(
            "hole of 700 mm, peg of 690 mm, {variant}, a point for each surface voxel of {CLASSIC_VOXEL_MM} mm, budget of {CLASSIC_BUDGET} look-ups: {what}"
        )
    };
    let report = report(&variant, &fit)?;
    let points = report
        .shapes
        .iter()
        .map(|shape| shape.points.iter().sum::<usize>())
        .max();
    out(Row::within(
        what("points of the peg"),
        points.map_or(f64::NAN, |points| points as f64),
        "points",
        30_000.0,
        40_000.0,
    ));
    out(Row::at_most(
        what("image"),
        report.image_bytes as f64,
        "bytes",
        1.5 * 1024.0 * 1024.0,
    ));
    Counted {
        variant: &variant,
        fit: &fit,
        motion: Motion::Pressed { mm_per_s: 20.0 },
        point_budget: Some(CLASSIC_BUDGET),
        bound: CLASSIC,
        // Result equal to querying every point.
        degraded_percent: Some(FIRST_LOOK_PERCENT),
    }
    .rows(&what("pressed to the wall with 5 N, slid at 20 mm/s"), out)?;
    let speeds: &[f64] = if plan.quick { &[] } else { &[200.0, 1000.0] };
    for &mm_per_s in speeds {
        // At speeds beyond the budget it may decimate, but not miss a tick.
        let motion = Motion::Pressed { mm_per_s };
        let (outcome, _) = play(&variant, &fit, motion, Some(CLASSIC_BUDGET), &emulated())?;
        let what = |of: &str| {
            what(&format!(
                "pressed to the wall with 5 N, slid at {mm_per_s} mm/s: {of}"
            ))
        };
        out(Row::exactly(
            what("missed ticks"),
            f64::from(outcome.missed_ticks),
            "ticks",
            0.0,
        ));
        out(Row::reported(
            what("instructions in the longest tick"),
            most(&outcome),
            "instructions",
        ));
        out(Row::reported(
            what("ticks that left out points"),
            outcome.degraded_percent,
            "%",
        ));
    }
    Ok(())
}

/// Ten times the points, of which few touch.
pub(super) fn more_points(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let fit = Fit::thesis(1.0);
    let sparse = Variant::field(CELL_MM).epsilon_mm(0.05);
    let points = |variant: &Variant| -> Result<usize, LabError> {
        let shapes = report(variant, &fit)?.shapes;
        Ok(shapes
            .iter()
            .map(|shape| shape.points.iter().sum::<usize>())
            .sum())
    };
    let base = points(&sparse)?;
    // The number of points grows at most with the inverse square root of the error bound.
    let mut dense = sparse;
    let mut ratio = 1.0;
    while ratio < DENSER {
        dense = dense.epsilon_mm(0.5 * dense.epsilon_mm.unwrap_or(CELL_MM));
        ratio = points(&dense)? as f64 / base as f64;
    }
    let what = |name: &str, of: &str| {
        format!("ten times the shell points ({ratio:.1} times {base}), 1 mm clearance, {name}: {of}")
    };
    for (name, motion) in [
        ("in free motion", Motion::Free),
        ("tilted by 10°, its rim on the block's top", Motion::Rim),
    ] {
        let counted =
            |variant: &Variant| play(variant, &fit, motion, None, &emulated()).map(|(seen, _)| seen);
        let (few, many) = (counted(&sparse)?, counted(&dense)?);
        compared(&|of| what(name, of), &few, &many, Some(DENSER_COST), out);
    }
    if plan.quick {
        return Ok(());
    }
    // In the hole every point of the peg's side is half a millimetre from a wall: not a sparse contact, reported for comparison.
    let inserted = |variant: &Variant| trial(variant, &fit, &emulated()).map(|(_, outcome)| outcome);
    if let (Some(few), Some(many)) = (inserted(&sparse)?, inserted(&dense)?) {
        compared(&|of| what("on its way into the hole", of), &few, &many, None, out);
    }
    Ok(())
}

/// Cost with many points over the cost with few, and the share of ticks that decimate.
fn compared(
    what: &dyn Fn(&str) -> String,
    few: &Outcome,
    many: &Outcome,
    bound: Option<f64>,
    out: &mut dyn FnMut(Row),
) {
    let (ratio, of) = (
        most(many) / most(few),
        what("times the instructions of the longest tick"),
    );
    out(match bound {
        Some(bound) => Row::at_most(of, ratio, "", bound),
        None => Row::reported(of, ratio, ""),
    });
    for (which, outcome) in [("with few", few), ("with many", many)] {
        out(Row::at_most(
            what(&format!("instructions in the longest tick {which}")),
            most(outcome),
            "instructions",
            CONTACT,
        ));
        out(Row::reported(
            what(&format!("ticks that left out points {which}")),
            outcome.degraded_percent,
            "%",
        ));
    }
}

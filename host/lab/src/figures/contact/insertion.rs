//! Insertions in the closed loop, by collision alone.

use super::limits::{CELL_MM, TIGHT_MM};
use crate::LabError;
use crate::clearance::{CLEARANCES_MM, Trial, smallest, trial};
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::guided::SIM;
use crate::motion::report;
use crate::variant::Variant;

/// Deepest penetration at the forces of these insertions, mm: 1 N on three points (the fewest that carry it), and as much for their spacing.
const DEEPEST_MM: f64 = 5e-3;
/// Smallest depth of the peg, mm: the hand's end position less the lag of its spring.
const THROUGH_MM: f64 = 41.5;
const HAND: &str = "1 mm engaged, hand 0.3 mm and 2° off with 0.1 mm tremor at 10 Hz";

/// The smallest clearance that assembles, each required clearance, and the image size that it takes.
pub(super) fn tight(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    // Includes clearances below the required one, to find the limit.
    let clearances: Vec<f64> = (CLEARANCES_MM.into_iter())
        .filter(|&clearance| clearance <= 1.0 && (!plan.quick || clearance == 1.0 || clearance <= 0.1))
        .collect();
    let variant = Variant::field(CELL_MM);
    let smallest = smallest(&variant, &clearances, &mut |trial| eprintln!("{trial}"))?;
    out(Row::at_most(
        format!("insertion without guidance, {HAND}, {variant}: smallest clearance"),
        1e3 * smallest.unwrap_or(f64::NAN),
        "µm",
        1e3 * TIGHT_MM,
    ));
    let fine = Variant::field(0.5 * CELL_MM);
    for (variant, clearance) in [
        (&variant, 1.0),
        (&variant, 0.1),
        (&variant, TIGHT_MM),
        (&fine, 0.1),
    ] {
        let (trial, _) = trial(variant, &Fit::thesis(clearance), &SIM)?;
        eprintln!("{trial}");
        each(variant, &trial, out);
    }
    let textbook = Variant::textbook(CELL_MM);
    let wide: &[f64] = if plan.quick {
        &[2.0, 1.0, 0.5]
    } else {
        &CLEARANCES_MM
    };
    let beside = crate::clearance::smallest(&textbook, wide, &mut |trial| eprintln!("{trial}"))?;
    let what = format!("the same insertion, {textbook}: smallest clearance of those tried");
    out(match beside {
        Some(mm) => Row::reported(what, 1e3 * mm, "µm"),
        None => Row::noted(what, &format!("none; {} mm does not go", wide[0])),
    });
    let variant = Variant::field(CELL_MM);
    let bytes = report(&variant, &Fit::thesis(TIGHT_MM))?.image_bytes as f64;
    out(Row::at_most(
        format!(
            "image of the {} µm pair at the accuracy above, {variant}",
            1e3 * TIGHT_MM
        ),
        bytes,
        "bytes",
        512.0 * 1024.0,
    ));
    Ok(())
}

/// Result of one insertion, measured on the exact surfaces in every tick.
fn each(variant: &Variant, trial: &Trial, out: &mut dyn FnMut(Row)) {
    let what = |what: &str| {
        let clearance = trial.clearance_mm;
        format!("insertion without guidance, {clearance} mm clearance, {HAND}, {variant}: {what}")
    };
    out(Row::within(
        what("inserted, of 42 mm that the hand wants"),
        trial.inserted_mm.unwrap_or(f64::NAN),
        "mm",
        THROUGH_MM,
        43.0,
    ));
    out(Row::at_most(
        what("deepest penetration in any tick, closed form"),
        1e3 * trial.penetration_mm.unwrap_or(f64::NAN),
        "µm",
        1e3 * DEEPEST_MM,
    ));
    out(Row::at_most(
        what("largest force on the handle"),
        trial.peak_force_n.unwrap_or(f64::NAN),
        "N",
        3.0,
    ));
    out(Row::reported(
        what("ticks that left out points"),
        trial.left_out_percent.unwrap_or(f64::NAN),
        "%",
    ));
}

//! What goes into what, in the closed loop.

use super::{CELL_MM, TIGHT_MM};
use crate::LabError;
use crate::clearance::{CLEARANCES_MM, smallest};
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::motion::report;
use crate::variant::Variant;

/// The smallest clearance that assembles, and the image that takes.
pub(super) fn tight(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    // Below what is asked for too, to tell where it ends.
    let clearances: Vec<f64> = (CLEARANCES_MM.into_iter())
        .filter(|&clearance| clearance <= 1.0 && (!plan.quick || clearance == 1.0 || clearance <= 0.1))
        .collect();
    let variant = Variant::board(CELL_MM);
    let smallest = smallest(&variant, &clearances, &mut |trial| eprintln!("{trial}"))?;
    out(Row::at_most(
        format!(
            "insertion without guidance, 1 mm engaged, hand 0.5° off with 0.1 mm tremor at 10 Hz, {variant}: smallest clearance"
        ),
        1e3 * smallest.unwrap_or(f64::NAN),
        "µm",
        1e3 * TIGHT_MM,
    ));
    let textbook = Variant::textbook(CELL_MM);
    let wide: &[f64] = if plan.quick {
        &[2.0, 1.0, 0.5]
    } else {
        &CLEARANCES_MM
    };
    let beside = crate::clearance::smallest(&textbook, wide, &mut |trial| eprintln!("{trial}"))?;
    let what = format!("the same insertion, {textbook}: smallest clearance of those tried");
    out(match beside {
        Some(mm) => Row::told(what, 1e3 * mm, "µm"),
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

//! What baking takes, and whether every real part can be baked.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use mortise_bake::{Grabbable, bake};
use mortise_brep::{CadModel, load_step};

use crate::figures::{Plan, Row};
use crate::variant::Variant;
use crate::{LabError, corpus};

const ABSENT: &str = "the shared parts are not there; set MORTISE_SHARED to their folder";
const MOTOR: &str = "05_motor/motor_nested.step";
/// Accuracy of the motor, mm.
const ACCURACY_MM: f64 = 0.01;
/// Most seconds it may take on two cores.
const SECONDS: f64 = 60.0;
/// Most that half the cell may cost: surface grows fourfold, and an eighth more is overhead.
const HALF_CELL: f64 = 4.5;

fn baked(path: &Path, model: &CadModel, variant: &Variant) -> Result<(f64, f64), LabError> {
    let start = Instant::now();
    let baked = bake(model, &variant.options(Grabbable::AllButLargest), &|_| {
        ControlFlow::Continue(())
    })
    .map_err(|source| LabError::Bake {
        step: path.display().to_string(),
        source,
    })?;
    Ok((start.elapsed().as_secs_f64(), baked.image.len() as f64))
}

/// The 18-part motor.
pub(super) fn motor(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let what = "18-part motor";
    let Some(cad) = corpus::folder() else {
        out(Row::skipped(what, ABSENT));
        return Ok(());
    };
    let path = cad.join(MOTOR);
    let model = load_step(&path)?;
    let variant = Variant::field(if plan.quick { 2.0 } else { 1.0 }).epsilon_mm(ACCURACY_MM);
    let half = Variant {
        cell_mm: 0.5 * variant.cell_mm,
        ..variant
    };
    let (seconds, bytes) = baked(&path, &model, &variant)?;
    let (half_seconds, half_bytes) = baked(&path, &model, &half)?;
    let what = |what: &str| format!("{} parts of the motor, {variant}: {what}", model.parts.len());
    let time = what("bake on this computer");
    out(if plan.quick {
        Row::told(time, seconds, "s")
    } else {
        Row::at_most(time, seconds, "s", SECONDS)
    });
    out(Row::told(what("image"), bytes, "bytes"));
    let ratio = what("half the cell, times the seconds");
    out(if plan.quick {
        Row::told(ratio, half_seconds / seconds, "")
    } else {
        Row::at_most(ratio, half_seconds / seconds, "", HALF_CELL)
    });
    out(Row::at_most(
        what("half the cell, times the bytes"),
        half_bytes / bytes,
        "",
        HALF_CELL,
    ));
    Ok(())
}

/// Every real file is baked, or refused in one line.
pub(super) fn real_parts(_: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let what = "real files";
    let Some(cad) = corpus::folder() else {
        out(Row::skipped(what, ABSENT));
        return Ok(());
    };
    let (mut files, mut baked, mut long) = (0, 0, 0);
    for path in corpus::step_files(&cad.join("real"))? {
        files += 1;
        let outcome = load_step(&path).map_err(LabError::from).and_then(|model| {
            let options = mortise_bake::BakeOptions::default();
            bake(&model, &options, &|_| ControlFlow::Continue(())).map_err(|source| LabError::Bake {
                step: path.display().to_string(),
                source,
            })
        });
        match outcome {
            Ok(_) => baked += 1,
            Err(error) => {
                let text = error.to_string();
                long += usize::from(text.contains('\n'));
                eprintln!("{}: {text}", path.display());
            }
        }
    }
    out(Row::told(
        format!("{what}: baked"),
        baked as f64,
        &format!("of {files} files"),
    ));
    out(Row::exactly(
        format!("{what}: refused in more than one line"),
        long as f64,
        "files",
        0.0,
    ));
    Ok(())
}

//! Time and size of baking, and whether every real part can be baked.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use mortise_bake::{BakeError, BakeOptions, Grabbable, Request, SignOptions, bake, check_signs};
use mortise_brep::{CadModel, LoadOptions, load_step};
use mortise_scenario::ScenarioError;

use super::limits::ABSENT;
use crate::figures::{Plan, Row};
use crate::variant::Variant;
use crate::{LabError, corpus};

const MOTOR: &str = "05_motor/motor_nested.step";
/// Accuracy of the motor, mm.
const ACCURACY_MM: f64 = 0.01;
/// Longest time, s, on two cores.
const SECONDS: f64 = 60.0;
/// Largest factor on time and size when the cell is halved: surface cells grow fourfold, plus an eighth of overhead.
const HALF_CELL: f64 = 4.5;

/// Cell that is compared with half of it, mm, in the full and in the shorter form.
const COMPARED_MM: f64 = 1.0;
const COMPARED_QUICK_MM: f64 = 2.0;

/// The 18-part motor.
pub(super) fn motor(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let Some(cad) = corpus::folder() else {
        out(Row::skipped("18-part motor", ABSENT));
        return Ok(());
    };
    let path = cad.join(MOTOR);
    let model = load_step(&path)?;
    let what = |what: &str| format!("{} parts of the motor, {what}", model.parts.len());
    // Times are reported, not judged, in the shorter form: it runs as a test beside other programs.
    let timed = |what: String, value: f64, unit: &str, bound: f64| {
        if plan.quick {
            Row::reported(what, value, unit).varies()
        } else {
            Row::at_most(what, value, unit, bound).varies()
        }
    };
    if !plan.quick {
        let (seconds, bytes, met) = planned(&path, &model)?;
        let at = format!("planned and baked at {} µm", 1e3 * ACCURACY_MM);
        out(timed(what(&at), seconds, "s", SECONDS));
        out(Row::reported(what(&format!("{at}: image")), bytes, "bytes"));
        out(Row::same(
            what(&format!("{at}: the accuracy is met")),
            if met { "yes" } else { "no" },
            "yes",
        ));
    }
    let variant = Variant::field(if plan.quick {
        COMPARED_QUICK_MM
    } else {
        COMPARED_MM
    });
    let half = Variant::field(0.5 * variant.cell_mm);
    let (seconds, bytes) = baked(&path, &model, &variant)?;
    let (half_seconds, half_bytes) = baked(&path, &model, &half)?;
    let cells = format!("cells of {} mm instead of {}", half.cell_mm, variant.cell_mm);
    out(timed(
        what(&format!("{cells}: times the seconds")),
        half_seconds / seconds,
        "",
        HALF_CELL,
    ));
    out(Row::at_most(
        what(&format!("{cells}: times the bytes")),
        half_bytes / bytes,
        "",
        HALF_CELL,
    ));
    Ok(())
}

fn baked(path: &Path, model: &CadModel, variant: &Variant) -> Result<(f64, f64), LabError> {
    let start = Instant::now();
    let options = variant.options(Grabbable::AllButLargest);
    let baked = bake(model, &options, &|_| ControlFlow::Continue(())).map_err(refusal(path))?;
    Ok((start.elapsed().as_secs_f64(), baked.image.len() as f64))
}

/// Time, s, size, bytes, and whether the requested accuracy is met.
fn planned(path: &Path, model: &CadModel) -> Result<(f64, f64, bool), LabError> {
    let request = Request {
        accuracy_mm: ACCURACY_MM,
        flash_bytes: u64::from(u32::MAX),
        tick_instructions: None,
        grabbable: Grabbable::AllButLargest,
    };
    let start = Instant::now();
    let planned =
        mortise_bake::plan(model, &request, &|_| ControlFlow::Continue(())).map_err(refusal(path))?;
    Ok((
        start.elapsed().as_secs_f64(),
        planned.image.len() as f64,
        planned.met,
    ))
}

fn refusal(path: &Path) -> impl Fn(BakeError) -> LabError {
    let step = path.display().to_string();
    move |source| {
        let step = step.clone();
        ScenarioError::Bake { step, source }.into()
    }
}

/// Random points over all real parts together, in the full and in the shorter form.
const SIGN_POINTS: usize = 100_000;
const SIGN_POINTS_QUICK: usize = 5_000;
/// Files of the shorter form, bytes at most.
const SMALL_BYTES: u64 = 80 << 10;
/// Cells of the field whose signs are compared, along a part's longest side.
const SIGN_CELLS: f64 = 32.0;
/// Longest time of the CAD kernel for one part, s: its classifier shoots a ray for each point, which takes milliseconds on free-form faces.
const SIGN_LIMIT_S: u64 = 60;

/// A readable real file.
struct RealFile {
    path: PathBuf,
    model: CadModel,
}

/// Every real file is baked, or refused in one line; inside and outside of every closed part are compared with the CAD kernel's own classifier.
pub(super) fn real_parts(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let what = if plan.quick {
        "real files by others, the small ones"
    } else {
        "real files by others"
    };
    let Some(cad) = corpus::folder() else {
        out(Row::skipped(what, ABSENT));
        return Ok(());
    };
    let small = |path: &PathBuf| path.metadata().is_ok_and(|data| data.len() <= SMALL_BYTES);
    let mut paths = corpus::step_files(&cad.join("real"))?;
    paths.retain(|path| !plan.quick || small(path));
    let mut files = Vec::new();
    let (mut baked, mut long) = (0usize, 0usize);
    let mut refused = |error: &LabError| {
        let text = error.to_string();
        eprintln!("{text}");
        long += usize::from(text.contains('\n'));
    };
    for path in &paths {
        let path = path.clone();
        match load_step(&path) {
            Ok(model) => {
                match bake(&model, &BakeOptions::default(), &|_| ControlFlow::Continue(())) {
                    Ok(_) => baked += 1,
                    Err(source) => refused(&refusal(&path)(source)),
                }
                files.push(RealFile { path, model });
            }
            Err(error) => refused(&error.into()),
        }
    }
    out(Row::within(
        format!("{what}: baked, the others refused"),
        baked as f64,
        &format!("of {} files", paths.len()),
        1.0,
        paths.len() as f64,
    ));
    out(Row::exactly(
        format!("{what}: refused in more than one line"),
        long as f64,
        "files",
        0.0,
    ));
    signs(plan, what, &files, out)
}

fn signs(plan: &Plan<'_>, of: &str, files: &[RealFile], out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let shapes: usize = files.iter().map(|file| file.model.shapes.len()).sum();
    let all = if plan.quick {
        SIGN_POINTS_QUICK
    } else {
        SIGN_POINTS
    };
    let options = SignOptions {
        points: all.div_ceil(shapes.max(1)),
        cells: SIGN_CELLS,
        time_limit_s: SIGN_LIMIT_S,
    };
    let (mut closed, mut unanswered, mut points, mut wrong, mut field_wrong) = (0usize, 0usize, 0, 0, 0);
    for RealFile { path, model } in files {
        for (index, shape) in model.shapes.iter().enumerate() {
            let check =
                check_signs(path, &LoadOptions::default(), index, shape, &options).map_err(|error| {
                    LabError::Input {
                        name: path.display().to_string(),
                        what: format!("signs of shape {index} cannot be compared: {error}"),
                    }
                })?;
            // For an open shell the kernel's own answer is meaningless.
            if !check.closed {
                continue;
            }
            if check.points < check.asked {
                let part = format!("{}, shape {index}", path.display());
                eprintln!(
                    "{part}: the CAD kernel decided {} of {} points",
                    check.points, check.asked
                );
            }
            if check.points == 0 {
                unanswered += 1;
                continue;
            }
            closed += 1;
            points += check.points;
            wrong += check.wrong;
            field_wrong += check.field_wrong;
            for example in &check.examples {
                eprintln!("{}, shape {index}: {example:?}", path.display());
            }
        }
    }
    let what =
        |what: &str| format!("{of}, {closed} closed parts, {points} points the CAD kernel decides: {what}");
    out(Row::exactly(
        what("on the wrong side of the exact surface"),
        wrong as f64,
        "points",
        0.0,
    ));
    out(Row::exactly(
        what("on the wrong side of the field, farther from the surface than a cell"),
        field_wrong as f64,
        "points",
        0.0,
    ));
    out(Row::exactly(
        format!("{of}: closed parts at which the CAD kernel decides no point within {SIGN_LIMIT_S} s"),
        unanswered as f64,
        "parts",
        0.0,
    ));
    out(Row::within(
        what("points"),
        points as f64,
        "points",
        all as f64,
        f64::INFINITY,
    ));
    Ok(())
}

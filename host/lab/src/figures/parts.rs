//! The shared test parts through the program's own eyes.

use std::path::Path;
use std::process::Command;

use super::{Plan, Row};
use crate::{LabError, corpus};

const ABSENT: &str = "the shared parts are not there; set MORTISE_SHARED to their folder";

/// `mortise inspect` of every file: parts as written, broken files refused in one line with exit code 2.
pub(super) fn inspect(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let what = "inspect of every shared STEP file: parts as written beside them";
    let Some(cad) = corpus::folder() else {
        out(Row::skipped(what, ABSENT));
        return Ok(());
    };
    let imports = corpus::imports(&cad)?;
    for import in &imports {
        if let Some(wrong) = &import.wrong {
            eprintln!("{} {wrong}", import.file);
        }
    }
    let right = imports.iter().filter(|import| import.wrong.is_none()).count();
    out(Row::exactly(
        what,
        right as f64,
        &format!("of {} files", imports.len()),
        imports.len() as f64,
    ));
    let broken: Vec<_> = imports.iter().filter(|import| import.is_broken()).collect();
    let mut refused = 0;
    for import in &broken {
        refused += usize::from(is_refused(plan.program, &cad.join(&import.file))?);
    }
    out(Row::exactly(
        "inspect of each broken file: one line on standard error, nothing on standard output, exit code 2",
        refused as f64,
        &format!("of {} files", broken.len()),
        broken.len() as f64,
    ));
    Ok(())
}

fn is_refused(program: &Path, file: &Path) -> Result<bool, LabError> {
    let run = Command::new(program)
        .args(["inspect", "--json"])
        .arg(file)
        .output()
        .map_err(|source| LabError::Program {
            program: program.display().to_string(),
            source,
        })?;
    let lines = String::from_utf8_lossy(&run.stderr).lines().count();
    Ok(run.status.code() == Some(2) && lines == 1 && run.stdout.is_empty())
}

/// Every real assembly opened, baked, and one of its parts moved against the others.
pub(super) fn assemblies(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let seconds = if plan.quick { 1.0 } else { 5.0 };
    let what = format!("real assemblies of two parts or more, one part moved for {seconds} s in-process");
    let Some(cad) = corpus::folder() else {
        out(Row::skipped(what, ABSENT));
        return Ok(());
    };
    let moved = corpus::assemblies(&cad, seconds)?;
    for one in &moved {
        match &one.outcome {
            Ok((part, bytes)) => eprintln!("{}: moved {part}, image {bytes} bytes", one.file),
            Err(why) => eprintln!("{}: {why}", one.file),
        }
    }
    let faults = moved.iter().filter(|one| one.failed).count();
    out(Row::within(
        format!("{what}: assemblies"),
        moved.len() as f64,
        "files",
        1.0,
        f64::INFINITY,
    ));
    out(Row::exactly(
        format!("{what}: with a fault"),
        faults as f64,
        "files",
        0.0,
    ));
    let refused = moved
        .iter()
        .filter(|one| one.outcome.is_err() && !one.failed)
        .count();
    out(Row::within(
        format!("{what}: refused in one line"),
        refused as f64,
        "files",
        0.0,
        moved.len() as f64,
    ));
    Ok(())
}

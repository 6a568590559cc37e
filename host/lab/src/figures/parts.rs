//! The shared test parts, read by the program itself.

use std::path::Path;
use std::process::Command;

use super::{Plan, Row};
use crate::{LabError, corpus};

const ABSENT: &str = "the shared parts are not there; set MORTISE_SHARED to their folder";

/// `mortise inspect` of every file: parts as listed, or refused for the listed reason, in one line with exit code 2.
pub(super) fn inspect(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let what = "inspect of every shared STEP file: parts, or the reason of its refusal, as written";
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
    let (mut refused, mut wanted) = (0, 0);
    for import in &imports {
        if let Some(why) = import.refusal() {
            wanted += 1;
            refused += usize::from(is_refused(plan.program, &cad.join(&import.file), why)?);
        }
    }
    out(Row::exactly(
        "inspect of each file that must be refused: its reason in one line on standard error, nothing on standard output, exit code 2",
        refused as f64,
        &format!("of {wanted} files"),
        wanted as f64,
    ));
    Ok(())
}

fn is_refused(program: &Path, file: &Path, why: &str) -> Result<bool, LabError> {
    let run = Command::new(program)
        .args(["inspect", "--json"])
        .arg(file)
        .output()
        .map_err(|source| LabError::Program {
            program: program.display().to_string(),
            source,
        })?;
    let said = String::from_utf8_lossy(&run.stderr);
    Ok(run.status.code() == Some(2)
        && said.lines().count() == 1
        && said.contains(why)
        && run.stdout.is_empty())
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
    let wanted: Vec<&str> = corpus::written::assemblies().collect();
    // The set of assemblies moved must equal the listed one.
    let moves = |file: &str| moved.iter().any(|one| one.file == file && one.outcome.is_ok());
    let right = wanted.iter().filter(|file| moves(file)).count();
    let others = moved
        .iter()
        .filter(|one| !wanted.contains(&one.file.as_str()))
        .count();
    out(Row::exactly(
        format!("{what}: those that are written to be such, and moved"),
        right as f64,
        &format!("of {} files", wanted.len()),
        wanted.len() as f64,
    ));
    out(Row::exactly(
        format!("{what}: with a fault, or not written to be such"),
        (faults + others) as f64,
        "files",
        0.0,
    ));
    Ok(())
}

//! Assembly by task: ways out and proofs that there is none, sequences, and instructions in words. Every way is checked by two engines that share nothing
//! with the search ([`checked`]).

mod checked;
mod extraction;
mod sequences;
mod words;

use std::path::Path;

use mortise_task::Assembly;

use super::{Plan, Row};
use crate::{LabError, corpus};

const ABSENT: &str = "the shared parts are not there; set MORTISE_SHARED to their folder";

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    sequences::own(out)?;
    let Some(cad) = corpus::folder() else {
        for what in [
            "tasks of extraction",
            "pairs that stay together",
            "sequences of whole assemblies",
            "the motor of 18 parts by words",
        ] {
            out(Row::skipped(what, ABSENT));
        }
        return Ok(());
    };
    extraction::measure(&cad, plan, out)?;
    sequences::measure(&cad, plan, out)?;
    words::measure(&cad, out)
}

/// Reads an assembly.
fn load(file: &Path) -> Result<Assembly, LabError> {
    Assembly::new(mortise_brep::load_step(file)?).map_err(|error| refused(file, &error))
}

/// An assembly that cannot be used.
fn refused(file: &Path, error: &dyn std::error::Error) -> LabError {
    LabError::Input {
        name: file.display().to_string(),
        what: error.to_string(),
    }
}

/// A time: judged in the long form alone, since the shorter one runs beside other programs.
fn timed(plan: &Plan<'_>, what: String, seconds: f64, most: f64) -> Row {
    if plan.quick {
        Row::reported(what, seconds, "s").varies()
    } else {
        Row::at_most(what, seconds, "s", most).varies()
    }
}

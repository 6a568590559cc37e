//! Files of assemblies, and rows of times.

use std::path::Path;

use mortise_task::Assembly;

use crate::LabError;
use crate::figures::{Plan, Row};

/// Reads an assembly.
pub(super) fn load(file: &Path) -> Result<Assembly, LabError> {
    Assembly::new(mortise_brep::load_step(file)?).map_err(|error| refused(file, &error))
}

/// An assembly that cannot be used.
pub(super) fn refused(file: &Path, error: &dyn std::error::Error) -> LabError {
    LabError::Input {
        name: file.display().to_string(),
        what: error.to_string(),
    }
}

/// A time: judged in the long form alone, since the shorter one runs beside other programs.
pub(super) fn timed(plan: &Plan<'_>, what: String, seconds: f64, most: f64) -> Row {
    if plan.quick {
        Row::reported(what, seconds, "s").varies()
    } else {
        Row::at_most(what, seconds, "s", most).varies()
    }
}

//! Files of assemblies.

use std::path::Path;

use mortise_task::Assembly;

use crate::LabError;

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

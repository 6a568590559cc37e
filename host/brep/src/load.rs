//! Reading a file: in a child process where there can be one.

use std::ops::ControlFlow;
use std::path::Path;

use crate::assemble::assemble;
use crate::child;
use crate::error::BrepError;
use crate::model::CadModel;
use crate::options::LoadOptions;
use crate::progress::Progress;

/// Reads a STEP file (AP203, AP214, AP242) with the default [`LoadOptions`].
///
/// # Errors
/// One line that states the fault, its place and the remedy; see [`BrepError`].
pub fn load_step(path: impl AsRef<Path>) -> Result<CadModel, BrepError> {
    load_step_with(path, &LoadOptions::default())
}

/// Reads a STEP file.
///
/// The reading runs in a child process once [`child::init`] was called; without it (unit tests of other crates)
/// it runs in this process, where the time and memory limits do not hold and a crash of the kernel is fatal.
///
/// # Errors
/// One line that states the fault, its place and the remedy; see [`BrepError`].
pub fn load_step_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<CadModel, BrepError> {
    load_step_while(path, options, &|_| ControlFlow::Continue(()))
}

/// Reads a STEP file until `progress` ends it. That is called every few milliseconds with the fraction reached, from 0 to 1 and never falling; the child
/// process is gone when this returns. A reading in this process is not interrupted.
///
/// # Errors
/// As [`load_step_with`], and [`BrepError::Cancelled`].
pub fn load_step_while(
    path: impl AsRef<Path>,
    options: &LoadOptions,
    progress: &dyn Fn(f64) -> ControlFlow<()>,
) -> Result<CadModel, BrepError> {
    let path = path.as_ref();
    if child::is_ready() {
        child::load(path, options, progress)
    } else {
        assemble(path, options, &Progress::new(&|fraction| _ = progress(fraction)))
    }
}

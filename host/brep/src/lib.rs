//! STEP files to parts, faces, edges and tessellation: the only crate that uses the CAD kernel.
//!
//! [`load_step`] gives a [`CadModel`] of plain values in millimetres and radians. The text is checked and rewritten here first (`part21`), then read
//! by OpenCASCADE behind one thin bridge (`kernel`), in a separate process (`child`), so that neither a crash, a hang nor excessive memory use of the
//! kernel affects the program. Losses of the import are reported: an error when a solid is missing, a warning otherwise.
//!
//! Programs call [`child::init`] first in `main`.
//!
//! ```no_run
//! fn main() -> Result<(), mortise_brep::BrepError> {
//!     mortise_brep::child::init();
//!     let model = mortise_brep::load_step("pair.step")?;
//!     for part in &model.parts {
//!         println!("{}: {:.1} mm³", part.name, model.shapes[part.shape].volume_mm3);
//!     }
//!     Ok(())
//! }
//! ```

mod assemble;
pub mod child;
mod error;
mod external;
mod free_form;
mod kernel;
mod machine;
mod model;
mod options;
pub mod oracle;
mod part21;
mod recognise;
mod recognise_curve;
mod shape;
mod topology;

pub use error::BrepError;
pub use model::*;
pub use options::{LoadOptions, set_time_limit_s};

use std::path::Path;
use std::sync::atomic::AtomicBool;

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
    load_step_until(path, options, &AtomicBool::new(false))
}

/// Reads a STEP file, and stops within some milliseconds after `cancel` is set: the child process is gone when this returns. A reading in this
/// process is not interrupted.
///
/// # Errors
/// As [`load_step_with`], and [`BrepError::Cancelled`].
pub fn load_step_until(
    path: impl AsRef<Path>,
    options: &LoadOptions,
    cancel: &AtomicBool,
) -> Result<CadModel, BrepError> {
    let path = path.as_ref();
    if child::is_ready() {
        child::load(path, options, cancel)
    } else {
        load_in_process(path, options)
    }
}

fn load_in_process(path: &Path, options: &LoadOptions) -> Result<CadModel, BrepError> {
    assemble::assemble(path, options)
}

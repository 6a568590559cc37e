//! STEP text of an assembly whose parts have moved.

use crate::question::{Answer, Kind};
use crate::{BrepError, LoadOptions, Part, oracle};
use std::path::Path;

/// STEP text (AP214, mm) with the shapes of the file at `path` placed as `parts` state: one level, names and part colours kept, shapes that several
/// parts share written once. The kernel writes the exact surfaces it has read, so geometry agrees to the digits of the text; face colours, PMI and
/// subassemblies are not written.
///
/// # Errors
/// As [`crate::load_step_with`], and [`BrepError::NoSuchShape`] for a part whose shape is not in the file.
///
/// Cost: the file is read again, in a child process if possible (see [`crate::child`]).
pub fn step_text(
    path: impl AsRef<Path>,
    options: &LoadOptions,
    parts: &[Part],
) -> Result<Vec<u8>, BrepError> {
    let path = path.as_ref();
    let shape = parts.iter().map(|part| part.shape).max().unwrap_or(0);
    match oracle::ask(path, options, Kind::Write(parts.to_vec()), shape, &[])? {
        Answer::Text(text) => Ok(text),
        _ => Err(oracle::mismatch(path)),
    }
}

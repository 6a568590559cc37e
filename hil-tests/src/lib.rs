//! Hardware in the loop: the same scenarios and link checks on the simulated rig, the emulated board, and a real one.
//!
//! Scenarios are the files in `scenarios/`; [`scenarios`] lists them, `tests/bench.rs` runs them. [`checks`] tests what no scenario covers: a rig
//! must refuse with a reason, ignore garbage, keep its scene when an upload is interrupted, and stop.

pub mod checks;
mod described;
mod image;
mod motors;
pub mod verdict;

use std::path::{Path, PathBuf};

pub use image::image;

/// Name of a real port, on which everything that needs no simulated hand then runs too.
pub const PORT_VARIABLE: &str = "MORTISE_PORT";

/// Paths of the scenario files, sorted by name.
///
/// # Errors
/// Error of the operating system, or an empty folder.
pub fn scenarios() -> std::io::Result<Vec<PathBuf>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let mut files = Vec::new();
    for entry in std::fs::read_dir(&folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            files.push(path);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(std::io::Error::new(
            std::io::ErrorKind::NotFound,
            format!("no scenario in {}", folder.display()),
        ));
    }
    Ok(files)
}

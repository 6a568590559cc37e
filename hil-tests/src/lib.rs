//! Hardware in the loop: the same scenarios and link checks against the simulated rig, the emulated board, and a real one.
//!
//! Scenarios are the files in `scenarios/`; [`scenarios`] finds them, `tests/bench.rs` runs them. [`checks`] are what a rig must do that no
//! scenario shows: refuse with the reason, survive garbage, keep its scene when an upload is cut off, stop.

pub mod checks;
mod described;
mod image;
pub mod verdict;

use std::path::{Path, PathBuf};

pub use image::image;

/// Names a real port; then everything that needs no simulated hand runs there too.
pub const PORT_VARIABLE: &str = "MORTISE_PORT";

/// The scenario files, by name.
///
/// # Errors
/// What the operating system says; an empty folder.
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

//! Files of the tests.

use std::path::{Path, PathBuf};

use mortise_task::Assembly;

/// An assembly of the repository.
#[allow(dead_code)]
pub fn own(path: &str) -> Assembly {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    Assembly::new(mortise_brep::load_step(file).unwrap()).unwrap()
}

/// Folder of the shared parts; `None`, with a line that says so, where they are absent.
#[allow(dead_code)]
pub fn shared(test: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("MORTISE_SHARED")
        .map_or(beside, PathBuf::from)
        .join("cad");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("{test}: skipped, the shared parts are absent");
    None
}

/// A shared assembly.
#[allow(dead_code)]
pub fn load(folder: &Path, name: &str) -> Assembly {
    Assembly::new(mortise_brep::load_step(folder.join(name)).unwrap()).unwrap()
}

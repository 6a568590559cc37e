//! Files of the tests.

use std::path::PathBuf;

/// Folder of the shared parts; `None` where they are absent.
pub fn shared() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let root = std::env::var_os("MORTISE_SHARED").map_or(beside, PathBuf::from);
    let cad = root.join("cad");
    cad.is_dir().then_some(cad)
}

//! Files of the tests.

use std::path::PathBuf;

use mortise_brep::{CadModel, load_step};

/// Folder of the shared parts; `None` where they are absent.
pub fn shared() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let root = std::env::var_os("MORTISE_SHARED").map_or(beside, PathBuf::from);
    let cad = root.join("cad");
    cad.is_dir().then_some(cad)
}

/// A file of the shared motor; `None`, with a line that says so, where it is absent.
#[allow(dead_code)]
pub fn motor(name: &str) -> Option<CadModel> {
    let file = shared().map(|cad| cad.join("05_motor").join(name));
    let Some(file) = file.filter(|file| file.is_file()) else {
        println!("skipped: no {name} among the shared parts (set MORTISE_SHARED)");
        return None;
    };
    Some(load_step(file).expect("the motor is read"))
}

//! Files of the tests.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use mortise_shapes::Designed;
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

/// A pair of `mortise-shapes` at its designed pose.
#[allow(dead_code)]
pub fn random(seed: u64) -> (Designed, Assembly) {
    let designed = Designed::random(seed);
    let mut file = tempfile::Builder::new().suffix(".step").tempfile().unwrap();
    file.write_all(designed.text().as_bytes()).unwrap();
    let mut model = mortise_brep::load_step(file.path()).unwrap();
    let named = |name: &str| model.parts.iter().position(|part| part.name == name).unwrap();
    let (moving, fixed) = (named("moving"), named("fixed"));
    model.parts[moving].placement = model.parts[fixed].placement * designed.pose();
    (designed, Assembly::new(model).unwrap())
}

//! The content of a STEP file, kept for the next bake: an unchanged file is not read again.
//!
//! It is kept under the SHA-256 of the file's bytes, its name and the options that decide what is read. Only what one file tells without a warning is
//! kept: the files that it refers to can change, or appear, while it does not.

use std::path::Path;

use mortise_bake::Cache;
use mortise_brep::{BrepError, CadModel, LoadOptions, load_step_with};
use sha2::{Digest as _, Sha256};

/// The model in the file at `path`, by the default options.
///
/// # Errors
/// As [`load_step_with`].
pub fn load(path: &Path, cache: &dyn Cache) -> Result<CadModel, BrepError> {
    let options = LoadOptions::default();
    // A file that cannot be read, or is too large, is the reader's to report.
    let length = path.metadata().map_or(u64::MAX, |data| data.len());
    let name = (length <= options.text_limit_bytes)
        .then(|| std::fs::read(path).ok())
        .flatten()
        .map(|bytes| name(path, &bytes, &options));
    let kept = name.as_ref().and_then(|name| cache.get(name));
    if let Some(mut model) = kept.and_then(|bytes| CadModel::from_bytes(&bytes)) {
        model.files = vec![path.to_owned()];
        return Ok(model);
    }
    let model = load_step_with(path, &options)?;
    if model.files.len() == 1
        && model.warnings.is_empty()
        && let Some((name, bytes)) = name.zip(model.to_bytes())
    {
        cache.put(&name, &bytes);
    }
    Ok(model)
}

/// Name of what these bytes tell by these options. Limits do not matter to a reading that succeeds.
fn name(path: &Path, bytes: &[u8], options: &LoadOptions) -> String {
    let decide = (
        options.linear_deflection_mm,
        options.relative_deflection,
        options.angular_deflection_rad,
        options.recognise_mm,
        options.allow_lost_solids,
    );
    let sum = Sha256::digest(bytes);
    let file = path.file_name().unwrap_or_default();
    let sum: String = sum.iter().map(|b| format!("{b:02x}")).collect();
    format!("model-{sum} {decide:?} {file:?}")
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;
    use std::sync::Mutex;

    use super::*;

    #[derive(Default)]
    struct InMemory(Mutex<HashMap<String, Vec<u8>>>);

    impl Cache for InMemory {
        fn get(&self, name: &str) -> Option<Vec<u8>> {
            self.0.lock().expect("no panic").get(name).cloned()
        }

        fn put(&self, name: &str, bytes: &[u8]) {
            self.0
                .lock()
                .expect("no panic")
                .insert(name.to_owned(), bytes.to_vec());
        }
    }

    fn sample() -> Vec<u8> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../lab/data/scene_p.step");
        std::fs::read(path).expect("the sources contain it")
    }

    /// An unchanged file is taken from the cache; a changed one, another name and damaged bytes are not.
    #[test]
    fn only_an_unchanged_file_is_taken_from_the_cache() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a.step");
        std::fs::write(&path, sample()).expect("written");
        let cache = InMemory::default();
        let first = load(&path, &cache).expect("it reads");
        assert_eq!(cache.0.lock().expect("no panic").len(), 1);
        let again = load(&path, &cache).expect("it reads");
        assert_eq!(first.to_bytes(), again.to_bytes());
        // A kept model of another content shows that it is used.
        let mut replaced = first.clone();
        replaced.unit = "kept".to_owned();
        for bytes in cache.0.lock().expect("no panic").values_mut() {
            *bytes = replaced.to_bytes().expect("bytes");
        }
        assert_eq!(load(&path, &cache).expect("it reads").unit, "kept");
        let mut changed = sample();
        changed.extend(b"\n");
        std::fs::write(&path, changed).expect("written");
        assert_eq!(load(&path, &cache).expect("it reads").unit, first.unit);
        let other = folder.path().join("b.step");
        std::fs::write(&other, sample()).expect("written");
        assert_eq!(load(&other, &cache).expect("it reads").unit, first.unit);
        for bytes in cache.0.lock().expect("no panic").values_mut() {
            bytes.truncate(bytes.len() / 2);
        }
        assert_eq!(load(&other, &cache).expect("it reads").unit, first.unit);
    }
}

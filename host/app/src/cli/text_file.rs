//! Small text files that commands read.

use std::io::Read as _;
use std::path::Path;

use anyhow::{Context as _, bail};

/// Largest file, bytes.
const LARGEST: u64 = 1 << 20;

/// The text of a file. `form`: what it is to contain, for the error.
pub fn read(path: &Path, form: &str) -> anyhow::Result<String> {
    let shown = path.display();
    if path.is_dir() {
        bail!("{shown}: is a folder; name a text file");
    }
    let file = std::fs::File::open(path).with_context(|| format!("{shown}: cannot be read"))?;
    let mut text = String::new();
    let read = file.take(LARGEST + 1).read_to_string(&mut text);
    read.with_context(|| format!("{shown}: is not a text; give {form}"))?;
    if text.len() as u64 > LARGEST {
        bail!("{shown}: larger than {LARGEST} bytes; split it");
    }
    Ok(text)
}

//! The sample built into the program: a block with an 18.75 mm hole and a peg 1 mm thinner, 20 mm above it.

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// File name of the sample.
pub const NAME: &str = "pair_d18.75_clear1.00.step";
/// Contents of the sample.
pub const STEP: &[u8] = include_bytes!("../../app/samples/pair_d18.75_clear1.00.step");

/// The sample as a temporary file, removed when dropped: the CAD kernel reads files only.
#[derive(Debug)]
pub struct File {
    folder: PathBuf,
    path: PathBuf,
}

impl File {
    /// Writes the sample to a new private folder among the temporary files.
    ///
    /// # Errors
    /// The operating system's error.
    pub fn write() -> std::io::Result<Self> {
        let folder = new_folder()?;
        let path = folder.join(NAME);
        let made = Self { folder, path };
        std::fs::File::create_new(&made.path)?.write_all(STEP)?;
        Ok(made)
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for File {
    fn drop(&mut self) {
        // Files that cannot be removed are left to the system's cleanup of temporary files.
        let _ = std::fs::remove_file(&self.path);
        let _ = std::fs::remove_dir(&self.folder);
    }
}

/// Creates a new folder; fails when the name exists, so that no folder of another program is ever used.
fn new_folder() -> std::io::Result<PathBuf> {
    let base = std::env::temp_dir();
    for attempt in 0..1_000 {
        let folder = base.join(format!("mortise-{}-{attempt}", std::process::id()));
        match std::fs::create_dir(&folder) {
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            result => return result.map(|()| folder),
        }
    }
    Err(std::io::ErrorKind::AlreadyExists.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_there_and_gone_again() {
        let file = File::write().expect("temporary files can be written");
        let other = File::write().expect("a second one at the same time");
        assert_ne!(file.path(), other.path());
        assert_eq!(std::fs::read(file.path()).expect("there"), STEP);
        let path = file.path().to_owned();
        drop(file);
        assert!(!path.exists());
    }
}

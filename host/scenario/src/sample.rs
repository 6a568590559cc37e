//! The sample that is part of the program: a block with an 18.75 mm hole and a peg 1 mm thinner, 20 mm above it.

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Its file name.
pub const NAME: &str = "pair_d18.75_clear1.00.step";
/// Its text.
pub const STEP: &[u8] = include_bytes!("../../app/samples/pair_d18.75_clear1.00.step");

/// The sample as a file, removed when dropped: the CAD kernel reads files only.
#[derive(Debug)]
pub struct File {
    folder: PathBuf,
    path: PathBuf,
}

impl File {
    /// Writes it to a new folder of its own among the temporary files.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn write() -> std::io::Result<Self> {
        let folder = new_folder()?;
        let path = folder.join(NAME);
        let made = Self { folder, path };
        std::fs::File::create_new(&made.path)?.write_all(STEP)?;
        Ok(made)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for File {
    fn drop(&mut self) {
        // What cannot be removed is left to the system's own tidying of temporary files.
        let _ = std::fs::remove_file(&self.path);
        let _ = std::fs::remove_dir(&self.folder);
    }
}

/// Creating fails when the name is taken, so nobody else's folder is ever used.
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

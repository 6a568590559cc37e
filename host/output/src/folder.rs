//! A folder for several files, such as tables and charts.

use std::path::{Path, PathBuf};

use crate::error::OutputError;
use crate::output::{Existing, Output};

/// A folder for several files; each is written as an [`Output`].
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    existing: Existing,
}

impl Folder {
    /// Creates the folder if necessary and checks each of `names` in it. Call it before the work begins, with every name that may be
    /// written.
    ///
    /// # Errors
    /// As [`Output::new`], for the first name that cannot be written.
    pub fn new(
        path: impl Into<PathBuf>,
        existing: Existing,
        names: &[impl AsRef<Path>],
    ) -> Result<Self, OutputError> {
        let path = path.into();
        std::fs::create_dir_all(&path).map_err(|source| OutputError::Unwritable {
            path: path.clone(),
            source,
        })?;
        let folder = Self { path, existing };
        names.iter().try_for_each(|name| folder.file(name).map(|_| ()))?;
        Ok(folder)
    }

    /// Writes one file, all or nothing.
    ///
    /// # Errors
    /// As [`Output::write`].
    pub fn write(&self, name: impl AsRef<Path>, bytes: &[u8]) -> Result<(), OutputError> {
        self.file(name)?.write(bytes)
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn file(&self, name: impl AsRef<Path>) -> Result<Output, OutputError> {
        Output::new(self.path.join(name), self.existing, &[] as &[&Path])
    }
}

//! A file written where a user says, all or nothing.
//!
//! An [`Output`] is checked before the work begins and again before it is written. It is never a file that the command reads (identified by
//! device and inode, through any link), never anything but a regular file (a symbolic link is not followed), and replaces an existing file
//! only on request. The bytes go to a new file of random name in the same folder, created exclusively, are flushed to the disk, and then
//! take the target's name in one step; without a request to replace, that step fails if the name has been taken meanwhile. So at every
//! moment a target is absent, the old file, or the complete new one.
//!
//! Limit: between the last check and a requested replacement another process of the same user can still change the file of that name.

use std::fs::{File, Metadata, Permissions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

use crate::error::OutputError;
use crate::same;

/// Whether an existing file may be replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// An existing file is an error.
    Keep,
    /// An existing regular file is replaced; its permissions are kept.
    Replace,
}

impl Existing {
    /// The value for the option `--force`.
    pub fn from_force(force: bool) -> Self {
        if force { Self::Replace } else { Self::Keep }
    }
}

/// A file to be written.
#[derive(Clone, Debug)]
pub struct Output {
    path: PathBuf,
    existing: Existing,
    inputs: Vec<PathBuf>,
}

impl Output {
    /// Checks that `path` can become a file and is none of `inputs`. Call it before the work begins.
    ///
    /// # Errors
    /// The reason that prevents it, see [`OutputError`]; also when no file can be created in the folder.
    pub fn new(
        path: impl Into<PathBuf>,
        existing: Existing,
        inputs: &[impl AsRef<Path>],
    ) -> Result<Self, OutputError> {
        let mut output = Self {
            path: path.into(),
            existing,
            inputs: Vec::new(),
        };
        output.add_inputs(inputs)?;
        // Created and removed again: nothing remains if the work is interrupted.
        output.beside()?;
        Ok(output)
    }

    /// Adds files that must not be overwritten and are known only after reading.
    ///
    /// # Errors
    /// The target is one of them.
    pub fn add_inputs(&mut self, inputs: &[impl AsRef<Path>]) -> Result<(), OutputError> {
        self.inputs
            .extend(inputs.iter().map(|input| input.as_ref().to_owned()));
        self.check().map(|_| ())
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file, all or nothing.
    ///
    /// # Errors
    /// As [`Output::new`]; or the disk is full.
    pub fn write(&self, bytes: &[u8]) -> Result<(), OutputError> {
        let replaced = self.check()?;
        let mut file = self.beside()?;
        let fill = || {
            file.write_all(bytes)?;
            if let Some(permissions) = replaced {
                file.as_file().set_permissions(permissions)?;
            }
            file.as_file().sync_all()
        };
        fill().map_err(|source| self.unwritable(source))?;
        let moved = match self.existing {
            Existing::Replace => file.persist(&self.path),
            Existing::Keep => file.persist_noclobber(&self.path),
        };
        moved.map_err(|failed| match failed.error.kind() {
            io::ErrorKind::AlreadyExists => OutputError::Exists {
                path: self.path.clone(),
            },
            _ => self.unwritable(failed.error),
        })?;
        sync(self.folder());
        Ok(())
    }

    /// Permissions of the file to be replaced, if there is one.
    fn check(&self) -> Result<Option<Permissions>, OutputError> {
        if self.path.file_name().is_none() || ends_in_separator(&self.path) {
            return Err(OutputError::NoName {
                path: self.path.clone(),
            });
        }
        // A link is not followed: a planted one could lead to any file.
        let found = match std::fs::symlink_metadata(&self.path) {
            Ok(found) => found,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(self.unwritable(error)),
        };
        if !found.is_file() {
            return Err(OutputError::NotRegular {
                path: self.path.clone(),
                what: kind(&found),
            });
        }
        if let Some(input) = self.inputs.iter().find(|input| same::file(&self.path, input)) {
            return Err(OutputError::Input {
                path: self.path.clone(),
                input: input.clone(),
            });
        }
        match self.existing {
            Existing::Keep => Err(OutputError::Exists {
                path: self.path.clone(),
            }),
            Existing::Replace => Ok(Some(found.permissions())),
        }
    }

    /// A new file of random name in the target's folder, removed when dropped.
    fn beside(&self) -> Result<NamedTempFile, OutputError> {
        let mut builder = Builder::new();
        builder.prefix(".mortise-").suffix(".part").rand_bytes(12);
        // The permissions of any new file, reduced by the user's umask.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        builder.tempfile_in(self.folder()).map_err(|error| {
            let (path, folder) = (self.path.clone(), self.folder().to_owned());
            match error.kind() {
                io::ErrorKind::NotFound => OutputError::NoFolder { path, folder },
                // The kind alone: the error's text names the file of random name.
                kind => OutputError::ClosedFolder {
                    path,
                    folder,
                    source: kind.into(),
                },
            }
        })
    }

    fn folder(&self) -> &Path {
        match self.path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        }
    }

    fn unwritable(&self, source: io::Error) -> OutputError {
        OutputError::Unwritable {
            path: self.path.clone(),
            source,
        }
    }
}

/// Whether the path ends in a separator, which marks a folder and which `Path` drops.
fn ends_in_separator(path: &Path) -> bool {
    let bytes = path.as_os_str().as_encoded_bytes();
    bytes
        .last()
        .is_some_and(|&byte| std::path::is_separator(char::from(byte)))
}

/// Makes the new name durable against loss of power, where the system can: the file itself is on the disk already.
fn sync(folder: &Path) {
    if cfg!(unix) {
        // Some file systems do not sync folders; the file is complete in either case.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}

/// Description of a file that is not regular.
fn kind(found: &Metadata) -> &'static str {
    let kind = found.file_type();
    if kind.is_symlink() {
        return "a symbolic link";
    }
    if kind.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    "not a regular file"
}

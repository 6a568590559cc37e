//! A file written where a user says, all or nothing.
//!
//! An [`Output`] is checked before the work begins and again before it is written. It is never a file that the command reads (the
//! same file by device and inode, whatever link leads to it), never anything but a regular file (a symbolic link is not followed), and replaces
//! an existing file only on request. The bytes go to a new file of random name in the same folder, created exclusively, are flushed to the disk, and
//! then take the target's name in one step; without a request to replace, that step fails when the name is taken meanwhile. So a target is at
//! every moment absent, the old file, or the whole new one.
//!
//! Limit: between the last check and a requested replacement another process of the same user can still change the name's file.

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
    /// An existing regular file is replaced, and its permissions kept.
    Replace,
}

impl Existing {
    /// What the option `--force` asks for.
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
    /// Checks that `path` can become a file and is none of `inputs`. To be called before the work begins.
    ///
    /// # Errors
    /// What stands in the way, see [`OutputError`]; also when the folder takes no new file.
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
        // Made and removed again: nothing stays behind when the work is interrupted.
        output.beside().map_err(|source| output.unwritable(source))?;
        Ok(output)
    }

    /// Further files that must stay as they are, known only after reading.
    ///
    /// # Errors
    /// The target is one of them.
    pub fn add_inputs(&mut self, inputs: &[impl AsRef<Path>]) -> Result<(), OutputError> {
        self.inputs
            .extend(inputs.iter().map(|input| input.as_ref().to_owned()));
        self.check().map(|_| ())
    }

    /// Where the file will be.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file, all or nothing.
    ///
    /// # Errors
    /// As [`Output::new`]; or the disk takes no more.
    pub fn write(&self, bytes: &[u8]) -> Result<(), OutputError> {
        let replaced = self.check()?;
        let file = self
            .beside()
            .and_then(|mut file| {
                file.write_all(bytes)?;
                if let Some(permissions) = replaced {
                    file.as_file().set_permissions(permissions)?;
                }
                file.as_file().sync_all()?;
                Ok(file)
            })
            .map_err(|source| self.unwritable(source))?;
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

    /// Permissions of the file that is to be replaced, if there is one.
    fn check(&self) -> Result<Option<Permissions>, OutputError> {
        if self.path.file_name().is_none() || ends_in_separator(&self.path) {
            return Err(OutputError::NoName {
                path: self.path.clone(),
            });
        }
        // Not followed: a link that someone planted leads to a file of theirs or of ours.
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
    fn beside(&self) -> io::Result<NamedTempFile> {
        let mut builder = Builder::new();
        builder.prefix(".mortise-").suffix(".part").rand_bytes(12);
        // As any new file: what the user's mask leaves of it.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        builder.tempfile_in(self.folder())
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

/// `Path` drops a separator at the end, by which a user says that a folder is meant.
fn ends_in_separator(path: &Path) -> bool {
    let bytes = path.as_os_str().as_encoded_bytes();
    bytes
        .last()
        .is_some_and(|&byte| std::path::is_separator(char::from(byte)))
}

/// Makes the new name last through a power cut, where the system can: the file itself is on the disk already.
fn sync(folder: &Path) {
    if cfg!(unix) {
        // Some file systems do not sync folders; the file is whole either way.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}

/// What a file that is no regular file is.
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
    "no regular file"
}

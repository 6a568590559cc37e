//! Reasons why a file is not written.

use std::path::PathBuf;

/// Reason why a file is not written. Each message is one line: what, where, what to do.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The target is a file that the command reads.
    #[error("{}: is the input {} itself; give another name", .path.display(), .input.display())]
    Input {
        /// Target.
        path: PathBuf,
        /// The same file as an input.
        input: PathBuf,
    },
    /// The target is not a regular file.
    #[error("{}: is {what}, not a regular file; give another name", .path.display())]
    NotRegular {
        /// Target.
        path: PathBuf,
        /// Its type.
        what: &'static str,
    },
    /// The target exists already.
    #[error("{}: exists already; give another name, or --force to replace it", .path.display())]
    Exists {
        /// Target.
        path: PathBuf,
    },
    /// The target names no file.
    #[error("{}: names no file; give the name of a file to write", .path.display())]
    NoName {
        /// Target.
        path: PathBuf,
    },
    /// The folder of the target does not exist.
    #[error("{}: its folder {} does not exist; create it, or give another name", .path.display(), .folder.display())]
    NoFolder {
        /// Target.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
    },
    /// No file can be created in the target's folder.
    #[error("{}: no file can be created in its folder {}: {source}; check the folder's permissions, or give another name", .path.display(), .folder.display())]
    ClosedFolder {
        /// Target.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
        /// The kind of the operating system's error.
        source: std::io::Error,
    },
    /// The system refused.
    #[error("{}: cannot be written: {source}; check the path and its permissions", .path.display())]
    Unwritable {
        /// Target.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
}

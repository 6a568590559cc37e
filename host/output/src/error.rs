//! Why a file is not written.

use std::path::PathBuf;

/// Why a file is not written. Each message is one line: what, where, what to do.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The target is a file that the command reads.
    #[error("{}: is the input {} itself; give another name", .path.display(), .input.display())]
    Input {
        /// Target.
        path: PathBuf,
        /// The input it is.
        input: PathBuf,
    },
    /// The target is something else than a regular file.
    #[error("{}: is {what}, not a regular file; give another name", .path.display())]
    NotRegular {
        /// Target.
        path: PathBuf,
        /// What it is.
        what: &'static str,
    },
    /// There is such a file already.
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
    /// The system refuses.
    #[error("{}: cannot be written: {source}; check the path and its permissions", .path.display())]
    Unwritable {
        /// Target.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
}

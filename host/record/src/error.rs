//! Errors of recordings.

use std::io;
use std::path::PathBuf;

use mortise_rig::RigError;

/// Why a recording could not be written, read or replayed.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file could not be made or written.
    #[error("the recording {} could not be written: {why}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's or the format's reason.
        why: String,
    },
    /// The file could not be read.
    #[error("the recording {} could not be read: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        error: io::Error,
    },
    /// The file is not a recording of this program.
    #[error("{} is not a recording of Mortise: {why}", path.display())]
    NotOurs {
        /// The file.
        path: PathBuf,
        /// What is wrong or missing.
        why: String,
    },
    /// The file was made with messages of another release.
    #[error(
        "{} was recorded by release {recorded}, whose messages differ from this program's: replay it with that release",
        path.display()
    )]
    OtherRelease {
        /// The file.
        path: PathBuf,
        /// The release that made it.
        recorded: String,
    },
    /// There is nothing to compute again.
    #[error("{} cannot be replayed: {why}", path.display())]
    NothingToReplay {
        /// The file.
        path: PathBuf,
        /// What is missing.
        why: String,
    },
    /// The replay was cancelled.
    #[error("the replay was cancelled")]
    Cancelled,
    /// The rig did not take a message.
    #[error(transparent)]
    Rig(#[from] RigError),
}

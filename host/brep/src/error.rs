//! Why a STEP file could not be read.

use serde::{Deserialize, Serialize};

/// Why a STEP file gave no model. Each message is one line: the fault, its place, the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum BrepError {
    /// The file could not be opened or read.
    #[error("{path}: cannot be read: {reason}; check the path and its permissions")]
    Unreadable {
        /// Path of the file.
        path: String,
        /// The operating system's reason.
        reason: String,
    },
    /// The file has no bytes.
    #[error("{path}: the file is empty; export it again")]
    Empty {
        /// Path of the file.
        path: String,
    },
    /// The file does not begin as ISO 10303-21 requires.
    #[error("{path}: not a STEP file: begins with {found:?} instead of ISO-10303-21; export it as STEP")]
    NotStep {
        /// Path of the file.
        path: String,
        /// The first characters of the file.
        found: String,
    },
    /// The file ends too early.
    #[error("{path}: cut off at line {line}: {missing}; copy or export it again")]
    Truncated {
        /// Path of the file.
        path: String,
        /// Last line of the file.
        line: u32,
        /// What is missing.
        missing: String,
    },
    /// The text violates ISO 10303-21, or contains impossible geometry.
    #[error("{path}: line {line}: {what}; export it again")]
    Invalid {
        /// Path of the file.
        path: String,
        /// Line of the file, from 1.
        line: u32,
        /// What is wrong.
        what: String,
    },
    /// The text is valid but contains no solid and no surface.
    #[error("{path}: holds no solid or surface ({found}); export the parts as solids")]
    NoShape {
        /// Path of the file.
        path: String,
        /// Content of the file instead.
        found: String,
    },
    /// The CAD kernel returned fewer solids than the file contains.
    #[error("{path}: the CAD kernel lost {lost} of {total} solids: {which}; repair or export it again")]
    SolidsLost {
        /// Path of the file.
        path: String,
        /// Number of missing solids.
        lost: usize,
        /// Number of solids in the file.
        total: usize,
        /// The first missing solid, and the kernel's reason if it gave one.
        which: String,
    },
    /// The CAD kernel failed.
    #[error("{path}: the CAD kernel failed: {reason}; repair or export it again")]
    Kernel {
        /// Path of the file.
        path: String,
        /// The kernel's message.
        reason: String,
    },
    /// A query about a shape that the file does not have.
    #[error("{path}: no shape number {shape}: the file has {count}; choose one of those")]
    NoSuchShape {
        /// Path of the file.
        path: String,
        /// Index of the queried shape, from 0.
        shape: usize,
        /// Number of shapes in the file.
        count: usize,
    },
    /// The process that reads the file died.
    #[error("{path}: the CAD kernel crashed on it ({how}); repair or export it again")]
    Crashed {
        /// Path of the file.
        path: String,
        /// Signal or exit code, and the last line the process wrote.
        how: String,
    },
    /// The process that reads the file took longer than allowed.
    #[error(
        "{path}: not read within {seconds} s of processor time; simplify it, or allow more with --timeout"
    )]
    TimedOut {
        /// Path of the file.
        path: String,
        /// The limit, seconds.
        seconds: u64,
    },
    /// The caller cancelled the reading.
    #[error("{path}: reading cancelled")]
    Cancelled {
        /// Path of the file.
        path: String,
    },
    /// The process that reads the file gave a longer answer than allowed.
    #[error(
        "{path}: gives more than {megabytes} MiB of parts and triangles; simplify it or read a part of it"
    )]
    AnswerTooLong {
        /// Path of the file.
        path: String,
        /// The limit, MiB.
        megabytes: u64,
    },
    /// The assembly has more parts than allowed.
    #[error(
        "{path}: unfolds to {found} parts, but at most {limit} are read; read one of its sub-assemblies instead"
    )]
    TooManyParts {
        /// Path of the file.
        path: String,
        /// Number of parts; [`u64::MAX`] stands for that many or more.
        found: u64,
        /// The limit.
        limit: usize,
    },
    /// A file that another one refers to cannot be used.
    #[error("{path}: line {line}: {what}")]
    Reference {
        /// File that contains the reference.
        path: String,
        /// Line of the reference, from 1.
        line: u32,
        /// The fault and its remedy.
        what: String,
    },
    /// The process that reads the file could not be started, or its answer could not be used.
    #[error("{path}: cannot run the reading process: {reason}")]
    Process {
        /// Path of the file.
        path: String,
        /// What went wrong.
        reason: String,
    },
}

//! Why a STEP file could not be read.

use serde::{Deserialize, Serialize};

/// Why a STEP file gave no model. Each message is one line: what, where, what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum BrepError {
    /// The file could not be opened or read.
    #[error("{path}: cannot be read: {reason}; check the path and its permissions")]
    Unreadable {
        /// The path asked for.
        path: String,
        /// The operating system's reason.
        reason: String,
    },
    /// The file has no bytes.
    #[error("{path}: the file is empty; export it again")]
    Empty {
        /// The path asked for.
        path: String,
    },
    /// The file does not begin as ISO 10303-21 says.
    #[error("{path}: not a STEP file: begins with {found:?} where ISO-10303-21 is due; export it as STEP")]
    NotStep {
        /// The path asked for.
        path: String,
        /// The first characters of the file.
        found: String,
    },
    /// The file ends too early.
    #[error("{path}: cut off at line {line}: {missing}; copy or export it again")]
    Truncated {
        /// The path asked for.
        path: String,
        /// Last line of the file.
        line: u32,
        /// What is missing.
        missing: String,
    },
    /// The text breaks the rules of ISO 10303-21, or says something impossible about geometry.
    #[error("{path}: line {line}: {what}; export it again")]
    Invalid {
        /// The path asked for.
        path: String,
        /// Line of the file, from 1.
        line: u32,
        /// What is wrong.
        what: String,
    },
    /// The text is sound but holds no solid and no surface.
    #[error("{path}: holds no solid or surface ({found}); export the parts as solids")]
    NoShape {
        /// The path asked for.
        path: String,
        /// What it holds instead.
        found: String,
    },
    /// The CAD kernel gave fewer solids than the file holds.
    #[error("{path}: the CAD kernel lost {lost} of {total} solids: {which}; repair or export it again")]
    SolidsLost {
        /// The path asked for.
        path: String,
        /// How many are missing.
        lost: usize,
        /// How many the file holds.
        total: usize,
        /// The first of them, and the kernel's reason if it gave one.
        which: String,
    },
    /// The CAD kernel gave up.
    #[error("{path}: the CAD kernel failed: {reason}; repair or export it again")]
    Kernel {
        /// The path asked for.
        path: String,
        /// The kernel's message.
        reason: String,
    },
    /// A question about a shape the file does not have.
    #[error("{path}: no shape number {shape}: it has {count}; ask about one of those")]
    NoSuchShape {
        /// The path asked for.
        path: String,
        /// The number asked for, from 0.
        shape: usize,
        /// How many the file has.
        count: usize,
    },
    /// The process that reads the file died.
    #[error("{path}: the CAD kernel crashed on it ({how}); repair or export it again")]
    Crashed {
        /// The path asked for.
        path: String,
        /// Signal or exit code, and the last line the process wrote.
        how: String,
    },
    /// The process that reads the file took longer than allowed.
    #[error(
        "{path}: not read within {seconds} s of processor time; simplify it, or allow more with --timeout"
    )]
    TimedOut {
        /// The path asked for.
        path: String,
        /// The limit.
        seconds: u64,
    },
    /// Whoever asked does not want it any more.
    #[error("{path}: reading cancelled")]
    Cancelled {
        /// The path asked for.
        path: String,
    },
    /// The process that reads the file gave a longer answer than allowed.
    #[error(
        "{path}: gives more than {megabytes} MiB of parts and triangles; simplify it or read a part of it"
    )]
    AnswerTooLong {
        /// The path asked for.
        path: String,
        /// The limit.
        megabytes: u64,
    },
    /// The assembly has more parts than allowed.
    #[error(
        "{path}: unfolds to {found} parts where at most {limit} are read; read one of its sub-assemblies instead"
    )]
    TooManyParts {
        /// The path asked for.
        path: String,
        /// How many, [`u64::MAX`] for that many or more.
        found: u64,
        /// The limit.
        limit: usize,
    },
    /// A file that another one refers to cannot be used.
    #[error("{path}: line {line}: {what}")]
    Reference {
        /// The file that refers to it.
        path: String,
        /// Line of the reference, from 1.
        line: u32,
        /// What is wrong, and what to do.
        what: String,
    },
    /// The process that reads the file could not be started or understood.
    #[error("{path}: cannot run the reading process: {reason}")]
    Process {
        /// The path asked for.
        path: String,
        /// What went wrong.
        reason: String,
    },
}

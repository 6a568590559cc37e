//! The record of what the disk has.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::Instant;

use crate::kept::project::Project;
use crate::kept::{Mark, Preferences, StateFolder};

/// What is kept, and what of it is on the disk.
#[derive(Default)]
pub struct Keeper {
    /// The folder; `None`: nothing is kept.
    pub folder: Option<StateFolder>,
    /// As on the disk.
    pub preferences: Preferences,
    /// Projects of this run, by the hash of their model.
    pub projects: BTreeMap<String, Project>,
    /// Hashes of those that the disk does not have as they are.
    pub behind: BTreeSet<String>,
    /// The mark of this window.
    pub mark: Option<Arc<Mark>>,
    /// The model that the mark names.
    pub marked: Option<PathBuf>,
    /// End of the last saving.
    pub last: Option<Instant>,
    /// Reports the end of the saving under way: the reason, and what was not written.
    pub saving: Option<Receiver<Result<(), NotSaved>>>,
    /// Whether the last saving failed: a failure is reported once.
    pub failed: bool,
}

/// A saving that failed.
#[derive(Debug)]
pub struct NotSaved {
    /// One line with the reason.
    pub why: String,
    /// Hashes of the projects that it was to write.
    pub projects: Vec<String>,
}

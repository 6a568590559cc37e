//! What is kept, as far as it is on the disk.

use std::sync::mpsc::Receiver;
use std::time::Instant;

use crate::kept::{Preferences, StateFolder};

/// What is kept, and what of it is on the disk.
#[derive(Default)]
pub struct Keeper {
    /// Where; `None`: nothing is kept.
    pub folder: Option<StateFolder>,
    /// As on the disk.
    pub preferences: Preferences,
    /// End of the last saving.
    pub last: Option<Instant>,
    /// Reports the end of the saving under way.
    pub saving: Option<Receiver<Result<(), String>>>,
    /// Whether the last saving failed, which was said.
    pub failed: bool,
}

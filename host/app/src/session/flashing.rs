//! Firmware for a board: which file, and what the debug probe says while it is written. Pure but for reading the file.

use std::path::{Path, PathBuf};

use mortise_flash::{Firmware, Prober};

use super::threads::Cancel;

/// An action of the operator.
#[derive(Clone, Debug, PartialEq)]
pub enum FlashIntent {
    /// Ask for the file.
    Browse,
    /// Take a file.
    Choose(PathBuf),
    /// Write it to the board.
    Write,
    /// End writing.
    End,
}

/// A report of the thread that writes.
pub enum FlashUpdate {
    /// A line that the debug probe's program said.
    Line(String),
    /// Writing ended: what was done, or one line with the reason why not.
    Ended(Result<String, String>),
}

/// See the module.
#[derive(Default)]
pub struct Flashing {
    pub(super) firmware: Option<Result<Firmware, String>>,
    pub(super) writing: Option<(String, Cancel)>,
    /// Writes through this instead of the program that is installed.
    pub prober: Option<Prober>,
}

impl Flashing {
    /// The file chosen, in words, or why it cannot be written.
    pub fn chosen(&self) -> Option<Result<String, &str>> {
        let chosen = self.firmware.as_ref()?;
        Some(chosen.as_ref().map(Firmware::words).map_err(String::as_str))
    }

    /// While it is written: the last line that was said.
    pub fn writing(&self) -> Option<&str> {
        self.writing.as_ref().map(|(line, _)| line.as_str())
    }

    pub(super) fn choose(&mut self, path: &Path) {
        self.firmware = Some(Firmware::read(path).map_err(|error| error.to_string()));
    }
}

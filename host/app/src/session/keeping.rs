//! Keeping between starts: what has changed is saved by itself, at most every second and a half.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use super::keeper::Keeper;
use super::notes::Severity;
use super::outbox::Update;
use super::state::Session;
use super::threads::spawn;
use crate::kept::{Preferences, StateFolder};

/// Shortest time between two savings.
const EVERY: Duration = Duration::from_millis(1_500);
/// Longest wait at the end for a saving under way.
const LAST_WAIT: Duration = Duration::from_secs(5);

impl Session {
    /// The session with a folder in which preferences are kept. Damaged preferences are set aside, and said.
    pub fn with_state(mut self, folder: Option<StateFolder>) -> Self {
        if let Some(folder) = &folder {
            let path = folder.preferences();
            match crate::kept::read(&path).map(|bytes| bytes.map(|bytes| Preferences::from_json(&bytes))) {
                Ok(None) => {}
                Ok(Some(Ok(preferences))) => self.preferences = preferences,
                Ok(Some(Err(error))) => {
                    let aside = set_aside(&path);
                    let there = path.display();
                    let text = format!(
                        "{there}: the preferences cannot be used: {error}; {aside}, the usual ones apply"
                    );
                    self.notes.add(Severity::Warning, text);
                }
                Err(error) => self.notes.add(Severity::Warning, format!("{error:#}")),
            }
        }
        self.keeper = Keeper {
            folder,
            preferences: self.preferences.clone(),
            ..Keeper::default()
        };
        self.check_recent();
        self
    }

    /// Saves what has changed, if it is time. Returns the time after which it must be called again.
    pub fn keep(&mut self) -> Option<Duration> {
        self.keeper.folder.as_ref()?;
        self.end_saving();
        if self.preferences == self.keeper.preferences {
            return None;
        }
        let since = self.keeper.last.map_or(EVERY, |last| last.elapsed());
        if self.keeper.saving.is_some() || since < EVERY {
            return Some(EVERY.saturating_sub(since).max(Duration::from_millis(50)));
        }
        let write = self.write_preferences()?;
        let (done, saving) = channel();
        spawn("mortise-keep", move || {
            // The session may have ended.
            let _ = done.send(write());
        });
        self.keeper.saving = Some(saving);
        Some(EVERY)
    }

    /// Saves what has changed now, and waits for it: at the end of the program.
    pub(super) fn keep_now(&mut self) {
        if let Some(saving) = self.keeper.saving.take() {
            let _ = saving.recv_timeout(LAST_WAIT);
        }
        if self.preferences != self.keeper.preferences
            && let Some(write) = self.write_preferences()
        {
            // Nobody is left to read an error.
            let _ = write();
        }
    }

    /// What writes the preferences, for any thread; from now on they count as saved. `None`: nothing is kept.
    fn write_preferences(&mut self) -> Option<impl FnOnce() -> Result<(), String> + Send + use<>> {
        let folder = self.keeper.folder.clone()?;
        self.keeper.preferences = self.preferences.clone();
        let text = self.preferences.to_json();
        Some(move || {
            let written = folder.write(&folder.preferences(), &text);
            written.map_err(|error| format!("{error:#}"))
        })
    }

    fn end_saving(&mut self) {
        let result = match self.keeper.saving.as_ref().map(Receiver::try_recv) {
            None | Some(Err(TryRecvError::Empty)) => return,
            Some(Ok(result)) => result,
            Some(Err(TryRecvError::Disconnected)) => Ok(()),
        };
        self.keeper.saving = None;
        self.keeper.last = Some(Instant::now());
        let failed = result.is_err();
        if let Err(why) = result
            && !self.keeper.failed
        {
            let text = format!("What you change is not kept for the next start: {why}");
            self.notes.add(Severity::Warning, text);
        }
        self.keeper.failed = failed;
    }

    /// Puts the open file first among the recent ones.
    pub(super) fn remember_file(&mut self) {
        if let Some(document) = &self.document
            && let Some(Ok(path)) = document.path.as_ref().map(std::path::absolute)
        {
            self.preferences.recent.opened(&path);
        }
        self.check_recent();
    }

    /// Finds out, on a thread of its own, which of the recent files are missing.
    pub(super) fn check_recent(&self) {
        let outbox = self.outbox.clone();
        let paths: Vec<PathBuf> = self.preferences.recent.iter().cloned().collect();
        if paths.is_empty() {
            return;
        }
        spawn("mortise-recent", move || {
            let missing = paths.into_iter().filter(|path| !path.exists()).collect();
            outbox.send(Update::Missing(missing));
        });
    }
}

/// Keeps a file that cannot be used under another name, so that nothing is lost; says what was done.
fn set_aside(path: &Path) -> String {
    let mut name = path.as_os_str().to_owned();
    name.push(".damaged");
    match std::fs::rename(path, &name) {
        Ok(()) => format!("they are kept as {}", Path::new(&name).display()),
        Err(_) => "they will be replaced".to_owned(),
    }
}

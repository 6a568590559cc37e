//! Keeping between starts: preferences and the project save themselves, what has changed, at most every second and a half.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use super::keeper::{Keeper, NotSaved};
use super::notes::Severity;
use super::outbox::Update;
use super::project::{self, Source, capture};
use super::saved::Saved;
use super::state::Session;
use super::threads::spawn;
use crate::kept::project::{Project, absolute};
use crate::kept::{Mark, Preferences, StateFolder, left_open, set_aside};

/// Shortest time between two savings.
const EVERY: Duration = Duration::from_millis(1_500);
/// Time after which what could not be saved is tried again.
const AGAIN: Duration = Duration::from_secs(30);
/// Longest wait at the end for a saving under way.
const LAST_WAIT: Duration = Duration::from_secs(5);

impl Session {
    /// The session with a folder in which preferences and projects are kept. Damaged preferences are set aside, and said.
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
        self.look_for_marks();
        self
    }

    /// Sets the mark of this window, and looks for those of programs that were ended by force.
    fn look_for_marks(&self) {
        let Some(folder) = self.keeper.folder.clone() else {
            return;
        };
        let outbox = self.outbox.clone();
        spawn("mortise-mark", move || {
            let models = left_open(&folder);
            let mark = Mark::set(&folder);
            outbox.send(Update::Marked { models, mark });
        });
    }

    /// Says which models were open in programs that were ended by force.
    pub(super) fn marked(&mut self, models: Vec<PathBuf>, mark: Option<Mark>) {
        self.keeper.mark = mark.map(Arc::new);
        for model in models {
            let text = format!(
                "{} was open when the program was ended by force: open it again, and what was done with it comes back",
                model.display()
            );
            self.notes.add(Severity::Warning, text);
            self.preferences.recent.opened(&model);
        }
        self.check_recent();
    }

    /// Saves what has changed, if it is time. Returns the time after which it must be called again.
    pub fn keep(&mut self) -> Option<Duration> {
        self.keeper.folder.as_ref()?;
        self.end_saving();
        let since = self.keeper.last.map_or(Duration::MAX, |last| last.elapsed());
        let every = if self.keeper.failed { AGAIN } else { EVERY };
        if self.keeper.saving.is_some() || since < every {
            return Some(every.saturating_sub(since).max(Duration::from_millis(50)));
        }
        self.note_project();
        let files = self.files()?;
        let (done, saving) = channel();
        spawn("mortise-keep", move || {
            // The session may have ended.
            let _ = done.send(files.write());
        });
        self.keeper.saving = Some(saving);
        Some(EVERY)
    }

    /// Saves what has changed now, and waits for it: at the end of the program.
    pub(super) fn keep_now(&mut self) {
        if let Some(saving) = self.keeper.saving.take()
            && let Ok(Err(failed)) = saving.recv_timeout(LAST_WAIT)
        {
            self.keeper.behind.extend(failed.projects);
        }
        self.note_project();
        if let Some(files) = self.files() {
            // Nobody is left to read an error.
            let _ = files.write();
        }
    }

    /// Notes what was done with the open document: before another replaces it, and when it is to be saved.
    pub(super) fn note_project(&mut self) {
        // It was noted before the recorded run that moves its parts now.
        if self.replays() {
            return;
        }
        let document = self.document.as_ref().filter(|d| !d.sha256.is_empty());
        let (Some(document), Some(_)) = (document, &self.keeper.folder) else {
            return;
        };
        let project = capture(self, document);
        let sha256 = project.model.sha256.clone();
        if self.keeper.projects.get(&sha256) != Some(&project) {
            self.keeper.projects.insert(sha256.clone(), project);
            self.keeper.behind.insert(sha256);
        }
    }

    /// What the disk does not have; from now on it counts as saved. `None`: nothing.
    fn files(&mut self) -> Option<Files> {
        let folder = self.keeper.folder.clone()?;
        let keeper = &mut self.keeper;
        let preferences = (self.preferences != keeper.preferences).then(|| self.preferences.clone());
        let behind = std::mem::take(&mut keeper.behind);
        let projects = behind
            .into_iter()
            .filter_map(|sha256| Some((keeper.projects.get(&sha256)?.clone(), sha256)))
            .collect::<Vec<_>>();
        let open = (self.document.as_ref())
            .filter(|document| !document.sha256.is_empty())
            .and_then(|document| document.path.as_deref())
            .map(absolute);
        let mark = (keeper.mark.clone()).filter(|_| open != keeper.marked);
        if preferences.is_none() && projects.is_empty() && mark.is_none() {
            return None;
        }
        if let Some(preferences) = &preferences {
            keeper.preferences = preferences.clone();
        }
        if mark.is_some() {
            keeper.marked.clone_from(&open);
        }
        Some(Files {
            folder,
            preferences,
            projects,
            mark: mark.map(|mark| (mark, open)),
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
        if let Err(NotSaved { why, projects }) = result {
            self.keeper.behind.extend(projects);
            if !self.keeper.failed {
                let text = format!("What you change is not kept for the next start: {why}");
                self.notes.add(Severity::Warning, text);
            }
        }
        self.keeper.failed = failed;
    }

    /// Restores the project of the document that was just opened: the one that the user opened, or else what saved itself. The file becomes the newest of the
    /// recent ones.
    pub(super) fn restore(&mut self, saved: Saved) {
        self.fits.clear();
        let touring = self.tour.is_some();
        let Some(document) = &mut self.document else {
            return;
        };
        let (sha256, generation) = (document.sha256.clone(), document.generation);
        let opened = self.pending_project.take();
        let opened = opened.filter(|(wanted, ..)| *wanted == generation);
        let path = match &opened {
            Some((_, _, path)) => Some(path.clone()),
            None => document.path.clone(),
        };
        if touring {
            // A demonstration begins with the file, and leaves the user's project as it is.
            document.sha256.clear();
        }
        if let Some(Ok(path)) = path.map(std::path::absolute) {
            self.preferences.recent.opened(&path);
        }
        self.check_recent();
        let known = self.keeper.projects.get(&sha256).cloned();
        match (opened, known, saved) {
            _ if touring => {}
            (Some((_, project, path)), ..) => project::apply(self, &project, &Source::File(path)),
            // The disk may not have it yet.
            (None, Some(project), _) => project::apply(self, &project, &Source::Autosave),
            (None, None, Saved::Project(project)) => {
                project::apply(self, &project, &Source::Autosave);
            }
            (None, None, Saved::Unusable(why)) => self.notes.add(Severity::Warning, why),
            (None, None, Saved::None) => {}
        }
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

/// What the disk does not have.
struct Files {
    folder: StateFolder,
    preferences: Option<Preferences>,
    projects: Vec<(Project, String)>,
    /// The mark of this window, and the model that it is to name.
    mark: Option<(Arc<Mark>, Option<PathBuf>)>,
}

impl Files {
    /// Writes each file, all or nothing.
    fn write(self) -> Result<(), NotSaved> {
        let mut result = Ok(());
        if let Some(preferences) = &self.preferences {
            result = self
                .folder
                .write(&self.folder.preferences(), &preferences.to_json());
        }
        if let Some((mark, model)) = &self.mark {
            mark.write(model.as_deref());
        }
        let mut failed = Vec::new();
        for (project, sha256) in self.projects {
            let written = self
                .folder
                .write(&self.folder.project(&sha256), &project.to_json());
            if written.is_err() {
                failed.push(sha256);
            }
            result = result.and(written);
        }
        result.map_err(|error| NotSaved {
            why: format!("{error:#}"),
            projects: failed,
        })
    }
}

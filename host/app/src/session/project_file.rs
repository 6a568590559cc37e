//! Project files of the user: opened and written.

use std::path::{Path, PathBuf};

use anyhow::Context as _;

use super::ask::write;
use super::notes::Severity;
use super::outbox::{ProjectFile, Update};
use super::project::capture;
use super::state::Session;
use super::threads::spawn;
use crate::kept;
use crate::kept::project::Project;

/// Whether a path is that of a project file, by its ending.
pub fn is_project(path: &Path) -> bool {
    (path.extension()).is_some_and(|ending| ending.eq_ignore_ascii_case(kept::PROJECT_ENDING))
}

impl Session {
    /// Reads a project file on a thread of its own. Nothing changes before it is known to be sound.
    pub(super) fn read_project(&mut self, path: PathBuf) {
        let outbox = self.outbox.clone();
        spawn("mortise-project", move || {
            let result = read(&path).map_err(|error| format!("{error:#}"));
            outbox.send(Update::ProjectRead { path, result });
        });
    }

    /// Opens the model of a project file, to which the project is applied then.
    pub(super) fn project_read(&mut self, path: PathBuf, result: Result<ProjectFile, String>) {
        let ProjectFile { project, model } = match result {
            Ok(read) => read,
            Err(why) => {
                self.check_recent();
                return self.notes.add(Severity::Error, why);
            }
        };
        if self.is_armed() {
            let text = format!(
                "{}: not opened, because the rig is armed: disarm it first",
                path.display()
            );
            return self.notes.add(Severity::Warning, text);
        }
        self.open(model);
        self.pending_project = Some((self.generation, project, path));
    }

    /// Writes the project to a file of the user.
    pub(super) fn write_project(&mut self, path: PathBuf, replace: bool) {
        let Some(document) = &self.document else { return };
        let project = capture(self, document);
        let path = match path.extension() {
            None => path.with_extension(kept::PROJECT_ENDING),
            Some(_) => path,
        };
        if !is_project(&path) {
            // The ending tells a project from a STEP file when it is opened.
            let text = format!(
                "{}: a project file ends in .{}; give another name",
                path.display(),
                kept::PROJECT_ENDING
            );
            return self.notes.add(Severity::Error, text);
        }
        write(&self.outbox, path, replace, project.to_json());
    }
}

/// The project in a file, and the path of its model: as it says, or beside it under the same name.
fn read(path: &Path) -> anyhow::Result<ProjectFile> {
    let there = path.display();
    let bytes = kept::read(path)?;
    let bytes = bytes.with_context(|| format!("{there}: there is no such file; check the path"))?;
    let project = Project::from_json(&bytes).with_context(|| format!("{there}: not opened"))?;
    let project = Box::new(project);
    let Some(named) = project.model.path.clone() else {
        return Ok(ProjectFile { project, model: None });
    };
    let beside = path.parent().zip(named.file_name());
    let beside = beside.map(|(folder, name)| folder.join(name));
    let places = [Some(named.clone()), beside];
    let found = places.into_iter().flatten().find(|path| path.is_file());
    let model = found.with_context(|| {
        format!(
            "{there}: not opened: its model {} is not there; put it there, or beside the project file",
            named.display()
        )
    })?;
    Ok(ProjectFile {
        project,
        model: Some(model),
    })
}

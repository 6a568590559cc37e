//! What saved itself for a model at an earlier start: looked for beside the window's thread, when the model has been read.

use std::path::Path;
use std::time::SystemTime;

use super::document::Document;
use crate::kept::project::{Project, absolute};
use crate::kept::{PROJECT_ENDING, StateFolder, read, set_aside};

/// What saved itself for a model.
pub enum Saved {
    /// Nothing.
    None,
    /// A project: of the model as it is, or of the model that its path had before.
    Project(Box<Project>),
    /// A file that cannot be used, and is set aside: one line with the reason.
    Unusable(String),
}

impl Saved {
    /// What saved itself for a document.
    pub fn of(folder: &StateFolder, document: &Document) -> Self {
        if document.sha256.is_empty() {
            return Self::None;
        }
        let path = folder.project(&document.sha256);
        match read(&path).and_then(|bytes| bytes.map(|bytes| Project::from_json(&bytes)).transpose()) {
            Ok(Some(project)) => Self::Project(Box::new(project)),
            Ok(None) => {
                let before = document.path.as_deref().and_then(|model| of_path(&path, model));
                before.map_or(Self::None, |project| Self::Project(Box::new(project)))
            }
            Err(error) => {
                let aside = set_aside(&path);
                Self::Unusable(format!(
                    "{}: nothing is restored: {error:#}; {aside}",
                    path.display()
                ))
            }
        }
    }
}

/// The newest project, in the folder of the file `beside`, of a model at the path `model`.
fn of_path(beside: &Path, model: &Path) -> Option<Project> {
    let model = absolute(model);
    let files = std::fs::read_dir(beside.parent()?).ok()?.flatten();
    let mut newest: Option<(SystemTime, Project)> = None;
    for file in files {
        let path = file.path();
        if path.extension().is_none_or(|ending| ending != PROJECT_ENDING) {
            continue;
        }
        // A damaged one of another model is reported when that is opened.
        let written = file.metadata().and_then(|data| data.modified());
        let (Ok(written), Ok(Some(bytes))) = (written, read(&path)) else {
            continue;
        };
        if let Ok(project) = Project::from_json(&bytes)
            && project.model.path.as_ref() == Some(&model)
            && newest.as_ref().is_none_or(|(time, _)| written > *time)
        {
            newest = Some((written, project));
        }
    }
    newest.map(|(_, project)| project)
}

//! The files opened last.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Most files in the list.
pub const MOST_RECENT: usize = 10;

/// The files opened last, newest first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Recent(Vec<PathBuf>);

impl Recent {
    /// Puts a file first.
    pub fn opened(&mut self, path: &Path) {
        // A path that is not text cannot be kept in a file of text.
        if path.to_str().is_some() {
            self.forget(path);
            self.0.insert(0, path.to_owned());
            self.0.truncate(MOST_RECENT);
        }
    }

    /// Takes a file out of the list.
    pub fn forget(&mut self, path: &Path) {
        self.0.retain(|file| file != path);
    }

    /// Newest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &PathBuf> {
        self.0.iter()
    }

    /// At most the largest number, each path once: a file may have been edited by hand.
    pub(super) fn tidied(mut self) -> Self {
        let mut seen: Vec<PathBuf> = Vec::new();
        self.0.retain(|file| {
            let first = !seen.contains(file) && seen.len() < MOST_RECENT;
            seen.push(file.clone());
            first
        });
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_is_first_and_each_file_is_there_once() {
        let mut recent = Recent::default();
        for n in 0..12 {
            recent.opened(Path::new(&format!("/{n}.step")));
        }
        recent.opened(Path::new("/5.step"));
        recent.forget(Path::new("/11.step"));
        let names: Vec<_> = recent.iter().map(|file| file.display().to_string()).collect();
        let expected = [5, 10, 9, 8, 7, 6, 4, 3, 2].map(|n| format!("/{n}.step"));
        assert_eq!(names, expected);
    }
}

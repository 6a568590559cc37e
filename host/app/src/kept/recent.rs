//! The files opened last.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Most files in the list.
pub const MOST_RECENT: usize = 10;

/// A file that was opened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecentFile {
    /// Its path.
    pub path: PathBuf,
    /// SHA-256 of its contents when it was opened last, in hexadecimal digits.
    pub sha256: String,
}

/// The files opened last, newest first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Recent(Vec<RecentFile>);

impl Recent {
    /// Puts a file first; returns the hash with which it was in the list before.
    pub fn opened(&mut self, path: &Path, sha256: &str) -> Option<String> {
        // A path that is not text cannot be kept in a file of text.
        path.to_str()?;
        let before = self.0.iter().position(|file| file.path == path);
        let before = before.map(|index| self.0.remove(index).sha256);
        let file = RecentFile {
            path: path.to_owned(),
            sha256: sha256.to_owned(),
        };
        self.0.insert(0, file);
        self.0.truncate(MOST_RECENT);
        before
    }

    /// Takes a file out of the list.
    pub fn forget(&mut self, path: &Path) {
        self.0.retain(|file| file.path != path);
    }

    /// Newest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &RecentFile> {
        self.0.iter()
    }

    /// At most the largest number, each path once: a file may have been edited by hand.
    pub(super) fn tidied(mut self) -> Self {
        let mut seen: Vec<PathBuf> = Vec::new();
        self.0.retain(|file| {
            let first = !seen.contains(&file.path) && seen.len() < MOST_RECENT;
            seen.push(file.path.clone());
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
            assert_eq!(recent.opened(Path::new(&format!("/{n}.step")), "a"), None);
        }
        let before = recent.opened(Path::new("/5.step"), "b");
        assert_eq!(before.as_deref(), Some("a"));
        recent.forget(Path::new("/11.step"));
        let names: Vec<_> = recent
            .iter()
            .map(|file| file.path.display().to_string())
            .collect();
        let expected = [5, 10, 9, 8, 7, 6, 4, 3, 2].map(|n| format!("/{n}.step"));
        assert_eq!(names, expected);
    }
}

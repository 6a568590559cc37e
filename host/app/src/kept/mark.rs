//! A mark for each running window: by the marks that nobody holds, a later start knows what was open in a program that was ended by force.

use std::fs::{File, TryLockError};
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use super::folder::StateFolder;

/// Most marks of one process that are tried.
const MOST: usize = 64;
/// Longest path that is read, bytes.
const LONGEST: u64 = 16 << 10;

/// The mark of a running window. The system gives its lock back when the program ends, in whatever way.
#[derive(Debug)]
pub struct Mark {
    path: PathBuf,
    file: File,
}

impl Mark {
    /// Sets a mark; `None` where the folder cannot be written, or has no locks.
    pub fn set(folder: &StateFolder) -> Option<Self> {
        let marks = folder.marks();
        std::fs::create_dir_all(&marks).ok()?;
        let own = |number| marks.join(format!("{}-{number}", std::process::id()));
        (0..MOST).map(own).find_map(|path| {
            let file = File::options().write(true).create_new(true).open(&path).ok()?;
            // Another start may look at it between the two steps, and take it away.
            let held = file.try_lock().is_ok() && path.exists();
            held.then_some(Self { path, file })
        })
    }

    /// Says which model is open. That a mark cannot be written is no harm.
    pub fn write(&self, model: Option<&Path>) {
        let text = model.and_then(Path::to_str).unwrap_or_default();
        let mut file = &self.file;
        let _ = file
            .rewind()
            .and_then(|()| file.write_all(text.as_bytes()))
            .and_then(|()| file.set_len(text.len() as u64));
    }
}

impl Drop for Mark {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The models that were open in programs that were ended by force. Their marks are removed: each is reported once.
pub fn left_open(folder: &StateFolder) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder.marks()).into_iter().flatten().flatten();
    let mut models: Vec<PathBuf> = files.filter_map(|file| left(&file.path())).collect();
    models.sort();
    models.dedup();
    models
}

/// The model that a mark names, if nobody holds it.
fn left(path: &Path) -> Option<PathBuf> {
    let file = File::open(path).ok()?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock | TryLockError::Error(_)) => return None,
    }
    let mut text = String::new();
    let read = (&file).take(LONGEST).read_to_string(&mut text);
    std::fs::remove_file(path).ok()?;
    (read.is_ok() && !text.is_empty()).then(|| text.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nobody_holds_was_left_and_is_reported_once() {
        let place = tempfile::tempdir().expect("folder");
        let folder = StateFolder::at(place.path().join("state"));
        assert_eq!(left_open(&folder), Vec::<PathBuf>::new());
        let [one, other] = [0; 2].map(|_| Mark::set(&folder).expect("a mark"));
        one.write(Some(Path::new("/a longer name.step")));
        one.write(Some(Path::new("/a.step")));
        other.write(Some(Path::new("/b.step")));
        // The file of a program that was killed: there, and not held.
        std::fs::write(folder.marks().join("1-0"), "/c.step").expect("written");
        assert_eq!(left_open(&folder), [PathBuf::from("/c.step")]);
        assert_eq!(left_open(&folder), Vec::<PathBuf>::new());
        assert_eq!(std::fs::read_to_string(&one.path).expect("there"), "/a.step");
        drop((one, other));
        assert_eq!(std::fs::read_dir(folder.marks()).expect("folder").count(), 0);
    }
}

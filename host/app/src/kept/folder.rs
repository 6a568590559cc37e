//! The folder of what is kept: the user's for program state.

use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::{Context as _, ensure};
use etcetera::BaseStrategy as _;
use mortise_output::{Existing, Output};

/// Largest file that is read, bytes: a project of a hundred thousand parts has less.
pub const MOST_BYTES: u64 = 64 << 20;
/// Largest number of projects kept; the ones written longest ago go first.
const MOST_PROJECTS: usize = 200;
/// Most files of one name that are set aside; the last one is replaced then.
const MOST_ASIDE: usize = 100;
/// Ending of a file that is being written.
const UNFINISHED: &str = "part";
/// Age from which a file that an interrupted program left is removed.
const LEFT_OVER: Duration = Duration::from_secs(24 * 3600);
/// Ending of projects.
pub const ENDING: &str = "mortise";

/// A folder of files with what is kept.
#[derive(Clone, Debug)]
pub struct StateFolder(PathBuf);

impl StateFolder {
    /// The user's; `None` where the system names none.
    pub fn of_user() -> Option<Self> {
        let base = etcetera::choose_base_strategy().ok()?;
        let folder = base.state_dir().unwrap_or_else(|| base.data_dir());
        Some(Self(folder.join("mortise")))
    }

    /// A folder, created with the first file.
    pub fn at(folder: PathBuf) -> Self {
        Self(folder)
    }

    /// The file of the preferences.
    pub fn preferences(&self) -> PathBuf {
        self.0.join("preferences.json")
    }

    /// The file of the project that is saved by itself for a model with this hash.
    pub fn project(&self, sha256: &str) -> PathBuf {
        // A damaged name must not lead out of the folder.
        let name: String = sha256
            .chars()
            .filter(char::is_ascii_alphanumeric)
            .take(64)
            .collect();
        self.0.join("projects").join(name).with_extension(ENDING)
    }

    /// The folder of the marks of running windows.
    pub(super) fn marks(&self) -> PathBuf {
        self.0.join("running")
    }

    /// Writes a file of this folder, all or nothing.
    ///
    /// # Errors
    /// One line: what, where, what to do.
    pub fn write(&self, path: &Path, text: &str) -> anyhow::Result<()> {
        let folder = path.parent().unwrap_or(&self.0);
        std::fs::create_dir_all(folder).with_context(|| {
            format!(
                "{}: the folder cannot be made, so nothing is kept",
                folder.display()
            )
        })?;
        let is_new = !path.exists();
        Output::new(path, Existing::Replace, &[] as &[PathBuf])?.write(text.as_bytes())?;
        if is_new {
            shrink(folder);
        }
        Ok(())
    }
}

/// Reads a file; `None` if there is none. One that is larger than any this program writes is an error.
///
/// # Errors
/// One line: what, where, what to do.
pub fn read(path: &Path) -> anyhow::Result<Option<Vec<u8>>> {
    let what = || {
        format!(
            "{}: cannot be read; check the path and its permissions",
            path.display()
        )
    };
    let found = match std::fs::metadata(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        found => found.with_context(what)?,
    };
    ensure!(
        found.is_file(),
        "{}: is not a regular file; choose a file",
        path.display()
    );
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).with_context(what)?;
    file.take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)
        .with_context(what)?;
    ensure!(
        bytes.len() as u64 <= MOST_BYTES,
        "{}: is larger than {} MiB, which no file of this kind is; choose another",
        path.display(),
        MOST_BYTES >> 20
    );
    Ok(Some(bytes))
}

/// Keeps a file that cannot be used under another name, so that nothing is lost; says what was done.
pub fn set_aside(path: &Path) -> String {
    let named = |number: usize| {
        let mut name = path.as_os_str().to_owned();
        name.push(match number {
            1 => ".damaged".to_owned(),
            _ => format!(".damaged-{number}"),
        });
        PathBuf::from(name)
    };
    let free = (1..MOST_ASIDE).map(named).find(|name| !name.exists());
    let name = free.unwrap_or_else(|| named(MOST_ASIDE));
    match std::fs::rename(path, &name) {
        Ok(()) => format!("the file is kept as {}", name.display()),
        Err(_) => "the file will be replaced".to_owned(),
    }
}

/// Removes the projects written longest ago beyond the most that are kept, and what interrupted programs left.
fn shrink(folder: &Path) {
    let Ok(files) = std::fs::read_dir(folder) else {
        return;
    };
    let mut projects: Vec<(SystemTime, PathBuf)> = Vec::new();
    for file in files.flatten() {
        let path = file.path();
        let Ok(written) = file.metadata().and_then(|data| data.modified()) else {
            continue;
        };
        if path.extension().is_some_and(|ending| ending == ENDING) {
            projects.push((written, path));
        } else if path.extension().is_some_and(|ending| ending == UNFINISHED)
            && written.elapsed().is_ok_and(|age| age > LEFT_OVER)
        {
            // Another window may have removed it.
            let _ = std::fs::remove_file(path);
        }
    }
    projects.sort();
    let beyond = projects.len().saturating_sub(MOST_PROJECTS);
    for (_, path) in projects.into_iter().take(beyond) {
        let _ = std::fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_comes_back_and_a_project_stays_in_the_folder() {
        let place = tempfile::tempdir().expect("folder");
        let folder = StateFolder::at(place.path().join("state"));
        let path = folder.project("../../ab12");
        assert!(path.starts_with(place.path().join("state/projects")), "{path:?}");
        assert_eq!(read(&path).expect("none yet"), None);
        folder.write(&path, "one").expect("written");
        folder.write(&path, "two").expect("replaced");
        assert_eq!(read(&path).expect("there").as_deref(), Some(&b"two"[..]));
    }

    #[test]
    fn the_projects_written_longest_ago_go_first() {
        let place = tempfile::tempdir().expect("folder");
        let folder = StateFolder::at(place.path().to_owned());
        let name = |n: usize| folder.project(&format!("{n:04}"));
        for n in 0..MOST_PROJECTS + 5 {
            folder.write(&name(n), "p").expect("written");
            let age = Duration::from_secs(10 * (1_000 - n as u64));
            let file = std::fs::File::options().write(true).open(name(n)).expect("there");
            file.set_modified(SystemTime::now() - age)
                .expect("times of files");
        }
        let kept = (0..MOST_PROJECTS + 5).filter(|&n| name(n).exists());
        assert!(kept.eq(5..MOST_PROJECTS + 5));
    }

    #[test]
    fn what_an_interrupted_program_left_goes_after_a_day() {
        let place = tempfile::tempdir().expect("folder");
        let folder = StateFolder::at(place.path().to_owned());
        folder.write(&folder.project("a"), "p").expect("written");
        let [old, new] = ["old", "new"].map(|name| {
            place
                .path()
                .join("projects")
                .join(name)
                .with_extension(UNFINISHED)
        });
        for (path, age) in [(&old, 2 * LEFT_OVER), (&new, LEFT_OVER / 2)] {
            let file = std::fs::File::create(path).expect("written");
            file.set_modified(SystemTime::now() - age)
                .expect("times of files");
        }
        folder.write(&folder.project("b"), "p").expect("written");
        assert!(!old.exists() && new.exists());
    }

    #[test]
    fn what_is_no_file_and_what_cannot_be_written_is_said() {
        let place = tempfile::tempdir().expect("folder");
        let error = read(place.path()).expect_err("a folder");
        assert!(error.to_string().contains("not a regular file"), "{error}");
        let file = place.path().join("file");
        std::fs::write(&file, "").expect("written");
        let folder = StateFolder::at(file);
        let error = folder
            .write(&folder.preferences(), "")
            .expect_err("a file in the way");
        assert!(error.to_string().contains("nothing is kept"), "{error}");
    }
}

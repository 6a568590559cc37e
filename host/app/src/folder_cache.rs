//! The cache of bakes in the user's cache folder.
//!
//! An entry is a file whose name is the SHA-256 of the program's own file and of what the entry answers, so that no other version of the program
//! reads it. It begins with the SHA-256 of the rest: a file that does not agree with it is ignored, removed, and reported. Files are written beside
//! and renamed, so that a reader sees a whole entry or none. The entries used longest ago are removed beyond a total size.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime};

use etcetera::BaseStrategy as _;
use mortise_bake::Cache;
use sha2::{Digest as _, Sha256};

/// Largest total size of the entries, bytes.
const MOST_BYTES: u64 = 256 << 20;
/// Beginning of an entry.
const MAGIC: &[u8; 8] = b"MORTCACH";
/// Bytes of a SHA-256.
const SUM: usize = 32;
/// Ending of the entries' names.
const ENDING: &str = "bake";
/// Age from which a file that an interrupted program left is removed.
const LEFT_OVER: Duration = Duration::from_secs(24 * 3600);

/// A folder of entries.
pub struct FolderCache {
    folder: PathBuf,
    most_bytes: u64,
    /// SHA-256 of the program.
    program: [u8; SUM],
    warnings: Mutex<Vec<String>>,
    grown: AtomicBool,
}

impl FolderCache {
    /// The user's cache of this program; `None` where the system names no such folder, or the program's own file cannot be read.
    pub fn of_user() -> Option<Self> {
        let base = etcetera::choose_base_strategy().ok()?;
        let program = std::fs::read(std::env::current_exe().ok()?).ok()?;
        Some(Self::new(
            base.cache_dir().join("mortise/bake"),
            &program,
            MOST_BYTES,
        ))
    }

    /// The cache in a folder, for the program with these bytes.
    pub fn new(folder: PathBuf, program: &[u8], most_bytes: u64) -> Self {
        Self {
            folder,
            most_bytes,
            program: Sha256::digest(program).into(),
            warnings: Mutex::default(),
            grown: AtomicBool::new(false),
        }
    }

    /// Removes what exceeds the size limit, and returns what went wrong since the last call, in lines.
    pub fn finish(&self) -> Vec<String> {
        if self.grown.swap(false, Ordering::Relaxed) {
            self.shrink();
        }
        self.warnings
            .lock()
            .map(|mut w| std::mem::take(&mut *w))
            .unwrap_or_default()
    }

    fn path(&self, name: &str) -> PathBuf {
        let sum = Sha256::new()
            .chain_update(self.program)
            .chain_update(name)
            .finalize();
        let name: String = sum.iter().map(|b| format!("{b:02x}")).collect();
        self.folder.join(name).with_extension(ENDING)
    }

    /// Reports the first of equal troubles.
    fn warn(&self, text: String) {
        if let Ok(mut warnings) = self.warnings.lock()
            && !warnings.contains(&text)
        {
            warnings.push(text);
        }
    }

    fn write(&self, path: &Path, bytes: &[u8]) -> std::io::Result<()> {
        std::fs::create_dir_all(&self.folder)?;
        let mut file = tempfile::Builder::new()
            .prefix(".new-")
            .tempfile_in(&self.folder)?;
        file.write_all(MAGIC)?;
        file.write_all(&Sha256::digest(bytes))?;
        file.write_all(bytes)?;
        file.persist(path)?;
        Ok(())
    }

    /// Removes the entries used longest ago as long as all together are too large, and what interrupted programs left.
    fn shrink(&self) {
        let Ok(files) = std::fs::read_dir(&self.folder) else {
            return;
        };
        let mut entries: Vec<(SystemTime, u64, PathBuf)> = Vec::new();
        for file in files.flatten() {
            let (path, Ok(data)) = (file.path(), file.metadata()) else {
                continue;
            };
            let used = data.modified().unwrap_or(SystemTime::UNIX_EPOCH);
            if path.extension().is_some_and(|e| e == ENDING) {
                entries.push((used, data.len(), path));
            } else if used.elapsed().is_ok_and(|age| age > LEFT_OVER) {
                // Another program may remove it first.
                let _ = std::fs::remove_file(&path);
            }
        }
        entries.sort();
        let mut total: u64 = entries.iter().map(|(_, bytes, _)| bytes).sum();
        for (_, bytes, path) in entries {
            if total <= self.most_bytes {
                break;
            }
            let _ = std::fs::remove_file(path);
            total -= bytes;
        }
    }
}

impl Cache for FolderCache {
    fn get(&self, name: &str) -> Option<Vec<u8>> {
        let path = self.path(name);
        let file = std::fs::read(&path).ok()?;
        let sound = (file.strip_prefix(MAGIC))
            .and_then(|rest| rest.split_at_checked(SUM))
            .filter(|(sum, bytes)| *sum == Sha256::digest(bytes).as_slice());
        let Some((_, bytes)) = sound else {
            self.warn(format!(
                "{}: a damaged file of the cache was ignored and removed",
                path.display()
            ));
            let _ = std::fs::remove_file(&path);
            return None;
        };
        // Marks it as used; without that it is only removed earlier.
        let _ = std::fs::File::options()
            .write(true)
            .open(&path)
            .and_then(|file| file.set_modified(SystemTime::now()));
        Some(bytes.to_vec())
    }

    fn put(&self, name: &str, bytes: &[u8]) {
        // An entry that would push out all others is not kept.
        if bytes.len() as u64 > self.most_bytes / 4 {
            return;
        }
        match self.write(&self.path(name), bytes) {
            Ok(()) => self.grown.store(true, Ordering::Relaxed),
            Err(error) => self.warn(format!(
                "{}: nothing can be kept for the next bake: {error}",
                self.folder.display()
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cache(folder: &Path, most: u64) -> FolderCache {
        FolderCache::new(folder.join("bake"), b"program", most)
    }

    fn entries(folder: &Path) -> Vec<PathBuf> {
        let files = std::fs::read_dir(folder.join("bake")).expect("folder");
        files.map(|file| file.expect("file").path()).collect()
    }

    #[test]
    fn what_is_kept_comes_back_for_the_same_program_only() {
        let folder = tempfile::tempdir().expect("folder");
        let cache = cache(folder.path(), 1 << 20);
        assert_eq!(cache.get("a"), None);
        cache.put("a", b"one");
        cache.put("b", b"two");
        cache.put("a", b"three");
        assert_eq!(cache.get("a").as_deref(), Some(&b"three"[..]));
        assert_eq!(cache.get("b").as_deref(), Some(&b"two"[..]));
        let other = FolderCache::new(folder.path().join("bake"), b"other", 1 << 20);
        assert_eq!(other.get("a"), None);
        assert!(cache.finish().is_empty() && other.finish().is_empty());
    }

    /// Every byte flipped, and every length cut: nothing but the entry itself comes back.
    #[test]
    fn a_damaged_entry_is_ignored_and_reported() {
        let folder = tempfile::tempdir().expect("folder");
        let cache = cache(folder.path(), 1 << 20);
        cache.put("a", b"some bytes");
        let path = entries(folder.path()).remove(0);
        let whole = std::fs::read(&path).expect("entry");
        let damaged = (0..whole.len()).flat_map(|i| {
            let mut flipped = whole.clone();
            flipped[i] ^= 1;
            [flipped, whole[..i].to_vec()]
        });
        for bytes in damaged {
            std::fs::write(&path, bytes).expect("written");
            assert_eq!(cache.get("a"), None);
            assert!(!path.exists());
        }
        assert_eq!(cache.finish().len(), 1);
        std::fs::write(&path, &whole).expect("written");
        assert_eq!(cache.get("a").as_deref(), Some(&b"some bytes"[..]));
    }

    #[test]
    fn the_entries_used_longest_ago_go_first() {
        let folder = tempfile::tempdir().expect("folder");
        let cache = cache(folder.path(), 10_000);
        for (age, name) in [(4, "a"), (3, "b"), (2, "c"), (1, "d"), (0, "e")] {
            cache.put(name, &[7; 2_400]);
            let used = SystemTime::now() - Duration::from_secs(60 * age);
            let file = std::fs::File::options()
                .write(true)
                .open(cache.path(name))
                .expect("entry");
            file.set_modified(used).expect("times of files");
        }
        assert!(cache.get("a").is_some());
        assert!(cache.finish().is_empty());
        let kept = ["a", "b", "c", "d", "e"].map(|name| cache.get(name).is_some());
        assert_eq!(kept, [true, false, true, true, true]);
        cache.put("large", &[7; 5_000]);
        assert_eq!(cache.get("large"), None);
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_reported_once() {
        let folder = tempfile::tempdir().expect("folder");
        std::fs::write(folder.path().join("bake"), b"a file").expect("written");
        let cache = cache(folder.path(), 1 << 20);
        cache.put("a", b"1");
        cache.put("b", b"2");
        assert_eq!(cache.get("a"), None);
        let warnings = cache.finish();
        assert!(
            warnings.len() == 1 && warnings[0].contains("nothing can be kept"),
            "{warnings:?}"
        );
    }
}

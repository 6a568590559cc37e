//! The repository's own files.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// All files below `root`, sorted, as paths from it; without what builds and git make.
///
/// # Errors
/// When a directory cannot be read.
pub fn files(root: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut open = vec![PathBuf::new()];
    while let Some(directory) = open.pop() {
        let place = root.join(&directory);
        for entry in std::fs::read_dir(&place).with_context(|| format!("reading {}", place.display()))? {
            let entry = entry?;
            let path = directory.join(entry.file_name());
            // A link's own kind, so that one which leads out of the tree is not followed.
            let kind = entry.file_type()?;
            // A directory, or in a linked work tree a file.
            if entry.file_name() == ".git" {
                continue;
            }
            if kind.is_dir() && entry.file_name() != "target" {
                open.push(path);
            } else if kind.is_file() {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

/// Text of a file; bytes that are not UTF-8 are replaced.
///
/// # Errors
/// When it cannot be read.
pub fn read(root: &Path, file: &Path) -> Result<String> {
    let bytes = std::fs::read(root.join(file)).with_context(|| format!("reading {}", file.display()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The file's name ends in one of `extensions`.
pub fn has_extension(file: &Path, extensions: &[&str]) -> bool {
    file.extension()
        .and_then(|end| end.to_str())
        .is_some_and(|end| extensions.contains(&end))
}

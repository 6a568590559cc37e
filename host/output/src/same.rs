//! Whether two paths lead to one file.

use std::path::Path;

/// By device and inode, so through symbolic and hard links. A path that leads nowhere is no file.
#[cfg(unix)]
pub fn file(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let identity = |path: &Path| {
        std::fs::metadata(path)
            .ok()
            .map(|found| (found.dev(), found.ino()))
    };
    identity(a).is_some_and(|of_a| identity(b) == Some(of_a))
}

/// By the path with its links resolved: a hard link has one of its own and is not seen.
#[cfg(not(unix))]
pub fn file(a: &Path, b: &Path) -> bool {
    std::fs::canonicalize(a).is_ok_and(|of_a| std::fs::canonicalize(b).is_ok_and(|of_b| of_b == of_a))
}

//! Whether two paths lead to the same file.

use std::path::Path;

/// Compares device and inode, and so recognises symbolic and hard links. A path that leads nowhere is no file.
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

/// Compares the paths with links resolved: hard links have different paths and are not recognised.
#[cfg(not(unix))]
pub fn file(a: &Path, b: &Path) -> bool {
    std::fs::canonicalize(a).is_ok_and(|of_a| std::fs::canonicalize(b).is_ok_and(|of_b| of_b == of_a))
}

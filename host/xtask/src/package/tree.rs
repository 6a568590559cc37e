//! Where the files of a package are below its prefix (`/usr`, or the archive's folder).

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result};

use crate::shell;

/// Files of `host/app/package`, and of the repository's root, with their places.
const FILES: [(&str, &str); 8] = [
    (
        "host/app/package/mortise.desktop",
        "share/applications/mortise.desktop",
    ),
    (
        "host/app/package/mortise.metainfo.xml",
        "share/metainfo/mortise.metainfo.xml",
    ),
    (
        "host/app/package/mortise.mime.xml",
        "share/mime/packages/mortise.xml",
    ),
    (
        "host/app/package/mortise.svg",
        "share/icons/hicolor/scalable/apps/mortise.svg",
    ),
    (
        "host/app/package/70-mortise-space-mouse.rules",
        "lib/udev/rules.d/70-mortise-space-mouse.rules",
    ),
    ("LICENSE-APACHE", "share/doc/mortise/LICENSE-APACHE"),
    ("LICENSE-MIT", "share/doc/mortise/LICENSE-MIT"),
    ("CHANGELOG.md", "share/doc/mortise/CHANGELOG.md"),
];

/// Places `program` and all that belongs to it below `prefix`.
pub fn lay_out(root: &Path, program: &Path, prefix: &Path) -> Result<()> {
    copy(program, &prefix.join("bin/mortise"))?;
    for (from, to) in FILES {
        copy(&root.join(from), &prefix.join(to))?;
    }
    shell::run(
        Command::new(program)
            .arg("manual")
            .arg(prefix)
            .stdout(Stdio::null()),
    )
}

/// Copies a file, links followed, and makes the folder it goes to.
pub fn copy(from: &Path, to: &Path) -> Result<()> {
    let what = || format!("cannot copy {} to {}", from.display(), to.display());
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder).with_context(what)?;
    }
    std::fs::copy(from, to).with_context(what)?;
    Ok(())
}

/// The folder, made anew without what was in it.
pub fn emptied(folder: &Path) -> Result<PathBuf> {
    let what = || format!("cannot empty {}", folder.display());
    if folder.exists() {
        std::fs::remove_dir_all(folder).with_context(what)?;
    }
    std::fs::create_dir_all(folder).with_context(what)?;
    Ok(folder.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A menu entry without its icon, or for a type that no file describes, fails silently on the desktop.
    #[test]
    fn files_of_the_desktop_agree_with_each_other() {
        let root = shell::root().unwrap();
        let read = |name: &str| {
            let (from, _) = FILES.iter().find(|(from, _)| from.ends_with(name)).unwrap();
            std::fs::read_to_string(root.join(from)).unwrap()
        };
        let (entry, mime, about) = (read(".desktop"), read(".mime.xml"), read(".metainfo.xml"));
        let value = |key: &str| {
            let line = entry.lines().find_map(|line| line.strip_prefix(key)).unwrap();
            line.trim_end_matches(';').to_owned()
        };
        let of_type = value("MimeType=");
        assert!(mime.contains(&format!("type=\"{of_type}\"")));
        assert!(about.contains(&format!("<mediatype>{of_type}</mediatype>")));
        let icon = format!("apps/{}.svg", value("Icon="));
        assert!(FILES.iter().any(|(_, to)| to.ends_with(&icon)));
        assert!(value("Exec=").starts_with("mortise open"));
        // The window names itself so, and the desktop finds the entry by it.
        let window = std::fs::read_to_string(root.join("host/app/src/ui/app.rs")).unwrap();
        assert!(window.contains(&format!(".with_app_id(\"{}\")", value("StartupWMClass="))));
    }
}

//! Version and time of what is packed.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};

use crate::shell;

/// What both say of the program.
pub struct About {
    pub version: String,
    /// Time of the last commit, seconds since 1970: two packages of one commit are equal.
    pub time: String,
}

impl About {
    /// Reads both from the repository.
    pub fn read(root: &Path) -> Result<Self> {
        let manifest = std::fs::read_to_string(root.join("Cargo.toml"))?;
        let version = version(&manifest)
            .context("Cargo.toml names no version")?
            .to_owned();
        let mut git = Command::new("git");
        git.current_dir(root).args(["log", "-1", "--format=%ct"]);
        // A copy without its history has no commit.
        let time = shell::read(&mut git).map_or_else(|_| "0".to_owned(), |time| time.trim().to_owned());
        Ok(Self { version, time })
    }

    /// Name of the archive's only folder.
    pub fn folder(&self) -> String {
        format!("mortise-{}-{}", self.version, std::env::consts::ARCH)
    }
}

/// The version in a workspace's manifest.
fn version(manifest: &str) -> Option<&str> {
    let (_, package) = manifest.split_once("[workspace.package]")?;
    let line = package.lines().find(|line| line.starts_with("version"))?;
    line.split('"').nth(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_the_workspaces() {
        let manifest =
            "[workspace]\nversion = \"9\"\n[workspace.package]\nname = \"x\"\nversion = \"0.1.0\"\n";
        assert_eq!(version(manifest), Some("0.1.0"));
        assert_eq!(version("[package]\nversion = \"1\""), None);
        let own = std::fs::read_to_string(shell::root().unwrap().join("Cargo.toml")).unwrap();
        assert_eq!(version(&own), Some(env!("CARGO_PKG_VERSION")));
    }
}

//! The archive: one folder, which runs wherever it is unpacked.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Result;

use super::about::About;
use crate::shell;

/// Packs the folder of `place` that is laid out.
pub fn pack(place: &Path, about: &About) -> Result<PathBuf> {
    let file = place.join(format!("{}.tar.gz", about.folder()));
    let mut tar = Command::new("tar");
    tar.current_dir(place)
        .args([
            "--sort=name",
            "--owner=0",
            "--group=0",
            "--numeric-owner",
            "--mode=u+w,go-w",
        ])
        .arg(format!("--mtime=@{}", about.time))
        .arg("--gzip")
        .arg("-cf")
        .arg(&file)
        .arg(about.folder());
    shell::run(&mut tar)?;
    Ok(file)
}

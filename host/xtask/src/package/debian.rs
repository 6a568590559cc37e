//! The Debian package.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use super::about::About;
use super::tree;
use crate::setup::{self, Group};
use crate::shell;

/// Packs `staged`, which holds `usr`, into a file in `place`.
pub fn pack(place: &Path, staged: &Path, about: &About) -> Result<PathBuf> {
    let architecture = shell::read(Command::new("dpkg").arg("--print-architecture"))?;
    let architecture = architecture.trim();
    let depends = dependencies(place, &staged.join("usr/bin/mortise"))?;
    let information = tree::emptied(&staged.join("DEBIAN"))?;
    std::fs::write(
        information.join("control"),
        control(&about.version, architecture, &depends),
    )?;
    let file = place.join(format!("mortise_{}_{architecture}.deb", about.version));
    let mut pack = Command::new("dpkg-deb");
    pack.env("SOURCE_DATE_EPOCH", &about.time)
        .args(["--build", "--root-owner-group"])
        .arg(staged)
        .arg(&file);
    shell::run(&mut pack)?;
    Ok(file)
}

/// Packages with the libraries that `program` is linked to, in their least versions.
fn dependencies(place: &Path, program: &Path) -> Result<String> {
    // dpkg-shlibdeps is for source packages and reads the description of one.
    let source = place.join("source");
    std::fs::create_dir_all(source.join("debian"))?;
    std::fs::write(
        source.join("debian/control"),
        "Source: mortise\n\nPackage: mortise\nArchitecture: any\n",
    )?;
    let said = shell::read(
        Command::new("dpkg-shlibdeps")
            .current_dir(&source)
            .arg("-O")
            .arg(program),
    )
    .context("dpkg-shlibdeps is in the package dpkg-dev")?;
    let depends = said.trim().strip_prefix("shlibs:Depends=");
    Ok(depends.context("dpkg-shlibdeps names no libraries")?.to_owned())
}

/// The package's description. What the window loads while it runs is recommended, so that a machine without a display need not have it.
fn control(version: &str, architecture: &str, depends: &str) -> String {
    let recommends = setup::apt_names(Group::Window).join(", ");
    format!(
        "Package: mortise\n\
         Version: {version}\n\
         Architecture: {architecture}\n\
         Maintainer: The Mortise developers <mortise@localhost>\n\
         Section: graphics\n\
         Priority: optional\n\
         Depends: {depends}\n\
         Recommends: {recommends}\n\
         Description: feel whether CAD parts go together\n \
         Reads a STEP assembly, recognises which surfaces mate, and lets a person push\n \
         the parts together with a haptic device: collisions are felt, and close fits\n \
         go in smoothly. Without a device a simulated one takes its place.\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_description_has_one_field_a_line() {
        let text = control("0.1.0", "amd64", "libc6 (>= 2.34)");
        let fields: Vec<&str> = text
            .lines()
            .filter(|line| !line.starts_with(' '))
            .map(|line| line.split_once(": ").unwrap().0)
            .collect();
        assert_eq!(
            fields,
            [
                "Package",
                "Version",
                "Architecture",
                "Maintainer",
                "Section",
                "Priority",
                "Depends",
                "Recommends",
                "Description",
            ]
        );
        assert!(text.contains("Recommends: libgl1-mesa-dri, "));
        assert_eq!(text.lines().filter(|line| line.starts_with(' ')).count(), 3);
    }
}

//! Parts of the Rust toolchain: the microcontroller's target, rustfmt, clippy, cargo-deny and mdBook.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, bail};

use super::Group;
use crate::shell;

/// Target of the boards' Cortex-M7 with its double-precision FPU and hard-float calling convention.
pub const BOARD_TARGET: &str = "thumbv7em-none-eabihf";

/// A component that rustup adds to a toolchain, or a tool that cargo installs beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The standard library for [`BOARD_TARGET`].
    Target,
    /// `cargo fmt`.
    Rustfmt,
    /// `cargo clippy`.
    Clippy,
    /// `cargo deny`, of any version that reads `deny.toml`.
    Deny,
    /// `mdbook`, of any version that reads `docs/book.toml`.
    Book,
}

impl Part {
    const ALL: [Self; 5] = [Self::Target, Self::Rustfmt, Self::Clippy, Self::Deny, Self::Book];

    /// Name in rustup or cargo.
    pub fn name(self) -> &'static str {
        match self {
            Self::Target => BOARD_TARGET,
            Self::Rustfmt => "rustfmt",
            Self::Clippy => "clippy",
            Self::Deny => "cargo-deny",
            Self::Book => "mdbook",
        }
    }

    /// Purpose.
    pub fn group(self) -> Group {
        match self {
            Self::Target => Group::Board,
            Self::Rustfmt | Self::Clippy | Self::Deny => Group::Checks,
            Self::Book => Group::Book,
        }
    }

    /// The command that adds it, as a person would type it in the repository.
    pub fn add_line(self) -> String {
        let (program, words) = self.adding();
        format!("{program} {}", words.join(" "))
    }

    /// The program that adds it, and its arguments.
    fn adding(self) -> (&'static str, Vec<&'static str>) {
        match self {
            Self::Target => ("rustup", vec!["target", "add", self.name()]),
            Self::Rustfmt | Self::Clippy => ("rustup", vec!["component", "add", self.name()]),
            // Versions from its own lock file, with which it is known to build; not optimised, which takes a third of the time and is fast enough.
            Self::Deny => ("cargo", vec!["install", "--locked", "--debug", self.name()]),
            // Likewise, and without its web server.
            Self::Book => {
                let features = ["--no-default-features", "--features", "search"];
                let words = [&["install", "--locked", "--debug"][..], &features, &[self.name()]];
                ("cargo", words.concat())
            }
        }
    }

    fn is_in(self, sysroot: &Path) -> bool {
        let program = |name: &str| {
            sysroot
                .join("bin")
                .join(format!("{name}{}", std::env::consts::EXE_SUFFIX))
        };
        match self {
            Self::Target => sysroot
                .join("lib/rustlib")
                .join(BOARD_TARGET)
                .join("lib")
                .is_dir(),
            Self::Rustfmt => program("rustfmt").is_file() && program("cargo-fmt").is_file(),
            Self::Clippy => program("clippy-driver").is_file() && program("cargo-clippy").is_file(),
            Self::Deny | Self::Book => shell::find_program(self.name()).is_some(),
        }
    }
}

/// Parts of `groups` missing in the repository's toolchain.
///
/// # Errors
/// When rustc cannot be queried for its sysroot.
pub fn missing(groups: &[Group], root: &Path) -> Result<Vec<Part>> {
    let wanted: Vec<Part> = Part::ALL
        .into_iter()
        .filter(|part| groups.contains(&part.group()))
        .collect();
    if wanted.is_empty() {
        return Ok(wanted);
    }
    let printed = shell::read(
        Command::new("rustc")
            .args(["--print", "sysroot"])
            .current_dir(root),
    )?;
    let sysroot = PathBuf::from(printed.trim());
    Ok(wanted.into_iter().filter(|part| !part.is_in(&sysroot)).collect())
}

/// Adds `parts` to the repository's toolchain.
///
/// # Errors
/// When rustup is absent, or fails.
pub fn add(parts: &[Part], root: &Path) -> Result<()> {
    for part in parts {
        let (program, words) = part.adding();
        if shell::find_program(program).is_none() {
            bail!(
                "this Rust was not installed by rustup, so `{}` must come from where it did: {}",
                part.name(),
                part.add_line()
            );
        }
        shell::run(Command::new(program).args(words).current_dir(root))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_seen_by_their_files() {
        let place = tempfile::tempdir().unwrap();
        let sysroot = place.path();
        let parts = || {
            Part::ALL
                .into_iter()
                .filter(|part| !matches!(part, Part::Deny | Part::Book))
        };
        assert!(parts().all(|part| !part.is_in(sysroot)));
        std::fs::create_dir_all(sysroot.join("lib/rustlib/thumbv7em-none-eabihf/lib")).unwrap();
        std::fs::create_dir_all(sysroot.join("bin")).unwrap();
        for name in ["rustfmt", "cargo-fmt", "cargo-clippy"] {
            std::fs::write(
                sysroot.join(format!("bin/{name}{}", std::env::consts::EXE_SUFFIX)),
                "",
            )
            .unwrap();
        }
        assert!(Part::Target.is_in(sysroot));
        assert!(Part::Rustfmt.is_in(sysroot));
        // An incomplete component counts as missing.
        assert!(!Part::Clippy.is_in(sysroot));
    }
}

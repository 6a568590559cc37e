//! `cargo xtask package`: the program as a Debian package and as an archive to unpack anywhere.
//!
//! Both hold the program, its manual pages, shell completions, menu entry, icon and the type of STEP files. The Debian package depends on the libraries
//! of the system that it is made on; the archive brings the CAD kernel along ([`libraries`]), and needs of the system what every desktop has.

mod about;
mod archive;
mod debian;
mod libraries;
mod tree;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

use self::about::About;
use crate::arguments::Package;
use crate::setup::{self, Consent, Group};
use crate::{program, shell};

/// Makes both and prints their paths and sizes.
pub fn command(arguments: &Package) -> Result<ExitCode> {
    let root = shell::root()?;
    let groups = [Group::Build, Group::Window, Group::Package];
    if !setup::ensure(&groups, Consent::from(arguments.installing))? {
        return Ok(ExitCode::FAILURE);
    }
    let program = program::build_mortise(&root, true)?;
    for file in make(&root, &program)? {
        println!(
            "{} ({:.1} MB)",
            file.display(),
            std::fs::metadata(&file)?.len() as f64 / 1e6
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// Makes both of `program`, which has its window, in `target/package`, and returns their paths: first the archive's.
///
/// # Errors
/// On another system than Linux, and when a program that is needed fails.
fn make(root: &Path, program: &Path) -> Result<Vec<PathBuf>> {
    if !cfg!(target_os = "linux") {
        bail!("packages are made on Linux alone; elsewhere: `cargo install --path host/app`");
    }
    let place = tree::emptied(&folder(root)?)?;
    let about = About::read(root)?;
    let bundle = place.join(about.folder());
    tree::lay_out(root, program, &bundle)?;
    libraries::bring_along(&bundle)?;
    let archive = archive::pack(&place, &about)?;
    std::fs::remove_dir_all(&bundle)?;
    let staged = place.join("debian");
    tree::lay_out(root, program, &staged.join("usr"))?;
    let debian = debian::pack(&place, &staged, &about)?;
    std::fs::remove_dir_all(&staged)?;
    Ok(vec![archive, debian])
}

fn folder(root: &Path) -> Result<PathBuf> {
    Ok(crate::tidy::target_directory(root)?.join("package"))
}

/// Step `package` of `cargo xtask test`: both are made; the archive, unpacked elsewhere, runs with its own libraries.
pub fn step(root: &Path, program: &Path) -> Result<String> {
    let made = make(root, program)?;
    let archive = made.first().context("no archive was made")?;
    let unpacked = tree::emptied(&folder(root)?.join("unpacked"))?;
    shell::run(
        Command::new("tar")
            .arg("-xf")
            .arg(archive)
            .arg("-C")
            .arg(&unpacked),
    )?;
    let program = unpacked.join(About::read(root)?.folder()).join("bin/mortise");
    let foreign = libraries::of_kernel(&program)?
        .into_iter()
        .filter(|path| !path.starts_with(&unpacked))
        .collect::<Vec<_>>();
    if let Some(path) = foreign.first() {
        bail!("the archive's program takes {} from the system", path.display());
    }
    let sample = root.join("host/app/samples/pair_d18.75_clear1.00.step");
    let mut inspect = Command::new(&program);
    let said = shell::read(inspect.arg("inspect").arg(sample).env_remove("LD_LIBRARY_PATH"))?;
    if !said.contains("peg") {
        bail!("the archive's program does not read the sample:\n{said}");
    }
    std::fs::remove_dir_all(&unpacked)?;
    Ok(format!("{} packages", made.len()))
}

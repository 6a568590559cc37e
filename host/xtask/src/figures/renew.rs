//! `cargo xtask figures --renew`: makes stale artefacts of `docs/figures` anew and prints the time of each; `--record` records existing files as
//! current.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result};

use super::artefacts::{ARTEFACTS, Artefact, FOLDER, Made, Manifest, stale};
use super::measure::By;
use super::write::write_page;
use crate::shell;

/// Makes all stale artefacts of `names`, or of all if `names` is empty; true if every bound of the tables among them holds. The manifest is written
/// after each, so that an interrupted run resumes where it stopped.
///
/// # Errors
/// When a command fails, or a name is unknown.
pub fn run(root: &Path, program: &Path, names: &[String], by: By) -> Result<bool> {
    for name in names {
        named(name)?;
    }
    let (mut all_hold, mut said) = (true, Vec::new());
    for artefact in ARTEFACTS {
        let manifest = Manifest::read(root)?;
        let Some(why) = stale(root, artefact, &manifest)?
            .filter(|_| names.is_empty() || names.iter().any(|name| name == artefact.name))
        else {
            continue;
        };
        if matches!(artefact.made, Made::ByHand | Made::Compared) {
            said.push(format!("{} {why}: made {}", artefact.name, artefact.command()));
            continue;
        }
        eprintln!("{} {why}", artefact.name);
        let start = Instant::now();
        all_hold &= make(root, program, artefact, by)?;
        record(root, artefact)?;
        said.push(format!(
            "{}: {:.0} s",
            artefact.name,
            start.elapsed().as_secs_f64()
        ));
    }
    for line in &said {
        println!("{line}");
    }
    if said.is_empty() {
        println!("nothing is stale");
    }
    Ok(all_hold)
}

/// Records the files of `names` as the result of their commands, run by hand, on the current sources.
///
/// # Errors
/// When a name is unknown, or the manifest cannot be written.
pub fn record_all(root: &Path, names: &[String]) -> Result<()> {
    let artefacts: Result<Vec<_>> = names.iter().map(|name| named(name)).collect();
    for artefact in artefacts? {
        record(root, artefact)?;
        println!("recorded: {}", artefact.name);
    }
    Ok(())
}

fn named(name: &str) -> Result<&'static Artefact> {
    let found = ARTEFACTS.iter().find(|artefact| artefact.name == name);
    found.with_context(|| {
        let known: Vec<&str> = ARTEFACTS.iter().map(|artefact| artefact.name).collect();
        format!("no artefact is called `{name}`; there are: {}", known.join(" "))
    })
}

/// Reads the manifest anew, because another run may have recorded artefacts meanwhile.
fn record(root: &Path, artefact: &Artefact) -> Result<()> {
    let mut manifest = Manifest::read(root)?;
    (manifest.0).retain(|name, _| ARTEFACTS.iter().any(|artefact| artefact.name == *name));
    manifest.0.insert(artefact.name.to_owned(), artefact.state(root)?);
    manifest.write(root)
}

fn make(root: &Path, program: &Path, artefact: &Artefact, by: By) -> Result<bool> {
    match artefact.made {
        Made::Page { quick } => write_page(root, program, artefact.name, quick, by),
        Made::Sweep { quick } => {
            let mut command = Command::new(program);
            command.current_dir(root).arg(artefact.experiment());
            if quick {
                command.arg("--quick");
            }
            shell::run(command.args(["--out", FOLDER, "--force"]))
                .with_context(|| format!("`{}` made nothing", artefact.command()))?;
            Ok(true)
        }
        // Never reached: artefacts that a person starts are not selected.
        Made::Compared | Made::ByHand => Ok(true),
    }
}

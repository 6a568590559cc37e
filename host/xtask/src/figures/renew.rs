//! `cargo xtask figures --renew`: makes anew what is stale in `docs/figures`, and says how long each took.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, bail};

use super::artefacts::{ARTEFACTS, Artefact, FOLDER, Made, Manifest, stale};
use super::{By, write_page};
use crate::shell;

/// Makes all stale artefacts of `names`, or of all where there are none; true if every bound of the tables among them holds. The manifest is written
/// after each, so that what is interrupted goes on where it stopped.
///
/// # Errors
/// When a command fails, or a name is not known.
pub fn run(root: &Path, program: &Path, names: &[String]) -> Result<bool> {
    if let Some(unknown) = names
        .iter()
        .find(|name| !ARTEFACTS.iter().any(|artefact| artefact.name == **name))
    {
        let known: Vec<&str> = ARTEFACTS.iter().map(|artefact| artefact.name).collect();
        bail!(
            "no artefact is called `{unknown}`; there are: {}",
            known.join(" ")
        );
    }
    let (mut all_hold, mut said) = (true, Vec::new());
    for artefact in ARTEFACTS {
        let named = names.iter().any(|name| name == artefact.name);
        let manifest = Manifest::read(root)?.unwrap_or_default();
        let Some(why) = stale(root, artefact, &manifest)?.filter(|_| named || names.is_empty()) else {
            continue;
        };
        if artefact.made == Made::ByHand && !named {
            said.push(format!("{} {why}: made {}", artefact.name, artefact.command()));
            continue;
        }
        eprintln!("{} {why}", artefact.name);
        let start = Instant::now();
        all_hold &= make(root, program, artefact)?;
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

/// Another run may have recorded what it made meanwhile: the manifest is read anew.
fn record(root: &Path, artefact: &Artefact) -> Result<()> {
    let mut manifest = Manifest::read(root)?.unwrap_or_default();
    (manifest.0).retain(|name, _| ARTEFACTS.iter().any(|artefact| artefact.name == *name));
    manifest.0.insert(artefact.name.to_owned(), artefact.state(root)?);
    manifest.write(root)
}

fn make(root: &Path, program: &Path, artefact: &Artefact) -> Result<bool> {
    match artefact.made {
        Made::Page { quick } => write_page(root, program, artefact.name, quick, By::Completed),
        Made::Sweep { quick } => {
            let mut command = Command::new(program);
            command.current_dir(root).args(["lab", artefact.experiment()]);
            if quick {
                command.arg("--quick");
            }
            shell::run(command.args(["--out", FOLDER, "--force"]))
                .with_context(|| format!("`{}` made nothing", artefact.command()))?;
            Ok(true)
        }
        // A person says that it shows what the program looks like now.
        Made::ByHand => Ok(true),
    }
}

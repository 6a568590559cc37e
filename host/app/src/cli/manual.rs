//! `mortise manual`: manual pages and shell completions.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Command;
use clap_complete::{Shell, generate_to};

/// Shells, and where each looks for completions below its prefix.
const SHELLS: [(Shell, &str); 3] = [
    (Shell::Bash, "share/bash-completion/completions"),
    (Shell::Fish, "share/fish/vendor_completions.d"),
    (Shell::Zsh, "share/zsh/site-functions"),
];

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The prefix to write below, such as ~/.local or /usr/local; files of the same names are replaced
    folder: PathBuf,
}

pub fn run(args: &Args, command: &Command) -> anyhow::Result<ExitCode> {
    let name = command.get_name().to_owned();
    let pages = made(args.folder.join("share/man/man1"))?;
    clap_mangen::generate_to(command.clone(), &pages)
        .with_context(|| format!("cannot write to {}", pages.display()))?;
    println!("{}", pages.display());
    for (shell, place) in SHELLS {
        let folder = made(args.folder.join(place))?;
        let write = || -> std::io::Result<PathBuf> {
            let written = generate_to(shell, &mut command.clone(), &name, &folder)?;
            if shell == Shell::Bash {
                // Where it loads completions by need, it looks for the program's name alone.
                let named = written.with_extension("");
                std::fs::rename(&written, &named)?;
                return Ok(named);
            }
            Ok(written)
        };
        let written = write().with_context(|| format!("cannot write to {}", folder.display()))?;
        println!("{}", written.display());
    }
    Ok(ExitCode::SUCCESS)
}

fn made(folder: PathBuf) -> anyhow::Result<PathBuf> {
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    Ok(folder)
}

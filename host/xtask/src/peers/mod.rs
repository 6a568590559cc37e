//! `cargo xtask peers`: time and error of a distance query, ours beside other libraries, at the same poses in the same run.
//!
//! Makes a Python environment below `target/` with the packages of `host/lab/peers/requirements.txt`, then runs `mortise-lab peers` in it and prints
//! its lines as one table. A package that cannot be had is a skip with its reason, never an error.

mod environment;
mod page;
mod row;

use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

use self::environment::Environment;
use self::row::Row;
use crate::arguments::Peers;
use crate::program::Programs;
use crate::setup::{self, Group};
use crate::{figures, shell};

/// Page of the results, from the root.
const PAGE: &str = "docs/figures/peers.md";

/// `cargo xtask peers [--quick] [--json] [--write]`.
///
/// # Errors
/// When the programs do not build, the comparison fails, or the page cannot be written.
pub fn command(arguments: &Peers) -> Result<ExitCode> {
    let root = shell::root()?;
    if !setup::ensure(&[Group::Build], arguments.installing.into())? {
        return Ok(ExitCode::FAILURE);
    }
    let lab = Programs::build(&root)?.lab;
    let environment = Environment::make(&root)?;
    let mut command = Command::new(lab);
    command.current_dir(&root).args(["peers", "--json"]);
    if arguments.quick {
        command.arg("--quick");
    }
    if arguments.write {
        command.args(["--out", figures::artefacts::FOLDER, "--force"]);
    }
    environment.apply(&mut command);
    let (mut rows, mut unread) = (Vec::new(), None);
    shell::run_lines(&mut command, |line| {
        if arguments.json {
            println!("{line}");
        }
        match Row::parse(line) {
            Ok(row) => {
                // Free-form pairs take minutes each.
                eprintln!("{}: {}", row.scene, row.method);
                rows.push(row);
            }
            Err(error) => unread = Some(error.context(format!("`{line}`"))),
        }
    })?;
    if let Some(error) = unread {
        return Err(error.context("a line of `mortise-lab peers` is not as expected"));
    }
    if rows.is_empty() {
        bail!("`mortise-lab peers` printed nothing");
    }
    if !arguments.json {
        println!(
            "{}{}\n{}",
            page::tables(&rows),
            row::count(&rows),
            page::required(&rows)
        );
    }
    if arguments.write {
        let text = page::text(&rows, arguments.quick, &figures::today());
        std::fs::write(root.join(PAGE), text).with_context(|| format!("writing {PAGE}"))?;
        eprintln!("written: {PAGE}");
    }
    Ok(ExitCode::SUCCESS)
}

//! One run of `mortise-lab figures`.

use std::path::Path;
use std::process::Command;

use anyhow::{Result, bail};

use super::row::Row;
use crate::shell;

/// Beginning of the last row of every run: without it an error ended the run before.
const LAST_ROW: &str = "rows that have no claim";

/// What one run of `mortise-lab figures` gave.
#[derive(Debug)]
pub struct Measured {
    /// The rows, in the program's order.
    pub rows: Vec<Row>,
    /// True if the program ended with success.
    pub success: bool,
}

/// What `mortise-lab figures` judges rows by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// The claims it was built with; a row without one makes the last row fail.
    Kept,
    /// The same, and where there is none, what it measures.
    Completed,
    /// What it measures.
    Measured,
}

impl By {
    fn option(self) -> &'static str {
        match self {
            Self::Kept => "kept",
            Self::Completed => "completed",
            Self::Measured => "measured",
        }
    }
}

/// Runs `mortise-lab figures NAME --json` and prints each row as it comes.
///
/// # Errors
/// When the program cannot be started, prints no rows or something that is not a row, or ends before the table does.
pub fn measure(root: &Path, program: &Path, name: &str, quick: bool, by: By) -> Result<Measured> {
    measure_part(root, program, name, None, quick, by)
}

/// As [`measure`], of some parts of the shorter form alone, one after the other.
///
/// # Errors
/// As [`measure`].
pub fn measure_parts(root: &Path, program: &Path, name: &str, parts: &[&str], by: By) -> Result<Measured> {
    let mut all = Measured {
        rows: Vec::new(),
        success: true,
    };
    for part in parts {
        let measured = measure_part(root, program, name, Some(part), true, by)?;
        all.rows.extend(measured.rows);
        all.success &= measured.success;
    }
    Ok(all)
}

fn measure_part(
    root: &Path,
    program: &Path,
    name: &str,
    part: Option<&str>,
    quick: bool,
    by: By,
) -> Result<Measured> {
    let mut command = Command::new(program);
    command
        .current_dir(root)
        .args(["figures", name, "--json", "--claims", by.option()]);
    if quick {
        command.arg("--quick");
    }
    if let Some(part) = part {
        command.args(["--only", part]);
    }
    let mut rows = Vec::new();
    let mut foreign = Vec::new();
    let run = shell::run_lines(&mut command, |line| match Row::parse(line) {
        Ok(row) => {
            println!("  {}", row.line());
            rows.push(row);
        }
        Err(_) if line.trim().is_empty() => {}
        Err(error) => foreign.push(format!("{error:#}: {line}")),
    });
    if let Some(first) = foreign.first() {
        bail!("`mortise-lab figures {name} --json` printed what is not a row ({first})");
    }
    if rows.is_empty() {
        run?;
        bail!("`mortise-lab figures {name} --json` printed no row");
    }
    if !rows.last().is_some_and(|row| row.what.starts_with(LAST_ROW)) {
        bail!(
            "`mortise-lab figures {name}` ended with an error behind its row {}: nothing is written",
            rows.len()
        );
    }
    Ok(Measured {
        rows,
        success: run.is_ok(),
    })
}

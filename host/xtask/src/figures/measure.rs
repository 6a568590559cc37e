//! One run of `mortise-lab figures`.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

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

/// As [`measure`], of the shorter form of several tables; of a table with parts these alone. As many runs at a time as the computer has cores, since
/// nearly all rows are counted or simulated; values that depend on the machine are worth less for it.
///
/// # Errors
/// As [`measure`].
pub fn measure_tables(
    root: &Path,
    program: &Path,
    tables: &[(&str, Option<&[&str]>)],
    by: By,
) -> Result<Vec<Measured>> {
    let mut runs: Vec<(usize, &str, Option<&str>)> = (tables.iter().enumerate())
        .flat_map(|(index, (name, parts))| {
            let parts = parts.map_or_else(|| vec![None], |parts| parts.iter().copied().map(Some).collect());
            parts.into_iter().map(move |part| (index, *name, part))
        })
        .collect();
    // A whole table takes longer than a part: last, it would run beside an idle core.
    runs.sort_by_key(|(.., part)| part.is_some());
    let next = AtomicUsize::new(0);
    let done = Mutex::new(BTreeMap::new());
    let workers = std::thread::available_parallelism().map_or(1, |cores| cores.get().min(runs.len()));
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&(_, name, part)) = runs.get(number) else {
                        break;
                    };
                    let measured = measure_part(root, program, name, part, true, by);
                    done.lock().expect("no run panics").insert(number, measured);
                }
            });
        }
    });
    let mut all: Vec<Measured> = (tables.iter())
        .map(|_| Measured {
            rows: Vec::new(),
            success: true,
        })
        .collect();
    for (number, measured) in done.into_inner().expect("no run panics") {
        let (measured, table) = (measured?, runs[number].0);
        all[table].rows.extend(measured.rows);
        all[table].success &= measured.success;
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
            println!("  {name}: {}", row.line());
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

//! `cargo xtask figures NAME`: measures and stores the figures of one part of the product.
//!
//! The program prints one JSON object a row, `{"what","value","unit","bound","holds"}`; this module writes them as a table to `docs/figures/NAME.md`.
//! `--check` compares the numbers of pages with measured ones; `--renew` makes stale artefacts anew, `--record` records artefacts made by hand.

pub mod artefacts;
mod claims;
mod page;
mod quoted;
mod renew;
mod row;
mod sources;

use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

use self::artefacts::{ARTEFACTS, Artefact, Made};
use self::claims::Claims;
pub use self::row::{Row, count};
use crate::program::Programs;
use crate::setup::{self, Consent, Group};
use crate::{firmware, shell};

/// Result of one run of `mortise-lab figures`.
#[derive(Debug)]
pub struct Measured {
    /// The rows, in the program's order.
    pub rows: Vec<Row>,
    /// True if the program ended with success.
    pub success: bool,
}

/// Source of the claims by which `mortise-lab figures` judges rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// The claims built into the program; a row without one makes the last row fail.
    Kept,
    /// The same, completed by measured values.
    Completed,
    /// Measured values.
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

/// `cargo xtask figures [NAME] [--quick] [--claim]`, `--check`, `--renew [NAME]...` or `--record NAME...`.
pub fn command(arguments: &[String]) -> Result<ExitCode> {
    let root = shell::root()?;
    let mut arguments = arguments.to_vec();
    let consent = Consent::take(&mut arguments);
    let (options, names): (Vec<String>, Vec<String>) = arguments
        .into_iter()
        .partition(|argument| argument.starts_with('-'));
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let name = match (options.as_slice(), names.as_slice()) {
        (["--check"], []) | (["--renew"], _) => None,
        (["--record"], [_, ..]) => {
            renew::record_all(&root, &names)?;
            return Ok(ExitCode::SUCCESS);
        }
        ([] | ["--quick"] | ["--claim"] | ["--quick", "--claim"] | ["--claim", "--quick"], [name]) => {
            Some(name)
        }
        _ => bail!(
            "say which figures, for example `cargo xtask figures end-to-end`, or `--check` or `--renew` alone; see `cargo xtask figures --help`"
        ),
    };
    if !setup::ensure(&[Group::Build, Group::Board], consent)? {
        return Ok(ExitCode::FAILURE);
    }
    firmware::build(&root, firmware::EMULATED)?;
    let program = Programs::build(&root)?.lab;
    let all_hold = match name {
        Some(name) => {
            let by = if options.contains(&"--claim") {
                By::Measured
            } else {
                By::Completed
            };
            write_page(&root, &program, name, options.contains(&"--quick"), by)?
        }
        None if options == ["--check"] => {
            println!("{}", check(&root, &program)?);
            true
        }
        None => renew::run(&root, &program, &names)?,
    };
    Ok(if all_hold {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// True if the page of a table is made from the shorter form; `None` when there is no such table.
fn page_is_quick(name: &str) -> Option<bool> {
    let of = |artefact: &Artefact| match artefact.made {
        Made::Page { quick } if artefact.name == name => Some(quick),
        _ => None,
    };
    ARTEFACTS.iter().find_map(of)
}

/// Measures a table, stores the claims of new rows and writes the page; true if every bound holds.
fn write_page(root: &Path, program: &Path, name: &str, quick: bool, by: By) -> Result<bool> {
    let Some(of_page) = page_is_quick(name).map(|page| page == quick) else {
        bail!("there is no table `{name}`; `mortise-lab figures --help` names them");
    };
    let measured = measure(root, program, name, quick, by)?;
    let mut claims = Claims::read(root)?;
    for key in claims.take(name, of_page, &measured.rows) {
        eprintln!("{}: dropped, no row: {name}: {key}", claims::FILE);
    }
    claims.write(root)?;
    let file = root.join(artefacts::FOLDER).join(format!("{name}.md"));
    std::fs::write(&file, page::text(name, quick, &measured.rows))
        .with_context(|| format!("writing {}", file.display()))?;
    eprintln!("written: docs/figures/{name}.md");
    Ok(measured.success && !measured.rows.iter().any(Row::fails))
}

/// The step of `cargo xtask test`: [`check`] once a manifest exists; before that, whether the bounds of `end-to-end` hold.
///
/// # Errors
/// As [`check`].
pub fn step(root: &Path, program: &Path) -> Result<String> {
    if artefacts::Manifest::read(root)?.is_some() {
        return check(root, program);
    }
    let measured = measure(root, program, "end-to-end", true, By::Completed)?;
    let count = count(&measured.rows);
    if !measured.success || measured.rows.iter().any(Row::fails) {
        bail!("end-to-end: {count}");
    }
    Ok(format!(
        "end-to-end: {count}; README is not compared before `cargo xtask figures --renew`"
    ))
}

/// Measures the shorter form of every table that README quotes and compares bounds, claims, quoted numbers, and the pages of figures. Bounds of
/// machine-dependent values are reported, not judged: another or a busy machine breaks no promise. Rows that fail on the page of figures are reported
/// as well.
///
/// # Errors
/// When a bound does not hold, or a number differs; the details were printed.
pub fn check(root: &Path, program: &Path) -> Result<String> {
    let quoted = quoted::of_pages(root)?;
    let claims = Claims::read(root)?;
    let (mut said, mut wrong) = (Vec::new(), Vec::new());
    let measured_tables = quoted::measured(&quoted);
    for table in &measured_tables {
        let measured = measure(root, program, table, true, By::Kept)?;
        let page = page_of(root, table)?;
        let told = |row: &Row| page.iter().any(|kept| kept.key() == row.key() && kept.fails());
        for row in measured.rows.iter().filter(|row| row.fails()) {
            if row.varies {
                said.push(format!("not judged, as the machine decides it: {}", row.line()));
            } else if told(row) {
                said.push(format!("fails, as its page says: {}", row.line()));
            } else {
                wrong.push(format!("{table}: {}", row.line()));
            }
        }
        if !measured.success && !measured.rows.iter().any(Row::fails) {
            wrong.push(format!(
                "{table}: the program says by its exit code that a bound does not hold"
            ));
        }
        let of_page = page_is_quick(table) == Some(true);
        let gone = claims.without_row(table, of_page, &measured.rows);
        wrong.extend(
            gone.iter()
                .map(|key| format!("{}: no row of {table}: {key}", claims::FILE)),
        );
        wrong.extend(quoted::differences(table, &measured.rows, &page));
        for quoted in quoted.iter().filter(|quoted| quoted.table == *table) {
            wrong.extend(
                quoted
                    .check(&measured.rows, &page)
                    .err()
                    .map(|error| format!("{error:#}")),
            );
        }
        said.push(format!("{table}: {}", count(&measured.rows)));
    }
    for quoted in quoted
        .iter()
        .filter(|quoted| !measured_tables.contains(&quoted.table))
    {
        let agrees = page_of(root, &quoted.table).and_then(|page| quoted.check_page(&page));
        wrong.extend(agrees.err().map(|error| format!("{error:#}")));
    }
    for wrong in &wrong {
        eprintln!("{wrong}");
    }
    if !wrong.is_empty() {
        bail!("{} figures do not hold or differ", wrong.len());
    }
    said.push(format!("{} quoted figures agree", quoted.len()));
    Ok(said.join("; "))
}

/// The rows of a table's page.
fn page_of(root: &Path, table: &str) -> Result<Vec<Row>> {
    let file = format!("{}/{table}.md", artefacts::FOLDER);
    let page = std::fs::read_to_string(root.join(&file))
        .with_context(|| format!("reading {file}; `--renew` writes it"))?;
    Ok(quoted::page_rows(&page))
}

/// Runs `mortise-lab figures NAME --json` and prints each row as it comes.
///
/// # Errors
/// When the program cannot be started, or prints no rows or an invalid one.
pub fn measure(root: &Path, program: &Path, name: &str, quick: bool, by: By) -> Result<Measured> {
    let mut command = Command::new(program);
    command
        .current_dir(root)
        .args(["figures", name, "--json", "--claims", by.option()]);
    if quick {
        command.arg("--quick");
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
    Ok(Measured {
        rows,
        success: run.is_ok(),
    })
}

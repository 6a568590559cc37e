//! `cargo xtask figures NAME`: measures and stores the figures of one part of the product.
//!
//! The program prints one JSON object a row, `{"what","value","unit","bound","holds"}`; this module writes them as a table to `docs/figures/NAME.md`.
//! `--check` compares the numbers of pages with measured ones; `--renew` makes stale artefacts anew, `--record` records artefacts made by hand.

pub mod artefacts;
mod claims;
mod measure;
mod page;
mod quoted;
mod renew;
mod row;
mod sources;
mod write;

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};

use self::claims::Claims;
use self::measure::{By, measure};
pub use self::page::today;
pub use self::row::{Row, count};
use self::write::{page_is_quick, write_page};
use crate::arguments::Figures;
use crate::program::Programs;
use crate::setup::{self, Group};
use crate::{firmware, shell};

/// `cargo xtask figures [NAME] [--quick] [--claim]`, `--check`, `--renew [NAME]...` or `--record NAME...`.
pub fn command(arguments: &Figures) -> Result<ExitCode> {
    let root = shell::root()?;
    let names = &arguments.names;
    if arguments.record {
        renew::record_all(&root, names)?;
        return Ok(ExitCode::SUCCESS);
    }
    let table = match names.as_slice() {
        _ if arguments.check || arguments.renew => None,
        [name] => Some(name),
        _ => bail!(
            "say which figures, for example `cargo xtask figures end-to-end`, or `--check` or `--renew`"
        ),
    };
    if !setup::ensure(&[Group::Build, Group::Board], arguments.installing.into())? {
        return Ok(ExitCode::FAILURE);
    }
    firmware::build(&root, firmware::EMULATED)?;
    let lab = Programs::build(&root)?.lab;
    let all_hold = match table {
        Some(name) => {
            let by = if arguments.claim {
                By::Measured
            } else {
                By::Completed
            };
            write_page(&root, &lab, name, arguments.quick, by)?
        }
        None if arguments.check => {
            println!("{}", check(&root, &lab)?);
            true
        }
        None => renew::run(&root, &lab, names)?,
    };
    Ok(if all_hold {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The step of `cargo xtask test`: [`check`], once figures have been renewed for the first time; until then, whether the bounds of `end-to-end` hold.
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
        let reported = |row: &Row| page.iter().any(|kept| kept.key() == row.key() && kept.fails());
        for row in measured.rows.iter().filter(|row| row.fails()) {
            if row.varies {
                said.push(format!("not judged, as the machine decides it: {}", row.line()));
            } else if reported(row) {
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

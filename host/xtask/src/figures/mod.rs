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
use self::measure::{By, measure_tables};
pub use self::page::today;
use self::quoted::Quoted;
pub use self::row::{Row, count};
use self::write::{page_is_quick, write_page};
use crate::arguments::Figures;
use crate::program::Programs;
use crate::setup::{self, Group};
use crate::{firmware, shell};

/// Parts of tables whose other parts hold no quoted row: the tests measure these alone, longest first, a whole table takes a quarter of an hour.
const QUOTED_PARTS: &[(&str, &[&str])] = &[("contact", &["ticks", "insertion", "accuracy"])];

/// `cargo xtask figures [NAME] [--quick] [--claim]`, `--check`, `--renew [NAME]... [--claim]` or `--record NAME...`. A page written in its own form is recorded.
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
    let by = if arguments.claim {
        By::Measured
    } else {
        By::Completed
    };
    let all_hold = match table {
        Some(name) => {
            let all_hold = write_page(&root, &lab, name, arguments.quick, by)?;
            if page_is_quick(name) == Some(arguments.quick) {
                renew::record_all(&root, std::slice::from_ref(name))?;
            }
            all_hold
        }
        None if arguments.check => {
            println!("{}", check(&root, &lab, &[])?);
            true
        }
        None => renew::run(&root, &lab, names, by)?,
    };
    Ok(if all_hold {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The step of `cargo xtask test`: [`check`] of the parts that hold quoted rows.
///
/// # Errors
/// As [`check`].
pub fn step(root: &Path, program: &Path) -> Result<String> {
    check(root, program, QUOTED_PARTS)
}

/// Measures the shorter form of every table that README quotes (of a table named in `parts` these alone), and compares bounds, claims, README's
/// numbers, and the pages of figures. README's numbers of the other tables, and all numbers in `docs`, are compared with the
/// pages of figures. Bounds of machine-dependent values are reported, not judged: another or a busy machine breaks no promise. Rows that fail on the
/// page of figures are reported as well.
///
/// # Errors
/// When a bound does not hold, or a number differs; the details were printed.
pub fn check(root: &Path, program: &Path, parts: &[(&str, &[&str])]) -> Result<String> {
    let quoted = quoted::of_pages(root)?;
    let claims = Claims::read(root)?;
    let (mut said, mut wrong) = (Vec::new(), Vec::new());
    let tables = quoted::measured(&quoted);
    let parts_of = |table: &str| {
        parts
            .iter()
            .find(|(name, _)| *name == table)
            .map(|(_, parts)| *parts)
    };
    let wanted: Vec<_> = tables
        .iter()
        .map(|table| (table.as_str(), parts_of(table)))
        .collect();
    let all_measured = measure_tables(root, program, &wanted, By::Kept)?;
    for ((table, parts), measured) in wanted.into_iter().zip(all_measured) {
        let page = page_of(root, table)?;
        for row in measured.rows.iter().filter(|row| row.fails()) {
            let reported = page.iter().any(|kept| kept.key() == row.key() && kept.fails());
            if row.varies {
                said.push(format!("not judged, as the machine decides it: {}", row.line()));
            } else if reported {
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
        if parts.is_none() {
            let of_page = page_is_quick(table) == Some(true);
            let gone = claims.without_row(table, of_page, &measured.rows);
            wrong.extend(
                gone.iter()
                    .map(|key| format!("{}: no row of {table}: {key}", claims::FILE)),
            );
        }
        wrong.extend(quoted::differences(table, &measured.rows, &page));
        let of_table = |quoted: &&Quoted| quoted.is_of_readme() && quoted.table == table;
        for quoted in quoted.iter().filter(of_table) {
            let agrees = quoted.check(&measured.rows, &page);
            wrong.extend(agrees.err().map(|error| format!("{error:#}")));
        }
        said.push(format!("{table}: {}", count(&measured.rows)));
    }
    let is_measured = |quoted: &Quoted| quoted.is_of_readme() && tables.contains(&quoted.table);
    for quoted in quoted.iter().filter(|quoted| !is_measured(quoted)) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_numbers_are_those_of_the_pages() {
        let root = shell::root().unwrap();
        let quoted = quoted::of_pages(&root).unwrap();
        let differ = quoted.iter().filter_map(|quoted| {
            let agrees = page_of(&root, &quoted.table).and_then(|page| quoted.check_page(&page));
            agrees.err().map(|error| format!("{error:#}"))
        });
        assert_eq!(differ.collect::<Vec<_>>(), Vec::<String>::new());
    }
}

//! A table measured, and its page and claims written.

use std::path::Path;

use anyhow::{Context, Result, bail};

use super::artefacts::{self, ARTEFACTS, Artefact, Made};
use super::claims::{self, Claims};
use super::measure::{By, measure};
use super::page;
use super::row::Row;

/// Whether the page of a table is made from the shorter form; `None` when there is no such table.
pub fn page_is_quick(name: &str) -> Option<bool> {
    let of = |artefact: &Artefact| match artefact.made {
        Made::Page { quick } if artefact.name == name => Some(quick),
        _ => None,
    };
    ARTEFACTS.iter().find_map(of)
}

/// Measures a table, keeps the claims of new rows and writes the page; true if every bound holds.
///
/// # Errors
/// When there is no such table, it cannot be measured, or a file cannot be written.
pub fn write_page(root: &Path, program: &Path, name: &str, quick: bool, by: By) -> Result<bool> {
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

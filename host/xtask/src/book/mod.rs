//! `cargo xtask book`: README, changelog and the pages of `docs` as one book of web pages with pictures and a search, made by mdBook.
//!
//! Pages stay where they are; `docs/SUMMARY.md` is the table of contents and `docs/book.toml` what mdBook is to do. Both are laid out in `target/book` with
//! every page and what pages show ([`pages`]); every link of the finished book is followed ([`links`]).

mod links;
mod pages;

use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

use crate::arguments::Book;
use crate::setup::{self, Consent, Group};
use crate::{shell, tidy};

/// Makes the book and prints the path of its first page.
pub fn command(arguments: &Book) -> Result<ExitCode> {
    let root = shell::root()?;
    if !setup::ensure(&[Group::Book], Consent::from(arguments.installing))? {
        return Ok(ExitCode::FAILURE);
    }
    let place = tidy::target_directory(&root)?.join("book");
    if place.exists() {
        std::fs::remove_dir_all(&place).with_context(|| format!("cannot empty {}", place.display()))?;
    }
    let laid_out = pages::lay_out(&root, &place)?;
    shell::run(Command::new("mdbook").arg("build").arg(&place))?;
    let html = place.join("html");
    check(&html)?;
    eprintln!(
        "{} pages, {} pictures and tables",
        laid_out.pages, laid_out.others
    );
    println!("{}", html.join("index.html").display());
    Ok(ExitCode::SUCCESS)
}

/// Follows every link of the book.
///
/// # Errors
/// When one leads nowhere, or there are none.
fn check(html: &Path) -> Result<()> {
    let checked = links::check(html)?;
    for broken in &checked.broken {
        eprintln!("{broken}");
    }
    if !checked.broken.is_empty() || checked.links == 0 {
        bail!(
            "{} of the book's {} links lead nowhere",
            checked.broken.len(),
            checked.links
        );
    }
    eprintln!("{} links followed on {} pages", checked.links, checked.pages);
    Ok(())
}

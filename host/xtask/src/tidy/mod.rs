//! Checks that keep the repository true: what docs name exists, files and functions stay short, layers hold, no modules need each other, no figure is stale.

mod circles;
mod commands;
mod contents;
mod docs;
mod finding;
mod functions;
mod layers;
mod sources;
mod subjects;
mod tests_named;
mod tree;
mod unsafety;
mod words;

use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;

pub use self::docs::{linked_file, links};
pub use self::finding::{Finding, report};
pub use self::layers::target_directory;
pub use self::tree::files;

use crate::program::Programs;
use crate::{figures, shell};

/// `cargo xtask tidy`.
pub fn command() -> Result<ExitCode> {
    let root = shell::root()?;
    let mut findings = check(&root)?;
    match Programs::built(&target_directory(&root)?.join("release")) {
        Some(programs) => findings.extend(check_commands(&root, &programs)?),
        None => {
            eprintln!(
                "Not checked: the `mortise …` and `mortise-lab …` commands in docs, as the programs are not built (`cargo xtask test` does)."
            );
        }
    }
    report(&findings)?;
    eprintln!("tidy: nothing found");
    Ok(ExitCode::SUCCESS)
}

/// Checks that need no program: paths in docs, the book's contents, length and words of sources, reasons for `unsafe`, files of tests, layers, import circles, subjects of commits, what
/// figures were made from.
///
/// # Errors
/// When a file cannot be read, or cargo cannot describe the workspace.
pub fn check(root: &Path) -> Result<Vec<Finding>> {
    let files = files(root)?;
    let mut findings = Vec::new();
    for file in &files {
        findings.extend(sources::check(root, file)?);
        findings.extend(unsafety::check(root, file)?);
        findings.extend(words::check(root, file)?);
    }
    findings.extend(docs::check_paths(root, &files)?);
    findings.extend(contents::check(root, &files)?);
    findings.extend(tests_named::check(root, &files)?);
    findings.extend(layers::check(root, &files)?);
    findings.extend(circles::check(root, &files)?);
    findings.extend(functions::check(root, &files)?);
    findings.extend(subjects::check(root));
    let stale = figures::artefacts::complaints(root)?;
    findings.extend(
        stale
            .into_iter()
            .map(|(file, what)| Finding { file, line: 0, what }),
    );
    Ok(findings)
}

/// Checks each `cargo xtask …`, `mortise …` and `mortise-lab …` command in docs against what the programs' help says.
///
/// # Errors
/// When a page cannot be read, or a program cannot be started.
pub fn check_commands(root: &Path, programs: &Programs) -> Result<Vec<Finding>> {
    let mut helps = commands::Helps::new(programs);
    let mut findings = Vec::new();
    for page in docs::pages(&files(root)?) {
        let text = tree::read(root, page)?;
        for (line, command) in docs::commands(&text) {
            if let Some(what) = helps.complaint(&command)? {
                findings.push(Finding {
                    file: page.clone(),
                    line,
                    what,
                });
            }
        }
    }
    Ok(findings)
}

//! Checks that keep the repository true: what docs name exists, files stay short, layers hold, no modules need each other, no figure is stale.

mod circles;
mod commands;
mod docs;
mod layers;
mod sources;
mod tree;
mod unsafety;

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};

pub use self::layers::target_directory;

use crate::program::Programs;
use crate::{figures, shell};

/// Something that is not as it must be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// File, from the root.
    pub file: PathBuf,
    /// Line, counted from one; 0 when it concerns the whole file.
    pub line: usize,
    /// What is wrong and what would be right.
    pub what: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(formatter, "{}: {}", self.file.display(), self.what),
            line => write!(formatter, "{}:{line}: {}", self.file.display(), self.what),
        }
    }
}

/// `cargo xtask tidy`.
pub fn command(arguments: &[String]) -> Result<ExitCode> {
    if let Some(unknown) = arguments.first() {
        bail!("`tidy` does not know `{unknown}`; see `cargo xtask tidy --help`");
    }
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

/// Checks that need no program: paths in docs, length and words of sources, reasons for `unsafe`, layers, import circles, what figures were made from.
///
/// # Errors
/// When a file cannot be read, or cargo cannot describe the workspace.
pub fn check(root: &Path) -> Result<Vec<Finding>> {
    let files = tree::files(root)?;
    let mut findings = Vec::new();
    for file in &files {
        findings.extend(sources::check(root, file)?);
        findings.extend(unsafety::check(root, file)?);
    }
    findings.extend(docs::check_paths(root, &files)?);
    findings.extend(layers::check(root, &files)?);
    findings.extend(circles::check(root, &files)?);
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
    for page in docs::pages(&tree::files(root)?) {
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

/// Prints findings.
///
/// # Errors
/// When there is one.
pub fn report(findings: &[Finding]) -> Result<()> {
    for finding in findings {
        eprintln!("{finding}");
    }
    if findings.is_empty() {
        Ok(())
    } else {
        bail!("tidy: {} found", findings.len())
    }
}

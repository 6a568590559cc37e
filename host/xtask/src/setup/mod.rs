//! Detects which prerequisites this machine lacks, and installs only those.
//!
//! Detection needs no root rights: it reads dpkg's status file, searches for programs, headers and libraries and queries rustc for its sysroot.
//! Missing parts are installed after a question, by [`apt`] on Debian and Ubuntu and by rustup anywhere; on other systems the commands are printed.

mod advice;
mod apt;
mod machine;
mod packages;
mod rust;
mod sources;

use std::io::{BufRead, IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Result, bail};

use self::machine::Machine;
pub use self::packages::Group;
pub use self::rust::BOARD_TARGET;
use crate::arguments::Installing;
use crate::shell;

/// The user's consent to an installation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consent {
    /// Install without a question.
    Given,
    /// Ask at the terminal; without a terminal, install and report it.
    Ask,
    /// Install nothing: list what is missing and stop.
    Refused,
}

impl From<Installing> for Consent {
    /// `--no-install` wins over `--yes`, which CI=true says as well.
    fn from(installing: Installing) -> Self {
        if installing.no_install {
            Self::Refused
        } else if installing.yes || shell::is_ci() {
            Self::Given
        } else {
            Self::Ask
        }
    }
}

/// Missing prerequisites of some groups.
#[derive(Debug, Default, PartialEq, Eq)]
struct Missing {
    packages: Vec<&'static packages::Package>,
    rust: Vec<rust::Part>,
}

impl Missing {
    fn find(groups: &[Group], machine: &Machine, root: &Path) -> Result<Self> {
        Ok(Self {
            packages: packages::PACKAGES
                .iter()
                .filter(|package| package.group.applies() && groups.contains(&package.group))
                .filter(|package| !machine.has(package))
                .collect(),
            rust: rust::missing(groups, root)?,
        })
    }

    fn is_empty(&self) -> bool {
        self.packages.is_empty() && self.rust.is_empty()
    }

    fn names(&self) -> Vec<&'static str> {
        self.packages
            .iter()
            .map(|package| package.apt)
            .chain(self.rust.iter().map(|part| part.name()))
            .collect()
    }
}

/// Names for apt of a group's packages.
pub fn apt_names(group: Group) -> Vec<&'static str> {
    let own = packages::PACKAGES.iter().filter(|package| package.group == group);
    own.map(|package| package.apt).collect()
}

/// `cargo xtask setup`: everything that any command needs.
pub fn command(installing: Installing) -> Result<ExitCode> {
    let done = ensure(&Group::ALL, installing.into())?;
    if done {
        eprintln!("Nothing is missing.");
    }
    Ok(if done {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Ensures that every prerequisite in `groups` is installed, and prints each step.
///
/// Returns false when something is still missing because the user declined or refused beforehand, or because no installer for this system is known
/// here; the reason was printed.
///
/// # Errors
/// When an installer ran and failed.
pub fn ensure(groups: &[Group], consent: Consent) -> Result<bool> {
    let root = shell::root()?;
    let missing = Missing::find(groups, &Machine::this()?, &root)?;
    if missing.is_empty() {
        return Ok(true);
    }
    eprintln!("Missing on this machine: {}", missing.names().join(" "));
    for group in groups {
        if missing.packages.iter().any(|package| package.group == *group)
            || missing.rust.iter().any(|part| part.group() == *group)
        {
            eprintln!("  {}", group.purpose());
        }
    }
    let system = advice::System::this();
    if !missing.packages.is_empty() && system != advice::System::Apt {
        eprintln!("\nInstall it with:\n");
        for line in advice::commands(system, &missing.packages, &missing.rust) {
            eprintln!("  {line}");
        }
        eprintln!("\nand run the same command again.");
        return Ok(false);
    }
    let names: Vec<&str> = missing.packages.iter().map(|package| package.apt).collect();
    if !agreed(consent, &names, &missing.rust)? {
        return Ok(false);
    }
    let packages = || match names.as_slice() {
        [] => Ok(()),
        names => apt::install(names),
    };
    let rust = || rust::add(&missing.rust, &root);
    if std::io::stdin().is_terminal() {
        // One after the other, because a password may be asked for.
        packages()?;
        rust()?;
    } else {
        let (packages, rust) = side_by_side(packages, rust);
        packages?;
        rust?;
    }

    let still = Missing::find(groups, &Machine::this()?, &root)?;
    if !still.is_empty() {
        bail!("installed, yet still not found: {}", still.names().join(" "));
    }
    Ok(true)
}

/// Packages are unpacked on one core, which leaves the others to the compilation of a tool.
fn side_by_side<A, B: Send>(here: impl FnOnce() -> A, there: impl FnOnce() -> B + Send) -> (A, B) {
    std::thread::scope(|scope| {
        let there = scope.spawn(there);
        let here = here();
        let there = there
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        (here, there)
    })
}

/// Prints the commands and decides whether they run: asks at the terminal unless consent was given beforehand.
fn agreed(consent: Consent, names: &[&str], rust: &[rust::Part]) -> Result<bool> {
    let mut commands = Vec::new();
    if !names.is_empty() {
        commands.push(apt::install_line(names));
    }
    commands.extend(rust.iter().map(|part| part.add_line()));
    let asks = consent == Consent::Ask && std::io::stdin().is_terminal();
    eprintln!(
        "\n{}",
        if consent == Consent::Refused {
            "Not installed, because of --no-install. To install it, run:"
        } else if asks {
            "This would run:"
        } else {
            "Installing what is missing (--no-install refuses):"
        }
    );
    for line in &commands {
        eprintln!("  {line}");
    }
    if !asks {
        return Ok(consent != Consent::Refused);
    }
    eprint!("Go ahead? [Y/n] ");
    std::io::stderr().flush()?;
    let mut answer = String::new();
    // Unlike an empty line, end of input is not an answer.
    let answered = std::io::stdin().lock().read_line(&mut answer)? > 0;
    Ok(answered && matches!(answer.trim().to_lowercase().as_str(), "" | "y" | "yes"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_wins() {
        let consent = |yes, no_install| Consent::from(Installing { yes, no_install });
        assert_eq!(consent(true, false), Consent::Given);
        assert_eq!(consent(true, true), Consent::Refused);
        assert_eq!(consent(false, true), Consent::Refused);
    }
}

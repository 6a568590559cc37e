//! The Python environment of the peers: `target/peers`, made once, with pinned packages.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::shell;

/// Pinned packages, from the root. The comment of a line names the peer whose package it is; a line without one serves all.
const REQUIREMENTS: &str = "host/lab/peers/requirements.txt";
/// The environment, from the root.
const FOLDER: &str = "target/peers";
/// Variable by which `mortise-lab peers` knows the interpreter.
const PYTHON: &str = "MORTISE_PEERS_PYTHON";
/// Variable by which it knows what could not be installed: lines `PEER: REASON`.
const MISSING: &str = "MORTISE_PEERS_MISSING";

/// A line of the requirements.
#[derive(Debug, PartialEq, Eq)]
struct Requirement<'t> {
    /// Package and version, as pip takes them.
    package: &'t str,
    /// The peer.
    peer: Option<&'t str>,
}

/// What there is.
#[derive(Debug, Default)]
pub struct Environment {
    python: Option<PathBuf>,
    /// Peers that cannot be had, and why.
    missing: Vec<(String, String)>,
}

impl Environment {
    /// Makes what is missing of it. What fails is noted with its reason.
    ///
    /// # Errors
    /// When the requirements cannot be read.
    pub fn make(root: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(root.join(REQUIREMENTS))
            .with_context(|| format!("reading {REQUIREMENTS}"))?;
        let requirements = requirements(&text);
        let folder = root.join(FOLDER);
        let python = folder.join(if cfg!(windows) {
            "Scripts/python.exe"
        } else {
            "bin/python"
        });
        if !python.is_file() {
            let mut venv = Command::new("python3");
            if let Err(why) = quiet(venv.args(["-m", "venv"]).arg(&folder)) {
                let peers = requirements.iter().filter_map(|requirement| requirement.peer);
                let why = format!("there is no Python environment: {why}");
                return Ok(Self {
                    python: None,
                    missing: peers.map(|peer| (peer.to_owned(), why.clone())).collect(),
                });
            }
        }
        let mut missing = Vec::new();
        for requirement in &requirements {
            let mut pip = Command::new(&python);
            // One at a time, so that one that cannot be had leaves the others.
            pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"])
                .arg("--constraint")
                .arg(root.join(REQUIREMENTS))
                .arg(requirement.package);
            if let Err(why) = quiet(&mut pip) {
                eprintln!("{} cannot be installed: {why}", requirement.package);
                missing.extend(requirement.peer.map(|peer| (peer.to_owned(), why)));
            }
        }
        Ok(Self {
            python: Some(python),
            missing,
        })
    }

    /// Names it to `mortise-lab peers`.
    pub fn apply(&self, command: &mut Command) {
        if let Some(python) = &self.python {
            command.env(PYTHON, python);
        }
        let line = |(peer, why): &(String, String)| format!("{peer}: {why}");
        command.env(
            MISSING,
            self.missing.iter().map(line).collect::<Vec<_>>().join("\n"),
        );
    }
}

fn requirements(text: &str) -> Vec<Requirement<'_>> {
    text.lines().filter_map(requirement).collect()
}

/// The requirement of a line; `None` for a comment alone.
fn requirement(line: &str) -> Option<Requirement<'_>> {
    let (package, peer) = match line.split_once('#') {
        Some((package, comment)) => (package.trim(), Some(comment.trim())),
        None => (line.trim(), None),
    };
    (!package.is_empty()).then_some(Requirement { package, peer })
}

/// Runs a command; the reason in one line when it fails: the last line that begins with `ERROR`, as pip's do, else the last line.
fn quiet(command: &mut Command) -> Result<(), String> {
    eprintln!("$ {}", shell::line_of(command));
    let output = command.output().map_err(|error| {
        let program = command.get_program().to_string_lossy().into_owned();
        format!("`{program}` cannot be started: {error}")
    })?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr) + String::from_utf8_lossy(&output.stdout);
    Err(reason(&said).unwrap_or_else(|| output.status.to_string()))
}

fn reason(said: &str) -> Option<String> {
    let mut lines = said.lines().map(str::trim).filter(|line| !line.is_empty());
    let error = said.lines().rfind(|line| line.starts_with("ERROR"));
    error.or_else(|| lines.next_back()).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requirements_name_their_peers() {
        let read = requirements("# all\nnumpy==2.0\n\ncoal==3.0.3  # coal\n");
        let wanted = [("numpy==2.0", None), ("coal==3.0.3", Some("coal"))];
        assert_eq!(read, wanted.map(|(package, peer)| Requirement { package, peer }));
    }

    #[test]
    fn every_package_of_the_repository_is_pinned() {
        let root = shell::root().unwrap();
        let text = std::fs::read_to_string(root.join(REQUIREMENTS)).unwrap();
        let all = requirements(&text);
        assert!(all.iter().any(|requirement| requirement.peer == Some("MuJoCo")));
        assert!(all.iter().all(|requirement| requirement.package.contains("==")));
    }

    #[test]
    fn the_reason_is_the_line_that_says_so() {
        let pip = "WARNING: a\nERROR: No matching distribution found for drake==0\n\n";
        assert_eq!(
            reason(pip).unwrap(),
            "ERROR: No matching distribution found for drake==0"
        );
        assert_eq!(
            reason("a\nModule venv is missing\n").unwrap(),
            "Module venv is missing"
        );
        assert_eq!(reason(" \n"), None);
    }
}

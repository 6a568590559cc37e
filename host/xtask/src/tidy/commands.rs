//! Checks a command named in docs against the help of the program it calls.

use std::collections::HashMap;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use crate::arguments;
use crate::program::{LAB, Programs};

/// Help texts, each asked for once.
pub struct Helps<'a> {
    programs: &'a Programs,
    texts: HashMap<Vec<String>, String>,
}

impl<'a> Helps<'a> {
    /// Helps of `cargo xtask` and of `programs`.
    pub fn new(programs: &'a Programs) -> Self {
        Self {
            programs,
            texts: HashMap::new(),
        }
    }

    /// What is wrong with `command`, if anything.
    ///
    /// # Errors
    /// When the program cannot be asked.
    pub fn complaint(&mut self, command: &str) -> Result<Option<String>> {
        complaint(command, &mut |chain| self.text(chain))
    }

    /// Help of the command that `chain` names, beginning with `mortise`, `mortise-lab` or `xtask`.
    fn text(&mut self, chain: &[String]) -> Result<String> {
        if let Some(text) = self.texts.get(chain) {
            return Ok(text.clone());
        }
        let text = if chain[0] == "xtask" {
            let name = chain.get(1).map(String::as_str);
            arguments::help(name).with_context(|| format!("`{}` has no help", shown(chain)))?
        } else {
            let path = if chain[0] == LAB {
                &self.programs.lab
            } else {
                &self.programs.mortise
            };
            let output = Command::new(path)
                .args(&chain[1..])
                .arg("--help")
                .stdin(Stdio::null())
                .output()
                .with_context(|| format!("{} cannot be started", path.display()))?;
            if !output.status.success() {
                bail!(
                    "`{} --help` failed: {}",
                    chain.join(" "),
                    String::from_utf8_lossy(&output.stderr).trim()
                );
            }
            String::from_utf8_lossy(&output.stdout).into_owned()
        };
        self.texts.insert(chain.to_vec(), text.clone());
        Ok(text)
    }
}

/// Follows subcommands as far as the help knows them, then looks for each option in the last help.
fn complaint(command: &str, help: &mut dyn FnMut(&[String]) -> Result<String>) -> Result<Option<String>> {
    let mut words = command
        .split_whitespace()
        .filter(|word| !matches!(*word, "…" | "..." | "[…]" | "[...]"));
    let program = match words.next() {
        Some("cargo") => words.next().unwrap_or_default(),
        Some(word) => word,
        None => return Ok(None),
    };
    let mut chain = vec![program.to_owned()];
    let mut text = help(&chain)?;
    let mut followed = true;
    for word in words {
        let word = word.trim_matches(['[', ']', '\'', '"', ',']);
        if word == "--" || word.is_empty() {
            followed = false;
        } else if word.starts_with('-') {
            followed = false;
            let option = word.split('=').next().unwrap_or(word);
            if !names_option(&text, option) {
                return Ok(Some(format!("`{}` has no option `{option}`", shown(&chain))));
            }
        } else if followed {
            let known = subcommands(&text);
            if known.contains(&word) {
                chain.push(word.to_owned());
                text = help(&chain)?;
            } else if !known.is_empty() && word.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'-')
            {
                return Ok(Some(format!("`{}` has no command `{word}`", shown(&chain))));
            } else {
                followed = false;
            }
        }
    }
    Ok(None)
}

fn shown(chain: &[String]) -> String {
    let start = if chain[0] == "xtask" { "cargo " } else { "" };
    format!("{start}{}", chain.join(" "))
}

/// First words of the lines below `Commands:`.
fn subcommands(help: &str) -> Vec<&str> {
    help.lines()
        .skip_while(|line| line.trim() != "Commands:")
        .skip(1)
        .take_while(|line| line.starts_with(' '))
        // A wrapped explanation is indented further than a name.
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .collect()
}

/// True if `help` has `option` as a whole word.
fn names_option(help: &str, option: &str) -> bool {
    help.match_indices(option).any(|(at, _)| {
        let before = help[..at].chars().next_back();
        let after = help[at + option.len()..].chars().next();
        let joins = |letter: char| letter.is_ascii_alphanumeric() || letter == '-';
        !before.is_some_and(joins) && !after.is_some_and(joins)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOT: &str = "Usage: mortise [FILE] [COMMAND]\n\nCommands:\n  inspect  What is in a file\n  probe    Distances\n\
        \x20          and contacts\n  help     Print this message\n\nOptions:\n  -h, --help  Print help\n";
    const INSPECT: &str =
        "Usage: mortise inspect [OPTIONS] <FILE>\n\nOptions:\n      --json-lines\n  -o, --output <OUT>\n";
    const EXPERIMENTS: &str =
        "Usage: mortise-lab <COMMAND>\n\nCommands:\n  figures  Measured\n\nOptions:\n      --quick\n";

    fn said(command: &str) -> Option<String> {
        complaint(command, &mut |chain| {
            Ok(match chain.join(" ").as_str() {
                "mortise" => ROOT.to_owned(),
                "mortise inspect" => INSPECT.to_owned(),
                "mortise-lab" => EXPERIMENTS.to_owned(),
                "mortise-lab figures" => "Options:\n      --quick\n      --json\n".to_owned(),
                "xtask" => arguments::help(None).unwrap(),
                other => arguments::help(other.strip_prefix("xtask ")).unwrap(),
            })
        })
        .unwrap()
    }

    #[test]
    fn what_the_help_names_passes() {
        for command in [
            "mortise",
            "mortise part.step",
            "mortise inspect FILE -o OUT",
            "mortise inspect --output=x.json",
            "mortise-lab figures end-to-end --quick --json",
            "cargo xtask demo --headless --json",
            "cargo xtask figures end-to-end",
            "cargo xtask setup [--yes]",
            "cargo xtask …",
        ] {
            assert_eq!(said(command), None, "{command}");
        }
    }

    #[test]
    fn what_the_help_does_not_name_is_found() {
        for (command, part) in [
            ("mortise inspekt FILE", "no command `inspekt`"),
            ("mortise and", "no command `and`"),
            (
                "mortise inspect FILE --json",
                "`mortise inspect` has no option `--json`",
            ),
            ("mortise-lab figures x --quickly", "no option `--quickly`"),
            ("cargo xtask tests", "no command `tests`"),
            (
                "cargo xtask tidy --yes",
                "`cargo xtask tidy` has no option `--yes`",
            ),
        ] {
            let found = said(command).unwrap_or_default();
            assert!(found.contains(part), "{command}: {found}");
        }
    }
}

//! `cargo xtask test`: every check of CI, cheapest first, stopping at the first failing step.
//!
//! Host crates are checked, tested and run in one profile, `release`, so that nothing large is compiled twice and the tested code is the code that
//! users run.

mod report;
mod steps;
mod window;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, bail};

use self::report::{Counts, Report};
use crate::program::Programs;
use crate::setup::{self, Consent, Group};
use crate::shell;

/// One check.
struct Step {
    name: &'static str,
    what: &'static str,
    run: fn(&mut Bench) -> Result<String>,
}

/// State shared by the steps.
struct Bench {
    root: PathBuf,
    /// The programs, once the step `build` has made them.
    programs: Option<Programs>,
    /// Tests counted in the current step.
    counts: Counts,
}

#[rustfmt::skip]
const STEPS: &[Step] = &[
    Step { name: "format", what: "rustfmt leaves every source as it is", run: steps::format },
    Step { name: "tidy", what: "paths named in docs exist, files are short, layers hold", run: steps::tidy },
    Step { name: "dependencies", what: "licences, sources, advisories and versions of all that is built on", run: steps::dependencies },
    Step { name: "lint", what: "clippy finds nothing in host crates and their tests", run: steps::lint },
    Step { name: "no-std", what: "board-side crates compile for the microcontroller", run: steps::no_std },
    Step { name: "lint-boards", what: "clippy finds nothing in the boards' firmware", run: steps::lint_boards },
    Step { name: "firmware", what: "every board links; flash and RAM use", run: steps::firmware },
    Step { name: "build", what: "the program, and every test", run: steps::build },
    Step { name: "unit", what: "unit, property and integration tests", run: steps::unit },
    Step { name: "unit-boards", what: "parts of boards that need no chip, tested here", run: steps::unit_boards },
    Step { name: "interleavings", what: "every interleaving of the two planes' threads, by a model checker", run: steps::interleavings },
    Step { name: "hil", what: "scenarios on the simulated and the emulated rig", run: steps::hil },
    Step { name: "fuzz", what: "random bytes for what reads frames, scenes, rigs and STEP files, 15 s each", run: steps::fuzz },
    Step { name: "docs", what: "every public item's documentation builds; commands named in pages exist", run: steps::docs },
    Step { name: "figures", what: "figures, the quick form: bounds hold, README and docs say what is measured", run: steps::figures },
    Step { name: "window", what: "the sample insertion moves in the program's window, on a virtual screen", run: window::run },
];

/// Runs the steps.
pub fn command(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let consent = Consent::take(&mut arguments);
    let chosen = choose(&arguments)?;
    let Some(chosen) = chosen else {
        for step in STEPS {
            println!("{:<12} {}", step.name, step.what);
        }
        return Ok(ExitCode::SUCCESS);
    };
    if !setup::ensure(&Group::ALL, consent)? {
        return Ok(ExitCode::FAILURE);
    }
    let mut bench = Bench {
        root: shell::root()?,
        programs: None,
        counts: Counts::default(),
    };
    let mut report = Report::default();
    for (index, step) in chosen.iter().enumerate() {
        println!(
            "\n=== {} of {}: {} - {}",
            index + 1,
            chosen.len(),
            step.name,
            step.what
        );
        let started = Instant::now();
        let outcome = (step.run)(&mut bench);
        report.add(
            step.name,
            started.elapsed(),
            std::mem::take(&mut bench.counts),
            outcome,
        );
        if report.failed() {
            break;
        }
    }
    let after: Vec<&str> = chosen.iter().skip(report.len()).map(|step| step.name).collect();
    print!("{}", report.text(&after));
    Ok(if report.failed() {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}

/// Steps selected by the arguments; `None` for `--list`.
fn choose(arguments: &[String]) -> Result<Option<Vec<&'static Step>>> {
    let position = |name: &str| {
        STEPS.iter().position(|step| step.name == name).with_context(|| {
            let names: Vec<&str> = STEPS.iter().map(|step| step.name).collect();
            format!("there is no step `{name}`; there are: {}", names.join(" "))
        })
    };
    let mut words = arguments.iter();
    let mut chosen: Vec<&Step> = STEPS.iter().collect();
    while let Some(word) = words.next() {
        let (option, value) = match word.split_once('=') {
            Some((option, value)) => (option, Some(value)),
            None => (word.as_str(), None),
        };
        let mut value = || {
            value
                .or_else(|| words.next().map(String::as_str))
                .with_context(|| format!("`{option}` needs a step"))
        };
        match option {
            "--list" => return Ok(None),
            "--from" => chosen = STEPS[position(value()?)?..].iter().collect(),
            "--only" => {
                let mut positions = value()?.split(',').map(position).collect::<Result<Vec<_>>>()?;
                positions.sort_unstable();
                positions.dedup();
                chosen = positions.into_iter().map(|index| &STEPS[index]).collect();
            }
            _ => bail!("`test` does not know `{word}`; see `cargo xtask test --help`"),
        }
    }
    Ok(Some(chosen))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(arguments: &[&str]) -> Result<Vec<&'static str>> {
        let arguments: Vec<String> = arguments.iter().map(|word| (*word).to_owned()).collect();
        Ok(choose(&arguments)?
            .unwrap_or_default()
            .into_iter()
            .map(|step| step.name)
            .collect())
    }

    #[test]
    fn steps_are_chosen_in_their_own_order() {
        assert_eq!(names(&[]).unwrap().len(), STEPS.len());
        assert_eq!(
            names(&["--only", "unit,format,unit"]).unwrap(),
            ["format", "unit"]
        );
        assert_eq!(names(&["--from=figures"]).unwrap(), ["figures", "window"]);
        assert!(
            names(&["--only", "units"])
                .unwrap_err()
                .to_string()
                .contains("there are: format")
        );
        assert!(names(&["--from"]).is_err());
        assert!(names(&["--fast"]).is_err());
    }
}

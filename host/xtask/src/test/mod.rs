//! `cargo xtask test`: every check of CI, cheapest first, stopping at the first failing step.
//!
//! Host crates are checked, tested and run in one profile, `release`, so that nothing large is compiled twice and the tested code is the code that
//! users run.

mod bench;
mod binaries;
mod report;
mod steps;
mod window;

use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result};

use self::bench::Bench;
use self::report::{Counts, Report};
use crate::arguments::Test;
use crate::setup::{self, Group};
use crate::shell;

/// One check.
struct Step {
    name: &'static str,
    what: &'static str,
    run: fn(&mut Bench) -> Result<String>,
}

#[rustfmt::skip]
const STEPS: &[Step] = &[
    Step { name: "format", what: "rustfmt leaves every source as it is", run: steps::format },
    Step { name: "tidy", what: "paths named in docs exist, files are short, layers hold, no modules need each other", run: steps::tidy },
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
    Step { name: "package", what: "packages of the program; the archive runs with its own libraries", run: steps::package },
];

/// Runs the steps.
pub fn command(arguments: &Test) -> Result<ExitCode> {
    if arguments.list {
        for step in STEPS {
            println!("{:<12} {}", step.name, step.what);
        }
        return Ok(ExitCode::SUCCESS);
    }
    let chosen = choose(arguments)?;
    if !setup::ensure(&Group::ALL, arguments.installing.into())? {
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

/// Steps that the arguments ask for.
fn choose(arguments: &Test) -> Result<Vec<&'static Step>> {
    let position = |name: &str| {
        STEPS.iter().position(|step| step.name == name).with_context(|| {
            let names: Vec<&str> = STEPS.iter().map(|step| step.name).collect();
            format!("there is no step `{name}`; there are: {}", names.join(" "))
        })
    };
    if let Some(from) = &arguments.from {
        return Ok(STEPS[position(from)?..].iter().collect());
    }
    if arguments.only.is_empty() {
        return Ok(STEPS.iter().collect());
    }
    let only = arguments.only.iter().map(|name| position(name));
    let mut positions = only.collect::<Result<Vec<_>>>()?;
    positions.sort_unstable();
    positions.dedup();
    Ok(positions.into_iter().map(|index| &STEPS[index]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(only: &[&str], from: Option<&str>) -> Result<Vec<&'static str>> {
        let arguments = Test {
            only: only.iter().map(|&name| name.to_owned()).collect(),
            from: from.map(str::to_owned),
            ..Test::default()
        };
        Ok(choose(&arguments)?.into_iter().map(|step| step.name).collect())
    }

    #[test]
    fn steps_are_chosen_in_their_own_order() {
        assert_eq!(names(&[], None).unwrap().len(), STEPS.len());
        assert_eq!(
            names(&["unit", "format", "unit"], None).unwrap(),
            ["format", "unit"]
        );
        assert_eq!(
            names(&[], Some("figures")).unwrap(),
            ["figures", "window", "package"]
        );
        let unknown = names(&["units"], None).unwrap_err().to_string();
        assert!(unknown.contains("there are: format"), "{unknown}");
    }
}

//! Commands: a table of figures, the endurance run, and one for each experiment of the table. Each has `--json`.
//!
//! Exit code 0: done; 1: a bound does not hold; 2: failed, with the reason in one line on standard error.

mod costs;
mod endurance;
mod experiments;
mod figures;
mod row;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};
use mortise_output::program;

use experiments::Chosen;

const NAME: &str = "mortise-lab";

/// Experiments on Mortise, and measurement of its figures.
#[derive(Debug, Parser)]
#[command(name = NAME, version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Measure a table of figures; exit code 1 if a bound does not hold
    Figures(figures::Args),
    /// Keep a board busy for an hour of its own time, and check that nothing degrades; exit code 1 if something does
    Endurance(endurance::Args),
    /// Measure the board's cost table on the emulated board, and compare it with the firmware's
    Costs(costs::Args),
    #[command(flatten)]
    Experiment(Chosen),
}

/// Runs the program.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return program::usage(NAME, &error, Cli::command()),
    };
    program::end(
        NAME,
        match &cli.command {
            Command::Figures(args) => figures::run(args),
            Command::Endurance(args) => endurance::run(args),
            Command::Costs(args) => costs::run(args),
            Command::Experiment(chosen) => chosen.run(),
        },
    )
}

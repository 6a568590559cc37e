//! `mortise lab`: names the program that has the experiments.

use std::ffi::OsString;
use std::process::ExitCode;

/// Arguments that were meant for an experiment; not used.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub struct Args {
    /// Arguments of `mortise-lab`
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Refuses, and names the program to run.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let words = args
        .arguments
        .iter()
        .map(|word| format!(" {}", word.to_string_lossy()));
    let words: String = words.collect();
    anyhow::bail!(
        "experiments are the program `mortise-lab`: run `mortise-lab{words}`, or in the repository `cargo run --release --package mortise-lab --{words}`"
    );
}

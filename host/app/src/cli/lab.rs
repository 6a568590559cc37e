//! `mortise lab`: experiments and figures.

use std::process::ExitCode;

use anyhow::Context as _;
use clap::Subcommand;
use mortise_lab::figures::{self, Plan, Value};

use super::output;
use crate::sample;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    experiment: Experiment,
}

#[derive(Debug, Subcommand)]
enum Experiment {
    /// Measure a table of figures; exit code 1 when one does not hold
    Figures {
        /// Name of the table
        #[arg(value_parser = clap::builder::PossibleValuesParser::new(figures::NAMES))]
        name: String,
        /// The shorter form, as each row says
        #[arg(long)]
        quick: bool,
        /// One JSON object a row
        #[arg(long)]
        json: bool,
    },
}

/// Runs it.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let Experiment::Figures { name, quick, json } = &args.experiment;
    let program = std::env::current_exe().context("finding this program")?;
    let sample = sample::File::write().context("writing the sample to a temporary file")?;
    let plan = Plan {
        quick: *quick,
        program: &program,
        pair: sample.path(),
    };
    let mut holds = true;
    let mut written = Ok(());
    figures::figures(name, &plan, &mut |row| {
        holds &= row.holds;
        let line = if *json {
            output::json(&row)
        } else {
            let mark = if row.holds { "ok  " } else { "FAIL" };
            let value = match &row.value {
                Value::Number(number) => format!("{number}"),
                Value::Text(text) => text.clone(),
            };
            output::line(&format!(
                "{mark} {}: {value} {} ({})",
                row.what, row.unit, row.bound
            ))
        };
        if written.is_ok() {
            written = line;
        }
    })?;
    written?;
    Ok(if holds {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

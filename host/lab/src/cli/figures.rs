//! `mortise-lab figures`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use mortise_lab::figures::{self, Claims, Plan};
use mortise_output::lines;
use mortise_scenario::sample;

use super::row;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Name of the table
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(figures::names()))]
    name: String,
    /// Shorter form; each row states its scope
    #[arg(long)]
    quick: bool,
    /// One part of the table alone; only `contact` has parts
    #[arg(long, value_name = "PART")]
    only: Option<String>,
    /// One JSON object a row
    #[arg(long)]
    json: bool,
    /// Source of the claims by which rows are judged
    #[arg(long, value_enum, default_value = "kept")]
    claims: ClaimSource,
    /// Path of the program `mortise`, whose commands some rows measure [default: beside this program]
    #[arg(long, value_name = "PATH")]
    program: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum ClaimSource {
    /// Claims built into the program; a row without one makes the last row fail
    Kept,
    /// Claims built into the program, completed by measured values
    Completed,
    /// Measured values
    Measured,
}

/// Runs it.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let program = mortise(args.program.as_ref())?;
    let sample = sample::File::write().context("writing the sample to a temporary file")?;
    let plan = Plan {
        quick: args.quick,
        program: &program,
        pair: sample.path(),
        only: args.only.as_deref(),
    };
    let claims = match args.claims {
        ClaimSource::Kept => Claims::kept()?,
        ClaimSource::Completed => Claims::completed()?,
        ClaimSource::Measured => Claims::measured(),
    };
    let mut written = Ok(());
    let count = figures::figures(&args.name, &plan, &claims, &mut |row| {
        if written.is_ok() {
            written = if args.json {
                lines::json(&row)
            } else {
                row::print(&row)
            };
        }
    })?;
    written?;
    if args.json {
        eprintln!("{count}");
    } else {
        lines::text(&count.to_string())?;
    }
    Ok(row::exit_code(&count))
}

/// Path of the program `mortise`.
fn mortise(named: Option<&PathBuf>) -> anyhow::Result<PathBuf> {
    let path = match named {
        Some(path) => path.clone(),
        None => std::env::current_exe()
            .context("finding this program")?
            .with_file_name(format!("mortise{}", std::env::consts::EXE_SUFFIX)),
    };
    if !path.is_file() {
        anyhow::bail!(
            "the program {} is not there; `cargo build --release` makes it, or name it with --program",
            path.display()
        );
    }
    Ok(path)
}

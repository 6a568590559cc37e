//! `mortise-lab endurance`.

use std::process::ExitCode;

use mortise_lab::endurance;
use mortise_lab::figures::Count;
use mortise_output::lines;
use mortise_rig::RigSpec;

use super::row;

/// Virtual time of the quick form, s.
const QUICK_S: f64 = 180.0;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Virtual time, hours
    #[arg(
        long,
        default_value_t = 1.0,
        allow_negative_numbers = true,
        value_name = "HOURS"
    )]
    hours: f64,
    /// Shorter form: three minutes of virtual time
    #[arg(long, conflicts_with = "hours")]
    quick: bool,
    /// Seed of random scenes, hands and faults
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// emulated, or sim
    #[arg(long, default_value = "emulated")]
    rig: RigSpec,
    /// One JSON object a turn, and the report
    #[arg(long)]
    json: bool,
}

/// Runs it.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let seconds = if args.quick { QUICK_S } else { 3600.0 * args.hours };
    if !(1.0..=360_000.0).contains(&seconds) {
        anyhow::bail!("{seconds} s is no time for an endurance run: 1 s to 100 h");
    }
    let mut written = Ok(());
    let report = endurance::run(&args.rig, seconds as u32, args.seed, &mut |turn| {
        if written.is_ok() {
            written = if args.json {
                lines::json(turn)
            } else {
                lines::text(&turn.to_string())
            };
        }
    })?;
    written?;
    if args.json {
        lines::json(&report)?;
    }
    let mut count = Count::default();
    for row in report.rows() {
        count.add(&row);
        if !args.json {
            row::print(&row)?;
        }
    }
    Ok(row::exit_code(&count))
}

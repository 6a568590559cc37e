//! `mortise-lab costs`.

use std::path::PathBuf;
use std::process::ExitCode;

use mortise_lab::costs;
use mortise_output::{Existing, Output, lines};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Shorter form: four of the thirteen motions
    #[arg(long)]
    quick: bool,
    /// Write the numbers into this table, `firmware/haptics/src/collision/cost.rs`: those that are certain to a tenth, and only where the counts explain
    /// the ticks to 2 %. They change what the budget counts, and with it which points an overloaded tick decimates
    #[arg(long, value_name = "PATH")]
    write: Option<PathBuf>,
    /// One JSON object
    #[arg(long)]
    json: bool,
}

/// Runs it.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    // Refused before the motions are played, not after.
    let table = (args.write.as_ref())
        .map(|path| Output::new(path, Existing::Replace, &[""; 0]))
        .transpose()?;
    let costs = costs::measure(args.quick, &mut |motion, ticks| {
        eprintln!("{motion}: {ticks} ticks")
    })?;
    if args.json {
        lines::json(&costs)?;
    } else {
        for measured in &costs.measured {
            lines::text(&measured.to_string())?;
        }
        lines::text(&format!("not counted apart: {}", costs.unmeasured.join(", ")))?;
        lines::text(&format!(
            "{} ticks of {:.0} instructions in the mean, {:.0} unexplained (standard deviation)",
            costs.ticks, costs.mean, costs.residual
        ))?;
    }
    if let Some(table) = &table {
        let rows = costs.for_the_table()?;
        costs::rewrite(table, &rows)?;
        eprintln!("{}: {} rows written", table.path().display(), rows.len());
    }
    Ok(ExitCode::SUCCESS)
}

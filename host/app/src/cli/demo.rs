//! `mortise demo`: the sample insertion, in the window or without one.

use std::path::PathBuf;
use std::process::ExitCode;

use mortise_output::lines;
use mortise_rig::{EmulatedMode, RigSpec};
use mortise_scenario::{Outcome, Scenario};

use super::{Picture, Reading};
use crate::session::Intent;
use crate::ui::app;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file with a peg before a hole [default: the sample that comes with the program]
    file: Option<PathBuf>,
    /// Without a window: play the insertion tick by tick and print what was measured
    #[arg(long)]
    headless: bool,
    /// sim, emulated, or a serial port [default: emulated if it is there, else sim]
    #[arg(long, value_parser = super::rig)]
    rig: Option<RigSpec>,
    /// One JSON object (with --headless)
    #[arg(long, requires = "headless")]
    json: bool,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    picture: Picture,
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    if args.headless {
        return headless(&args);
    }
    if let Some(file) = &args.file {
        super::mistyped::check_file(file)?;
    }
    let mut first = Vec::new();
    first.extend(args.file.map(Intent::Open));
    first.push(Intent::Demo(args.rig));
    let mut options = args.picture.options(first)?;
    // What happens in a hole is seen through its walls.
    options.see_through = true;
    app::run(options)?;
    Ok(ExitCode::SUCCESS)
}

fn headless(args: &Args) -> anyhow::Result<ExitCode> {
    let rig = args.rig.clone().unwrap_or_else(best_rig);
    // The sample's file is removed when this is dropped, after the run.
    let sample = match &args.file {
        Some(_) => None,
        None => Some(mortise_scenario::sample::File::write()?),
    };
    let step = match (&args.file, &sample) {
        (Some(file), _) => file.as_path(),
        (None, Some(sample)) => sample.path(),
        (None, None) => anyhow::bail!("there is no file to open"),
    };
    let scenario = Scenario::insertion(step)?;
    let outcome = mortise_scenario::run(&scenario, &rig)?;
    let verdicts = outcome.verdicts(&scenario.holds);
    if args.json {
        lines::json(&outcome)?;
    } else {
        table(&outcome)?;
        for verdict in &verdicts {
            lines::text(&format!("  {verdict}"))?;
        }
    }
    let holds = verdicts.iter().all(|verdict| verdict.holds);
    if !holds {
        for verdict in verdicts.iter().filter(|verdict| !verdict.holds) {
            eprintln!("mortise: {verdict}");
        }
    }
    Ok(if holds {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn table(outcome: &Outcome) -> std::io::Result<()> {
    let millimetres = |value: Option<f64>| value.map_or_else(|| "?".to_owned(), |v| format!("{v:.2}"));
    lines::text(&format!(
        "{} on {} ({}): inserted {} of {} mm in {} ticks, {} missed, at most {:.2} N",
        outcome.scenario,
        outcome.rig,
        outcome.board,
        millimetres(outcome.inserted_mm),
        millimetres(outcome.hole_mm),
        outcome.ticks,
        outcome.missed_ticks,
        outcome.peak_force_n,
    ))?;
    if let Some(instructions) = outcome.instructions_per_tick_max {
        lines::text(&format!("  dearest tick: {instructions} instructions"))?;
    }
    lines::text(&format!("  state hash: {}", outcome.state_hash))
}

/// The emulated board when it is there, else in-process, with a word about it.
fn best_rig() -> RigSpec {
    let emulated = RigSpec::Emulated {
        mode: EmulatedMode::Interactive,
        firmware: None,
    };
    let entry = mortise_rig::list()
        .into_iter()
        .find(|entry| entry.spec == emulated);
    match entry.map(|entry| entry.available) {
        Some(Ok(())) => emulated,
        other => {
            let why = other.and_then(Result::err).unwrap_or_default();
            eprintln!(
                "mortise: the emulated board is not there, so the simulation in this program is used: {why}"
            );
            RigSpec::Simulated { realtime: true }
        }
    }
}

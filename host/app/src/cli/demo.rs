//! `mortise demo`: the sample insertion, in the window or without one.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use mortise_output::{Existing, Output, lines};
use mortise_record::Recorder;
use mortise_rig::{EmulatedMode, RigSpec};
use mortise_scenario::{PreparedScene, Scenario, connect_with_scene, report, run_on};

use super::reading::Reading;
use super::{mistyped, units, window};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file with a peg in front of a hole [default: the built-in sample]
    file: Option<PathBuf>,
    /// Without a window: play the insertion tick by tick and print what was measured
    #[arg(long)]
    headless: bool,
    /// sim, emulated, or a serial port [default: emulated if it is there, else sim]
    #[arg(long, value_parser = units::rig)]
    rig: Option<RigSpec>,
    /// One JSON object (with --headless)
    #[arg(long, requires = "headless")]
    json: bool,
    /// Record the run to this new file, for `mortise replay` (with --headless)
    #[arg(long, value_name = "FILE", requires = "headless")]
    record: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    picture: window::Picture,
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    if args.headless {
        return headless(&args);
    }
    if let Some(file) = &args.file {
        mistyped::check_file(file)?;
    }
    window::demo(args.file, args.rig, args.picture)
}

fn headless(args: &Args) -> anyhow::Result<ExitCode> {
    if let Some(path) = &args.record {
        // Before the work begins.
        if path.exists() {
            anyhow::bail!(
                "{}: exists already, and no recording is replaced; give another name",
                path.display()
            );
        }
        Output::new(path, Existing::Keep, args.file.as_slice())?;
    }
    let rig = args.rig.clone().unwrap_or_else(best_rig);
    // A temporary file of the sample is removed when this is dropped, after the run.
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
    let began = Instant::now();
    let scene = PreparedScene::of(&scenario)?;
    let client = connect_with_scene(&scenario, &rig, &scene)?;
    // Standard output carries only the result.
    eprintln!(
        "{rig}: ready after {:.1} s, playing",
        began.elapsed().as_secs_f64()
    );
    let recorder = (args.record.as_ref())
        .map(|path| Recorder::start(&client, path))
        .transpose()?;
    if let Some(recorder) = &recorder {
        recorder.scene(&scene.image);
    }
    let outcome = run_on(&client, &scenario, &scene)?;
    if let Some(recorder) = recorder {
        let written = recorder.finish(Some(&client))?;
        eprintln!("recorded {} ticks to {}", written.ticks, written.path.display());
    }
    let verdicts = outcome.verdicts(&scenario.holds);
    if args.json {
        lines::json(&outcome)?;
    } else {
        lines::text(&report(&outcome, &verdicts))?;
    }
    let holds = verdicts.iter().all(|verdict| verdict.holds);
    if args.json {
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

/// The emulated board if it is available, else the in-process rig, with a message.
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

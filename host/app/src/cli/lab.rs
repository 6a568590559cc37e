//! `mortise lab`: experiments and figures.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Subcommand;
use mortise_lab::figures::{self, Plan, Row, Value};
use mortise_lab::study::{feature_size, shrink};
use mortise_lab::table::{prepare_folder, write_csv};
use mortise_lab::{blend, clearance, endurance, pareto, rate, stability};
use mortise_rig::RigSpec;

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
    /// Keep a board busy for an hour of its own time, and see whether anything wears; exit code 1 when it does
    Endurance {
        /// Virtual time
        #[arg(long, default_value_t = 1.0, value_name = "HOURS")]
        hours: f64,
        /// Three minutes of virtual time instead
        #[arg(long, conflicts_with = "hours")]
        quick: bool,
        /// Where random scenes, hands and faults start from
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// emulated, or sim
        #[arg(long, value_parser = super::rig, default_value = "emulated")]
        rig: RigSpec,
        /// One JSON object a turn, and the report
        #[arg(long)]
        json: bool,
    },
    /// Find the smallest clearance that assembles, by method and cell
    Clearance(Sweep),
    /// Hold accuracy against cost: error, smallest clearance, instructions, nanoseconds, bytes
    Pareto(Sweep),
    /// Show force and engagement over an insertion, the thesis' blend beside the default guidance
    Blend(Sweep),
    /// Find where closed loops become unstable, theory drawn beside
    Stability {
        #[command(flatten)]
        sweep: Sweep,
        /// Only the map of this name, that of its files
        #[arg(long, value_parser = clap::builder::PossibleValuesParser::new(stability::names()))]
        map: Option<String>,
    },
    /// Show the rate that a tick allows over an insertion: collision only, guided, guided with recognition; emulated board
    Rate(Sweep),
    /// Which voxels let a peg into its hole, and what shrinking does: 27 trials by a simulated operator, textbook voxmap
    Shrink(Sweep),
    /// Whether a feature's size matters: 62 trials by a simulated operator, textbook voxmap
    FeatureSize {
        #[command(flatten)]
        sweep: Sweep,
        /// How far points of the shell are moved inward, percent of a voxel
        #[arg(long, value_name = "PERCENT", default_value_t = feature_size::SHRINK_PERCENT)]
        shrink: f64,
    },
}

/// How a sweep is made and where it goes.
#[derive(Debug, clap::Args)]
struct Sweep {
    /// The shorter form: one cell size, clearance or pair, or the smallest pegs
    #[arg(long)]
    quick: bool,
    /// One JSON object a trial
    #[arg(long)]
    json: bool,
    /// Folder for tables (CSV) and charts (SVG and PNG); made where there is none
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

impl Experiment {
    /// How it is swept, where it is.
    fn sweep(&self) -> Option<&Sweep> {
        match self {
            Self::Clearance(sweep)
            | Self::Pareto(sweep)
            | Self::Blend(sweep)
            | Self::Stability { sweep, .. }
            | Self::Rate(sweep)
            | Self::Shrink(sweep)
            | Self::FeatureSize { sweep, .. } => Some(sweep),
            Self::Figures { .. } | Self::Endurance { .. } => None,
        }
    }
}

impl Sweep {
    fn tell(&self, row: &(impl serde::Serialize + std::fmt::Display)) -> anyhow::Result<()> {
        if self.json {
            output::json(row)
        } else {
            output::line(&row.to_string())
        }
    }
}

/// Runs it.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    if let Some(folder) = args.experiment.sweep().and_then(|sweep| sweep.out.as_ref()) {
        prepare_folder(folder)?;
    }
    match &args.experiment {
        Experiment::Figures { name, quick, json } => figures(name, *quick, *json),
        Experiment::Endurance {
            hours,
            quick,
            seed,
            rig,
            json,
        } => {
            let seconds = if *quick { 180.0 } else { 3600.0 * hours };
            endurance(rig, seconds, *seed, *json)
        }
        Experiment::Clearance(sweep) => clearance(sweep),
        Experiment::Pareto(sweep) => pareto(sweep),
        Experiment::Blend(sweep) => blend(sweep),
        Experiment::Stability { sweep, map } => stability(sweep, map.as_deref()),
        Experiment::Rate(sweep) => rate(sweep),
        Experiment::Shrink(sweep) => shrink(sweep),
        Experiment::FeatureSize { sweep, shrink } => feature_size(sweep, *shrink),
    }
}

fn endurance(rig: &RigSpec, seconds: f64, seed: u64, json: bool) -> anyhow::Result<ExitCode> {
    if !(1.0..=360_000.0).contains(&seconds) {
        anyhow::bail!("{seconds} s is no time for an endurance run: 1 s to 100 h");
    }
    let mut written = Ok(());
    let report = endurance::run(rig, seconds as u32, seed, &mut |turn| {
        let line = if json {
            output::json(turn)
        } else {
            output::line(&turn.to_string())
        };
        if written.is_ok() {
            written = line;
        }
    })?;
    written?;
    if json {
        output::json(&report)?;
    }
    let mut holds = true;
    for row in report.rows() {
        holds &= row.holds;
        if !json {
            tell_row(&row)?;
        }
    }
    Ok(if holds {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn tell_row(row: &Row) -> anyhow::Result<()> {
    let mark = if row.holds { "ok  " } else { "FAIL" };
    let value = match &row.value {
        Value::Number(number) => format!("{number}"),
        Value::Text(text) => text.clone(),
    };
    output::line(&format!(
        "{mark} {}: {value} {} ({})",
        row.what, row.unit, row.bound
    ))
}

fn clearance(sweep: &Sweep) -> anyhow::Result<ExitCode> {
    let mut trials = Vec::new();
    let mut written = Ok(());
    for variant in clearance::variants(sweep.quick) {
        clearance::smallest(&variant, &clearance::CLEARANCES_MM, &mut |trial| {
            if written.is_ok() {
                written = sweep.tell(&trial);
            }
            trials.push(trial);
        })?;
    }
    written?;
    if let Some(folder) = &sweep.out {
        write_csv(&trials, folder, "clearance")?;
        clearance::chart(&trials).write(folder, "clearance")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn pareto(sweep: &Sweep) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let entries = pareto::sweep(sweep.quick, &mut |entry| {
        if written.is_ok() {
            written = sweep.tell(entry);
        }
    })?;
    written?;
    if let Some(folder) = &sweep.out {
        write_csv(&entries, folder, "pareto")?;
        pareto::ticks_chart(&entries).write(folder, "pareto-ticks")?;
        pareto::time_chart(&entries).write(folder, "pareto-time")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn blend(sweep: &Sweep) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let courses = blend::sweep(sweep.quick, &mut |course| {
        if written.is_ok() {
            written = sweep.tell(course);
        }
    })?;
    written?;
    if let Some(folder) = &sweep.out {
        let moments: Vec<&blend::Moment> = courses.iter().flat_map(|course| &course.moments).collect();
        write_csv(&moments, folder, "blend")?;
        blend::draw(&courses, folder)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn rate(sweep: &Sweep) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let courses = rate::sweep(sweep.quick, &mut |course| {
        if written.is_ok() {
            written = sweep.tell(course);
        }
    })?;
    written?;
    if let Some(folder) = &sweep.out {
        let windows: Vec<&rate::Window> = courses.iter().flat_map(|course| &course.windows).collect();
        write_csv(&windows, folder, "rate")?;
        for pair in &rate::PAIRS {
            if courses.iter().any(|course| course.pair == pair.name) {
                rate::chart(pair, &courses).write(folder, pair.name)?;
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn shrink(sweep: &Sweep) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let study = shrink::study(sweep.quick, &mut |found| {
        if written.is_ok() {
            written = sweep.tell(&found);
        }
    })?;
    written?;
    if let Some(folder) = &sweep.out {
        let trials: Vec<&shrink::Trial> = study.trials.iter().chain(&study.ours).collect();
        write_csv(&trials, folder, "shrink")?;
        if !study.rules.is_empty() {
            write_csv(&study.terms, folder, "shrink-model")?;
            write_csv(&study.largest, folder, "shrink-rule")?;
            shrink::chart(&study).write(folder, "shrink")?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn feature_size(sweep: &Sweep, shrink: f64) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let study = feature_size::study(sweep.quick, shrink, &mut |found| {
        if written.is_ok() {
            written = sweep.tell(&found);
        }
    })?;
    written?;
    if let Some(folder) = &sweep.out {
        write_csv(&study.trials, folder, "feature-size")?;
        write_csv(&study.terms, folder, "feature-size-model")?;
        feature_size::chart(&study).write(folder, "feature-size")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn stability(sweep: &Sweep, only: Option<&str>) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let maps = stability::maps(sweep.quick, only, &mut |trial| {
        if written.is_ok() {
            written = sweep.tell(trial);
        }
    })?;
    written?;
    if let Some(folder) = &sweep.out {
        for map in &maps {
            map.write(folder)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn figures(name: &str, quick: bool, json: bool) -> anyhow::Result<ExitCode> {
    let program = std::env::current_exe().context("finding this program")?;
    let sample = sample::File::write().context("writing the sample to a temporary file")?;
    let plan = Plan {
        quick,
        program: &program,
        pair: sample.path(),
    };
    let mut holds = true;
    let mut written = Ok(());
    figures::figures(name, &plan, &mut |row| {
        holds &= row.holds;
        let line = if json { output::json(&row) } else { tell_row(&row) };
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

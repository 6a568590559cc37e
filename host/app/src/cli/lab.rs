//! `mortise lab`: experiments and figures.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Subcommand;
use mortise_lab::figures::{self, Claims, Count, Plan, Row, Value, Verdict};
use mortise_lab::study::{feature_size, shrink};
use mortise_lab::table::write_csv;
use mortise_lab::{blend, clearance, endurance, hybrid, pareto, rate, stability};
use mortise_output::{Existing, Folder};
use mortise_rig::RigSpec;

use super::output;
use mortise_scenario::sample;

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
        /// Where the claims that rows are judged by come from
        #[arg(long, value_enum, default_value = "kept")]
        claims: ClaimSource,
    },
    /// Keep a board busy for an hour of its own time, and see whether anything wears; exit code 1 when it does
    Endurance {
        /// Virtual time
        #[arg(
            long,
            default_value_t = 1.0,
            allow_negative_numbers = true,
            value_name = "HOURS"
        )]
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
    /// Which voxels let a peg into its hole, and what shrinking does: designs of 27 trials by a simulated operator, beside table 3 of the thesis
    Shrink(Sweep),
    /// Whether a feature's size matters: 62 trials by a simulated operator, beside tables 4 and 5 of the thesis
    FeatureSize(Sweep),
    /// The thesis' hybrid method on voxmaps: its three methods on its two pegs, beside table 6 and fig. 35
    Hybrid(Sweep),
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum ClaimSource {
    /// Those in the program; a row without one makes the last row fail
    Kept,
    /// Those in the program; of a row without one, what is measured
    Completed,
    /// What is measured
    Measured,
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
    /// Replace tables and charts that are there already
    #[arg(long, requires = "out")]
    force: bool,
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
            | Self::FeatureSize(sweep)
            | Self::Hybrid(sweep) => Some(sweep),
            Self::Figures { .. } | Self::Endurance { .. } => None,
        }
    }
}

impl Experiment {
    /// Names of the files that it may write: tables, then charts.
    fn files(&self) -> Vec<String> {
        let (tables, charts): (Vec<String>, Vec<String>) = match self {
            Self::Clearance(_) => (words(&["clearance"]), words(&["clearance"])),
            Self::Pareto(_) => (words(&["pareto"]), words(&["pareto-ticks", "pareto-time"])),
            Self::Blend(_) => {
                let charts = blend::CLEARANCES_MM.map(|clearance| format!("blend-{clearance}mm"));
                (words(&["blend"]), charts.into())
            }
            Self::Stability { map, .. } => {
                let mut maps = words(&stability::names());
                maps.retain(|name| map.as_ref().is_none_or(|only| only == name));
                (maps.clone(), maps)
            }
            Self::Rate(_) => (words(&["rate"]), words(&rate::PAIRS.map(|pair| pair.name))),
            Self::Shrink(_) => (words(&["shrink", "shrink-table-3"]), words(&["shrink"])),
            Self::FeatureSize(_) => (
                words(&["feature-size", "feature-size-model", "feature-size-tables-4-5"]),
                words(&["feature-size"]),
            ),
            Self::Hybrid(_) => (
                words(&["hybrid", "hybrid-rate", "hybrid-table-6"]),
                words(&["hybrid"]),
            ),
            Self::Figures { .. } | Self::Endurance { .. } => (Vec::new(), Vec::new()),
        };
        let tables = tables.iter().map(|name| format!("{name}.csv"));
        let charts = (charts.iter()).flat_map(|name| ["svg", "png"].map(|kind| format!("{name}.{kind}")));
        tables.chain(charts).collect()
    }
}

fn words(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

impl Sweep {
    /// Where tables and charts go, if anywhere; `files` are those that may be written.
    fn folder(&self, files: &[String]) -> anyhow::Result<Option<Folder>> {
        let folder = |path| Folder::new(path, Existing::from_force(self.force), files);
        Ok(self.out.as_ref().map(folder).transpose()?)
    }

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
    let files = args.experiment.files();
    // Before the first trial: a sweep of half an hour must not end in nothing.
    let out = (args.experiment.sweep()).map_or(Ok(None), |sweep| sweep.folder(&files))?;
    let out = out.as_ref();
    match &args.experiment {
        Experiment::Figures {
            name,
            quick,
            json,
            claims,
        } => figures(name, *quick, *json, *claims),
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
        Experiment::Clearance(sweep) => clearance(sweep, out),
        Experiment::Pareto(sweep) => pareto(sweep, out),
        Experiment::Blend(sweep) => blend(sweep, out),
        Experiment::Stability { sweep, map } => stability(sweep, map.as_deref(), out),
        Experiment::Rate(sweep) => rate(sweep, out),
        Experiment::Shrink(sweep) => shrink(sweep, out),
        Experiment::FeatureSize(sweep) => feature_size(sweep, out),
        Experiment::Hybrid(sweep) => hybrid(sweep, out),
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
    let mut count = Count::default();
    for row in report.rows() {
        count.add(&row);
        if !json {
            tell_row(&row)?;
        }
    }
    Ok(if count.all_hold() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn tell_row(row: &Row) -> anyhow::Result<()> {
    let mark = match row.verdict() {
        Verdict::Holds => "ok  ",
        Verdict::Fails => "FAIL",
        Verdict::Unbounded => "    ",
        Verdict::Skipped => "skip",
    };
    let value = match &row.value {
        Value::Number(number) => format!("{number}"),
        Value::Text(text) => text.clone(),
    };
    output::line(&format!(
        "{mark} {}: {value} {} (bound: {}){}{}",
        row.what,
        row.unit,
        row.bound(),
        row.remark().map_or("", |_| "; "),
        row.remark().unwrap_or_default()
    ))
}

fn clearance(sweep: &Sweep, out: Option<&Folder>) -> anyhow::Result<ExitCode> {
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
    if let Some(folder) = out {
        write_csv(&trials, folder, "clearance")?;
        clearance::chart(&trials).write(folder, "clearance")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn pareto(sweep: &Sweep, out: Option<&Folder>) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let entries = pareto::sweep(sweep.quick, &mut |entry| {
        if written.is_ok() {
            written = sweep.tell(entry);
        }
    })?;
    written?;
    if let Some(folder) = out {
        write_csv(&entries, folder, "pareto")?;
        pareto::ticks_chart(&entries).write(folder, "pareto-ticks")?;
        pareto::time_chart(&entries).write(folder, "pareto-time")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn blend(sweep: &Sweep, out: Option<&Folder>) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let courses = blend::sweep(sweep.quick, &mut |course| {
        if written.is_ok() {
            written = sweep.tell(course);
        }
    })?;
    written?;
    if let Some(folder) = out {
        let moments: Vec<&blend::Moment> = courses.iter().flat_map(|course| &course.moments).collect();
        write_csv(&moments, folder, "blend")?;
        blend::draw(&courses, folder)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn rate(sweep: &Sweep, out: Option<&Folder>) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let courses = rate::sweep(sweep.quick, &mut |course| {
        if written.is_ok() {
            written = sweep.tell(course);
        }
    })?;
    written?;
    if let Some(folder) = out {
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

fn shrink(sweep: &Sweep, out: Option<&Folder>) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let study = shrink::study(sweep.quick, &mut |found| {
        if written.is_ok() {
            written = sweep.tell(&found);
        }
    })?;
    written?;
    if let Some(folder) = out {
        write_csv(&study.trials, folder, "shrink")?;
        write_csv(&study.table, folder, "shrink-table-3")?;
        shrink::chart(&study).write(folder, "shrink")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn feature_size(sweep: &Sweep, out: Option<&Folder>) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let study = feature_size::study(sweep.quick, &mut |found| {
        if written.is_ok() {
            written = sweep.tell(&found);
        }
    })?;
    written?;
    if let Some(folder) = out {
        write_csv(&study.trials, folder, "feature-size")?;
        write_csv(&study.table, folder, "feature-size-tables-4-5")?;
        write_csv(&study.terms, folder, "feature-size-model")?;
        feature_size::chart(&study).write(folder, "feature-size")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn hybrid(sweep: &Sweep, out: Option<&Folder>) -> anyhow::Result<ExitCode> {
    let counts = hybrid::counts()?;
    for count in &counts {
        sweep.tell(count)?;
    }
    let mut written = Ok(());
    let courses = hybrid::sweep(sweep.quick, &mut |course| {
        if written.is_ok() {
            written = sweep.tell(course);
        }
    })?;
    written?;
    if let Some(folder) = out {
        write_csv(&counts, folder, "hybrid-table-6")?;
        write_csv(&courses, folder, "hybrid")?;
        let windows: Vec<&hybrid::Window> = courses.iter().flat_map(|course| &course.windows).collect();
        write_csv(&windows, folder, "hybrid-rate")?;
        hybrid::chart(&courses).write(folder, "hybrid")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn stability(sweep: &Sweep, only: Option<&str>, out: Option<&Folder>) -> anyhow::Result<ExitCode> {
    let mut written = Ok(());
    let maps = stability::maps(sweep.quick, only, &mut |trial| {
        if written.is_ok() {
            written = sweep.tell(trial);
        }
    })?;
    written?;
    if let Some(folder) = out {
        for map in &maps {
            map.write(folder)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn figures(name: &str, quick: bool, json: bool, claims: ClaimSource) -> anyhow::Result<ExitCode> {
    let program = std::env::current_exe().context("finding this program")?;
    let sample = sample::File::write().context("writing the sample to a temporary file")?;
    let plan = Plan {
        quick,
        program: &program,
        pair: sample.path(),
    };
    let claims = match claims {
        ClaimSource::Kept => Claims::kept()?,
        ClaimSource::Completed => Claims::completed()?,
        ClaimSource::Measured => Claims::measured(),
    };
    let mut written = Ok(());
    let count = figures::figures(name, &plan, &claims, &mut |row| {
        let line = if json { output::json(&row) } else { tell_row(&row) };
        if written.is_ok() {
            written = line;
        }
    })?;
    written?;
    if json {
        eprintln!("{count}");
    } else {
        output::line(&count.to_string())?;
    }
    Ok(if count.all_hold() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

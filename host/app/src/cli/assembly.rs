//! `mortise mobility`, `disassemble`, `assemble` and `features`: how the parts of an assembly are connected, move, and come apart.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use glam::DVec3;
use mortise_brep::LoadOptions;
use mortise_output::{Existing, Output, lines};
use mortise_rig::RigSpec;
use mortise_task::removal::{Budget, Removal, remove};
use mortise_task::report::{self, Sense, SequenceReport};
use mortise_task::sequence::{self, Sequence, Step};
use mortise_task::taxonomy::words;
use mortise_task::{Assembly, Wishes, catalogue, ports};
use serde::Serialize;

use super::played::{self, Played};
use super::reading::Reading;
use super::text_file;

/// The assembly of a command.
#[derive(Debug, clap::Args)]
struct Source {
    /// STEP file of an assembly, parts in their final places
    file: PathBuf,
    /// File (TOML) of what a STEP file cannot say: threads, and connections such as welded
    #[arg(long, value_name = "CATALOGUE")]
    catalogue: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

/// Arguments of `mobility`.
#[derive(Debug, clap::Args)]
pub struct MobilityArgs {
    #[command(flatten)]
    source: Source,
    /// One part instead of all; given several times, these parts as a group
    #[arg(long, value_name = "PART")]
    part: Vec<String>,
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// Arguments of `features`.
#[derive(Debug, clap::Args)]
pub struct FeaturesArgs {
    #[command(flatten)]
    source: Source,
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// Arguments of a search.
#[derive(Debug, clap::Args)]
pub struct SearchArgs {
    #[command(flatten)]
    source: Source,
    /// Limit on the time of the search, in seconds
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = super::units::seconds, allow_negative_numbers = true)]
    time: u64,
    /// Part that a fixture holds and that never moves; may be given several times
    #[arg(long, value_name = "PART")]
    held: Vec<String>,
    /// Direction in which parts fall: x, y, z, -x, -y, -z, or three numbers with commas. Parts that stay are not to fall, and are named where they would
    #[arg(long, value_name = "DIRECTION", value_parser = super::units::direction, allow_hyphen_values = true)]
    down: Option<DVec3>,
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl SearchArgs {
    fn wishes(&self, assembly: &Assembly) -> anyhow::Result<Wishes> {
        let held = self.held.iter().map(|name| Ok(assembly.part(name)?));
        Ok(Wishes {
            held: held.collect::<anyhow::Result<_>>()?,
            down: self.down,
        })
    }
}

/// Arguments of `assemble`.
#[derive(Debug, clap::Args)]
pub struct AssembleArgs {
    #[command(flatten)]
    search: SearchArgs,
    /// Page (HTML) to write, with the order, a picture of each step, and clearances
    #[arg(long, value_name = "PAGE")]
    report: Option<PathBuf>,
    /// Replace an existing page
    #[arg(long, requires = "report")]
    force: bool,
    /// Let a simulated hand put the parts together with contact, step by step, on this rig: sim or emulated
    #[arg(long, value_name = "RIG")]
    play: Option<RigSpec>,
}

/// Arguments of `disassemble`.
#[derive(Debug, clap::Args)]
pub struct DisassembleArgs {
    #[command(flatten)]
    search: SearchArgs,
    /// Take out this part alone, the others in place [default: take everything apart]
    #[arg(long, value_name = "PART", conflicts_with_all = ["held", "down"])]
    part: Option<String>,
}

/// Largest distance between a spline and the simpler surface recognised in it, mm: that of `contacts`.
const FIT_MM: f64 = 1e-3;

impl Source {
    fn read(&self) -> anyhow::Result<Assembly> {
        self.reading.apply();
        let options = LoadOptions {
            recognise_mm: FIT_MM,
            ..LoadOptions::default()
        };
        let text = (self.catalogue.as_ref())
            .map(|catalogue| text_file::read(catalogue, "a catalogue (TOML)"))
            .transpose()?;
        let mut assembly = Assembly::new(mortise_brep::load_step_with(&self.file, &options)?)?;
        if let (Some(text), Some(file)) = (text, &self.catalogue) {
            let stated = catalogue::read(&text, &assembly);
            assembly.stated = stated.with_context(|| file.display().to_string())?;
        }
        Ok(assembly)
    }
}

/// Runs `mobility`.
pub fn mobility(args: &MobilityArgs) -> anyhow::Result<ExitCode> {
    let assembly = args.source.read()?;
    let named = args.part.iter().map(|name| Ok(assembly.part(name)?));
    let named: Vec<usize> = named.collect::<anyhow::Result<_>>()?;
    let groups = match &named[..] {
        [] => (0..assembly.count()).map(|part| vec![part]).collect(),
        _ => vec![named],
    };
    let found = report::mobility(&assembly, &groups);
    if args.json {
        #[derive(Serialize)]
        struct Report<'a> {
            parts: Vec<report::PartMobility<'a>>,
            warnings: &'a [String],
        }
        lines::json(&Report {
            parts: found,
            warnings: &assembly.model.warnings,
        })?;
        return Ok(ExitCode::SUCCESS);
    }
    for part in &found {
        lines::text(&part.part)?;
        for t in &part.translations {
            let reach = match (t.range_mm, t.meets) {
                (Some(range), Some(meets)) => format!("{range:.3} mm to {meets}"),
                _ => "out".into(),
            };
            lines::text(&format!("  along {}: {reach}", report::direction(t.direction)))?;
        }
        for r in &part.rotations {
            let [x, y, z] = r.point_mm;
            let [back, forth] = r.range_deg;
            let range = if r.reach == mortise_task::mobility::Reach::Full {
                "all around".into()
            } else {
                format!("−{back:.2}° to {forth:.2}°")
            };
            lines::text(&format!(
                "  about {} through {x:.3}, {y:.3}, {z:.3} mm: {range}",
                report::direction(r.direction)
            ))?;
        }
        if part.translations.is_empty() && part.rotations.is_empty() {
            lines::text("  held")?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs `assemble`.
pub fn assemble(args: &AssembleArgs) -> anyhow::Result<ExitCode> {
    // A search of a minute is not for a file that cannot be written.
    let existing = Existing::from_force(args.force);
    let output = |path: &PathBuf| Output::new(path, existing, &[&args.search.source.file]);
    let output = args.report.as_ref().map(output).transpose()?;
    let client = args.play.as_ref().map(played::connect).transpose()?;
    let assembly = args.search.source.read()?;
    let all: Vec<usize> = (0..assembly.count()).collect();
    let wishes = args.search.wishes(&assembly)?;
    let time = Duration::from_secs(args.search.time);
    let found = sequence::disassemble_as(&assembly, &all, &wishes, time);
    let report = report::sequence(&assembly, &found, Sense::Assembly);
    let json = args.search.json;
    let mut code = ExitCode::SUCCESS;
    if !json || client.is_none() {
        code = print_sequence(&report, json)?;
    }
    let played = (client.as_ref())
        .map(|client| played::play(&assembly, &found, client, json))
        .transpose()?;
    if let Some(output) = output {
        let name = args.search.source.file.file_stem();
        let title = name.map_or("assembly".into(), |name| name.to_string_lossy());
        let felt = played.as_ref().map_or(&[][..], Played::felt);
        let pictures = mortise_page::pictures(&assembly, &found);
        let page = mortise_page::page(&title, &assembly, &found, &pictures, felt);
        output.write(page.as_bytes())?;
    }
    if let Some(played) = played {
        if report.verdict != "assembles" || !played.all_in() {
            code = ExitCode::from(1);
        }
        played.print(&report, json)?;
    }
    Ok(code)
}

/// Runs `disassemble`.
pub fn disassemble(args: &DisassembleArgs) -> anyhow::Result<ExitCode> {
    let search = &args.search;
    let assembly = search.source.read()?;
    let time = Duration::from_secs(search.time);
    let all: Vec<usize> = (0..assembly.count()).collect();
    let wishes = search.wishes(&assembly)?;
    let found = match &args.part {
        Some(name) => take_out(&assembly, assembly.part(name)?, time),
        None => sequence::disassemble_as(&assembly, &all, &wishes, time),
    };
    print_sequence(
        &report::sequence(&assembly, &found, Sense::Disassembly),
        search.json,
    )
}

/// Removal of one part, with those that it is permanently connected to, from all others in place.
fn take_out(assembly: &Assembly, part: usize, time: Duration) -> Sequence {
    let start = Instant::now();
    let (group, onto) = assembly.with_joined(&[part]);
    let mut found = Sequence {
        steps: Vec::new(),
        stuck: Vec::new(),
        timed_out: false,
        time,
    };
    match remove(assembly, &group, &onto, &[], &Budget::lasting(time)) {
        Removal::Out(path) => {
            let mut step = Step {
                group,
                onto,
                path,
                least: None,
                measured: false,
                falls: Vec::new(),
            };
            // A way that was found is measured, also when the time is nearly over.
            if let Some(least) = sequence::measure(assembly, &step, &time.into()) {
                step.least = least;
                step.measured = true;
            }
            found.steps.push(step);
        }
        Removal::Blocked(blocked) => found.stuck.push((group, blocked)),
        Removal::TimedOut(blocked) => {
            found.stuck.push((group, blocked));
            found.timed_out = true;
        }
    }
    found.time = start.elapsed();
    found
}

/// Prints a sequence; exit code 1 when parts stay together.
fn print_sequence(report: &SequenceReport<'_>, json: bool) -> anyhow::Result<ExitCode> {
    let code = if report.stuck.is_empty() && report.verdict != "timed_out" {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(1)
    };
    if json {
        lines::json(report)?;
        return Ok(code);
    }
    for step in &report.steps {
        lines::text(&format!("{}. {}", step.step, step.words()))?;
    }
    for joined in &report.joined {
        lines::text(&format!("{} are one", joined.join(", ")))?;
    }
    for stuck in &report.stuck {
        lines::text(&stuck.words())?;
    }
    lines::text(&format!(
        "{} in {:.1} s",
        report.verdict.replace('_', " "),
        report.time_s
    ))?;
    Ok(code)
}

/// Runs `features`.
pub fn features(args: &FeaturesArgs) -> anyhow::Result<ExitCode> {
    let assembly = args.source.read()?;
    let found: Vec<_> = (0..assembly.count())
        .map(|p| (assembly.name(p), ports::ports(&assembly, p)))
        .collect();
    if args.json {
        #[derive(Serialize)]
        struct Part<'a> {
            part: &'a str,
            ports: &'a [ports::Port],
        }
        #[derive(Serialize)]
        struct Report<'a> {
            parts: Vec<Part<'a>>,
            connections: Vec<report::FreeConnection<'a>>,
            warnings: &'a [String],
        }
        let parts = found.iter().map(|(part, ports)| Part { part, ports }).collect();
        lines::json(&Report {
            parts,
            connections: report::free_connections(&assembly),
            warnings: &assembly.model.warnings,
        })?;
        return Ok(ExitCode::SUCCESS);
    }
    for (part, ports) in &found {
        lines::text(part)?;
        for port in ports {
            lines::text(&format!("  {port}"))?;
        }
    }
    for c in &report::connections(&assembly) {
        lines::text(&format!("{} – {}: {}", c.a, c.b, words(&c.kinds)))?;
    }
    Ok(ExitCode::SUCCESS)
}

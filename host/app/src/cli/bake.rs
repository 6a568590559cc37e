//! `mortise bake`: converts a STEP file to a scene image.

use std::io::{IsTerminal as _, Write as _};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use mortise_bake::{
    BakeOptions, BakeReport, Cache, Grabbable, Method, NoCache, Planned, PointshellKind, Progress, Request,
};
use mortise_output::{Existing, Output, lines};

use super::energies;
use super::reading::Reading;
use super::units;
use crate::folder_cache::FolderCache;
use crate::kept_model;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file
    file: PathBuf,
    /// Scene image to write
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Replace an existing OUT
    #[arg(long)]
    force: bool,
    /// Largest error of gaps and depths where parts fit, such as 5um (ten times that elsewhere) [default: 10um]
    #[arg(long, value_name = "LENGTH", value_parser = units::length_mm, allow_hyphen_values = true)]
    accuracy: Option<f64>,
    /// Largest size of the image, such as 384KiB [default: 512KiB, a slot of the board]
    #[arg(long, value_name = "BYTES", alias = "limit", value_parser = units::bytes, allow_hyphen_values = true)]
    flash: Option<u64>,
    /// Largest estimated number of instructions per tick
    #[arg(long, value_name = "INSTRUCTIONS", conflicts_with_all = EXPLICIT, value_parser = units::instructions, allow_negative_numbers = true)]
    tick: Option<u64>,
    /// Cell edge, mm, instead of a plan by accuracy
    #[arg(
        long,
        value_name = "MM",
        conflicts_with = "accuracy",
        value_parser = units::real,
        allow_negative_numbers = true
    )]
    cell: Option<f64>,
    /// Contact method, instead of a plan by accuracy: distance-field or occupancy (the textbook's)
    #[arg(long, value_name = "METHOD", conflicts_with = "accuracy")]
    method: Option<Method>,
    /// Pointshell, instead of a plan by accuracy: error-bounded, or classic (the textbook's: one point per voxel)
    #[arg(long, value_name = "SHELL", value_parser = ["error-bounded", "classic"], conflicts_with = "accuracy")]
    shell: Option<String>,
    /// Voxel edge of the classic shell, mm [default: the cell]
    #[arg(long, value_name = "MM", requires = "shell", value_parser = units::real, allow_negative_numbers = true)]
    voxel: Option<f64>,
    /// Inward shift of the classic shell's points, percent of a voxel [default: 0]
    #[arg(
        long,
        value_name = "PERCENT",
        requires = "shell",
        value_parser = units::real,
        allow_negative_numbers = true
    )]
    shrink: Option<f64>,
    /// Part that may be grabbed, by name; repeatable [default: all but the largest]
    #[arg(long, value_name = "NAME")]
    grabbable: Vec<String>,
    /// Geometric energy that draws a part to its fit in another one, MOVING:AGAINST by name, 32 KiB each; repeatable
    #[arg(long, value_name = "PAIR", value_parser = energies::names)]
    energy: Vec<energies::Names>,
    /// Neither use nor keep results of earlier bakes
    #[arg(long)]
    no_cache: bool,
    #[command(flatten)]
    reading: Reading,
    /// Print one JSON object: bytes by part and kind
    #[arg(long)]
    json: bool,
}

/// Options that describe an image, where a plan would choose.
const EXPLICIT: [&str; 3] = ["cell", "method", "shell"];

impl Args {
    fn grabbable(&self) -> Grabbable {
        if self.grabbable.is_empty() {
            Grabbable::default()
        } else {
            Grabbable::Named(self.grabbable.clone())
        }
    }

    /// The image described, where one is.
    fn explicit(&self, energy_bytes: u64) -> Option<BakeOptions> {
        let described = self.cell.is_some() || self.method.is_some() || self.shell.is_some();
        described.then(|| BakeOptions {
            method: self.method.unwrap_or_default(),
            cell_mm: self.cell,
            shell: match self.shell.as_deref() {
                Some("classic") => PointshellKind::Classic {
                    voxel_mm: self.voxel,
                    shrink_percent: self.shrink.unwrap_or(0.0),
                },
                _ => PointshellKind::ErrorBounded,
            },
            image_limit_bytes: (self.flash.unwrap_or(mortise_bake::SLOT_BYTES)).saturating_sub(energy_bytes),
            grabbable: self.grabbable(),
            ..BakeOptions::default()
        })
    }

    /// What is planned for, with room left for the energies.
    fn request(&self, energy_bytes: u64) -> Request {
        let asked = Request::default();
        Request {
            accuracy_mm: self.accuracy.unwrap_or(asked.accuracy_mm),
            flash_bytes: (self.flash.unwrap_or(asked.flash_bytes)).saturating_sub(energy_bytes),
            tick_instructions: self.tick,
            grabbable: self.grabbable(),
        }
    }
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    let existing = Existing::from_force(args.force);
    let mut target = Output::new(&args.output, existing, &[&args.file])?;
    let folder = if args.no_cache {
        None
    } else {
        FolderCache::of_user()
    };
    let cache: &dyn Cache = folder.as_ref().map_or(&NoCache, |folder| folder);
    let model = kept_model::load(&args.file, cache)?;
    target.add_inputs(&model.files)?;
    let terminal = std::io::stderr().is_terminal();
    let progress = |progress: Progress| {
        if terminal {
            show(&progress);
        }
        ControlFlow::Continue(())
    };
    let in_file = || args.file.display().to_string();
    let found = energies::of(&model, &args.energy).with_context(in_file)?;
    let energy_bytes = energies::bytes(&found);
    let Some(options) = args.explicit(energy_bytes) else {
        let request = args.request(energy_bytes);
        let result = mortise_bake::plan_with(&model, &request, cache, &progress);
        clear(terminal);
        warn_of(folder.as_ref());
        let mut planned = result.with_context(in_file)?;
        if planned.fits {
            planned.image = energies::attach(planned.image, &mut planned.plan.report, &found, &model)?;
            return print_plan(args, &target, &args.request(0), &planned, &model.warnings)
                .with_context(in_file);
        }
        if energy_bytes > 0 && !args.json {
            lines::text(&format!(
                "The energies take {energy_bytes} bytes, which leave {} for the model.",
                request.flash_bytes
            ))?;
        }
        return print_plan(args, &target, &request, &planned, &model.warnings).with_context(in_file);
    };
    let result = mortise_bake::bake(&model, &options, &progress);
    clear(terminal);
    warn_of(folder.as_ref());
    let mut baked = result.with_context(in_file)?;
    baked.image = energies::attach(baked.image, &mut baked.report, &found, &model)?;
    target.write(&baked.image)?;
    if args.json {
        lines::json(&baked.report)?;
        return Ok(ExitCode::SUCCESS);
    }
    let report = &baked.report;
    print_image(args, report)?;
    for shape in &report.shapes {
        lines::text(&format!(
            "  {}: cells of {:.3} mm, {} bricks, {} points, {} bytes",
            shape.name,
            shape.cell_mm,
            shape.bricks,
            shape.points.iter().sum::<usize>(),
            shape.bytes.total()
        ))?;
    }
    print_warnings(&model.warnings, report)?;
    Ok(ExitCode::SUCCESS)
}

/// Says what went wrong with the cache.
fn warn_of(folder: Option<&FolderCache>) {
    for warning in folder.into_iter().flat_map(FolderCache::finish) {
        eprintln!("warning: {warning}");
    }
}

/// Shows progress on the terminal.
fn show(progress: &Progress) {
    let (index, count) = progress.shape;
    let mut err = std::io::stderr().lock();
    // A closed terminal must not stop the bake.
    let _ = write!(
        err,
        "\r\x1b[K{:?} of {} ({}/{count}) {:3.0} %",
        progress.stage,
        progress.part,
        (index + 1).min(count),
        100.0 * progress.fraction
    );
}

fn clear(terminal: bool) {
    if terminal {
        eprint!("\r\x1b[K");
    }
}

fn print_image(args: &Args, report: &BakeReport) -> std::io::Result<()> {
    lines::text(&format!(
        "{}: {} bytes, {} parts, {} shapes",
        args.output.display(),
        report.image_bytes,
        report.parts.len(),
        report.shapes.len()
    ))
}

fn print_warnings(model: &[String], report: &BakeReport) -> anyhow::Result<()> {
    for warning in model.iter().chain(&report.warnings) {
        lines::text(&format!("  warning: {warning}"))?;
    }
    Ok(())
}

/// Prints the plan as text or JSON; writes the image when it fits, as accurate as asked or as there is room for.
fn print_plan(
    args: &Args,
    target: &Output,
    request: &Request,
    planned: &Planned,
    warnings: &[String],
) -> anyhow::Result<ExitCode> {
    let plan = &planned.plan;
    if planned.fits {
        target.write(&planned.image)?;
    }
    let code = if planned.fits {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    };
    if args.json {
        lines::json(&serde_json::json!({
            "met": planned.met,
            "fits": planned.fits,
            "limit": planned.limit,
            "request": request,
            "plan": plan,
        }))?;
        return Ok(code);
    }
    let um = |mm: f64| 1000.0 * mm;
    if planned.fits {
        print_image(args, &plan.report)?;
    }
    let indent = if planned.fits { "  " } else { "" };
    lines::text(&format!("{indent}{}", planned.reached(request)))?;
    for (shape, made) in plan.shapes.iter().zip(&plan.report.shapes) {
        lines::text(&format!(
            "  {}: cells of {:.3} mm, {:?}, limited by {}; error {:.2} µm in fits ({:.2} field, {:.2} shell), {:.1} µm elsewhere",
            shape.name,
            shape.cell_mm,
            shape.format,
            shape.why,
            um(shape.field_error_in_fits_mm + shape.shell_error_in_fits_mm),
            um(shape.field_error_in_fits_mm),
            um(shape.shell_error_in_fits_mm),
            um(shape.error_elsewhere_mm),
        ))?;
        lines::text(&format!(
            "    {} points, {} bricks, {} bytes{}{}",
            made.points.iter().sum::<usize>(),
            made.bricks,
            made.bytes.total(),
            count(", taken as edges", shape.faces_taken_as_edges.len()),
            count(", out of reach, omitted", shape.faces_left_out.len()),
        ))?;
        if shape.error_at_edges_mm > shape.error_elsewhere_mm {
            lines::text(&format!(
                "    {:.1} µm at some edges",
                um(shape.error_at_edges_mm)
            ))?;
        }
    }
    for tick in plan.ticks.iter().take(3) {
        let cost = tick.cost;
        lines::text(&format!(
            "  holding {}: about {} instructions at worst, {} points near, {} touching",
            tick.name, cost.instructions, cost.points, cost.contacts
        ))?;
    }
    print_warnings(warnings, &plan.report)?;
    Ok(code)
}

fn count(what: &str, faces: usize) -> String {
    match faces {
        0 => String::new(),
        n => format!("{what}: {n} faces"),
    }
}

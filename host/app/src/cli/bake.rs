//! `mortise bake`: converts a STEP file to a scene image.

use std::io::{IsTerminal as _, Write as _};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use mortise_bake::{BakeOptions, BakeReport, Grabbable, Method, Planned, PointshellKind, Progress, Request};
use mortise_output::{Existing, Output, lines};

use super::reading::Reading;
use super::units;

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
    /// Cell edge, mm [default: chosen so that the image fits]
    #[arg(
        long,
        value_name = "MM",
        conflicts_with = "accuracy",
        allow_negative_numbers = true
    )]
    cell: Option<f64>,
    /// Largest error of gaps and depths where parts fit, such as 5um (ten times that elsewhere): plans the coarsest model that meets it
    #[arg(long, value_name = "LENGTH", value_parser = units::length_mm)]
    accuracy: Option<f64>,
    /// Largest size of the image, such as 512KiB [default: 1MiB]
    #[arg(long, value_name = "BYTES", alias = "limit", value_parser = units::bytes)]
    flash: Option<u64>,
    /// Largest estimated number of instructions per tick
    #[arg(long, value_name = "INSTRUCTIONS", requires = "accuracy", value_parser = clap::value_parser!(u64).range(1..))]
    tick: Option<u64>,
    /// Contact method: distance-field or occupancy (the textbook's)
    #[arg(long, value_name = "METHOD", default_value_t = Method::DistanceField, conflicts_with = "accuracy")]
    method: Method,
    /// Pointshell: error-bounded, or classic (the textbook's: one point per voxel)
    #[arg(long, value_name = "SHELL", default_value = "error-bounded", value_parser = ["error-bounded", "classic"], conflicts_with = "accuracy")]
    shell: String,
    /// Voxel edge of the classic shell, mm [default: the cell]
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    voxel: Option<f64>,
    /// Inward shift of the classic shell's points, percent of a voxel
    #[arg(
        long,
        value_name = "PERCENT",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    shrink: f64,
    /// Part that may be grabbed, by name; repeatable [default: all but the largest]
    #[arg(long, value_name = "NAME")]
    grabbable: Vec<String>,
    #[command(flatten)]
    reading: Reading,
    /// Print one JSON object: bytes by part and kind
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    let existing = Existing::from_force(args.force);
    let mut target = Output::new(&args.output, existing, &[&args.file])?;
    let model = mortise_brep::load_step(&args.file)?;
    target.add_inputs(&model.files)?;
    let mut options = BakeOptions {
        method: args.method,
        cell_mm: args.cell,
        shell: match args.shell.as_str() {
            "classic" => PointshellKind::Classic {
                voxel_mm: args.voxel,
                shrink_percent: args.shrink,
            },
            _ => PointshellKind::ErrorBounded,
        },
        ..BakeOptions::default()
    };
    if let Some(limit) = args.flash {
        options.image_limit_bytes = limit;
    }
    if !args.grabbable.is_empty() {
        options.grabbable = Grabbable::Named(args.grabbable.clone());
    }
    let terminal = std::io::stderr().is_terminal();
    let progress = |progress: Progress| {
        if terminal {
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
        ControlFlow::Continue(())
    };
    let in_file = || args.file.display().to_string();
    if let Some(accuracy_mm) = args.accuracy {
        let request = Request {
            accuracy_mm,
            flash_bytes: options.image_limit_bytes,
            tick_instructions: args.tick,
            grabbable: options.grabbable,
        };
        let result = mortise_bake::plan(&model, &request, &progress);
        clear(terminal);
        let planned = result.with_context(in_file)?;
        return print_plan(args, &target, &request, &planned, &model.warnings);
    }
    let result = mortise_bake::bake(&model, &options, &progress);
    clear(terminal);
    let baked = result.with_context(in_file)?;
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
            "request": request,
            "plan": plan,
        }))?;
        return Ok(code);
    }
    let um = |mm: f64| 1000.0 * mm;
    if planned.fits {
        print_image(args, &plan.report)?;
    }
    if !planned.met {
        lines::text(&reached(args, request, planned))?;
    }
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

/// What was reached of a request that is not met, and what limits it.
fn reached(args: &Args, request: &Request, planned: &Planned) -> String {
    let (plan, um) = (&planned.plan, |mm: f64| 1000.0 * mm);
    let cost = plan.ticks.first().map_or(0, |tick| tick.cost.instructions);
    let errors = format!(
        "{:.1} µm where parts fit and {:.1} µm elsewhere",
        um(plan.error_in_fits_mm()),
        um(plan.error_elsewhere_mm())
    );
    let file = args.file.display();
    if !planned.fits {
        return format!(
            "{file}: no model fits: the smallest found, with {errors}, takes {} bytes of {} and about {cost} instructions{}. Nothing was written.",
            plan.report.image_bytes,
            request.flash_bytes,
            request
                .tick_instructions
                .map_or_else(String::new, |most| format!(" of {most}")),
        );
    }
    let limit = match request.tick_instructions {
        Some(most) => format!("{} bytes and {most} instructions", request.flash_bytes),
        None => format!("{} bytes", request.flash_bytes),
    };
    format!(
        "  {:.3} µm where parts fit, and {:.0} times that elsewhere, was asked; reached are {errors}: the best found within {limit}",
        um(request.accuracy_mm),
        mortise_bake::ELSEWHERE,
    )
}

fn count(what: &str, faces: usize) -> String {
    match faces {
        0 => String::new(),
        n => format!("{what}: {n} faces"),
    }
}

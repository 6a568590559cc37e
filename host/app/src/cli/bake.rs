//! `mortise bake`: STEP file to scene image.

use std::io::{IsTerminal as _, Write as _};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use mortise_bake::{BakeOptions, Grabbable, Progress};

use super::output;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file
    file: PathBuf,
    /// Scene image to write
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Cell edge, mm [default: chosen so that the image fits]
    #[arg(long, value_name = "MM")]
    cell: Option<f64>,
    /// Most bytes the image may have
    #[arg(long, value_name = "BYTES")]
    limit: Option<u64>,
    /// Part that may be grabbed, by name; can be given several times [default: all but the largest]
    #[arg(long, value_name = "NAME")]
    grabbable: Vec<String>,
    /// One JSON object: bytes by part and kind
    #[arg(long)]
    json: bool,
}

/// Runs it.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let model = mortise_brep::load_step(&args.file)?;
    let mut options = BakeOptions {
        cell_mm: args.cell,
        ..BakeOptions::default()
    };
    if let Some(limit) = args.limit {
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
            // A terminal that is gone must not stop the bake.
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
    let result = mortise_bake::bake(&model, &options, &progress);
    if terminal {
        eprint!("\r\x1b[K");
    }
    let baked = result.with_context(|| args.file.display().to_string())?;
    write(&args.output, &baked.image)
        .with_context(|| format!("cannot write the scene image to {}", args.output.display()))?;
    if args.json {
        output::json(&baked.report)?;
        return Ok(ExitCode::SUCCESS);
    }
    let report = &baked.report;
    output::line(&format!(
        "{}: {} bytes, {} parts, {} shapes",
        args.output.display(),
        report.image_bytes,
        report.parts.len(),
        report.shapes.len()
    ))?;
    for shape in &report.shapes {
        output::line(&format!(
            "  {}: cells of {:.3} mm, {} bricks, {} points, {} bytes",
            shape.name,
            shape.cell_mm,
            shape.bricks,
            shape.points.iter().sum::<usize>(),
            shape.bytes.total()
        ))?;
    }
    for warning in model.warnings.iter().chain(&report.warnings) {
        output::line(&format!("  warning: {warning}"))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// All or nothing: written beside, then moved into place.
fn write(path: &std::path::Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let beside = PathBuf::from(beside);
    let written = std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, path));
    if written.is_err() {
        // Whatever part of it there is helps nobody.
        let _ = std::fs::remove_file(&beside);
    }
    written
}

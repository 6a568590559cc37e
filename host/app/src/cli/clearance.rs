//! `mortise clearance`: gaps and overlaps between the parts as placed in the file.

use std::path::PathBuf;
use std::process::ExitCode;

use mortise_inspect::{Pair, Solid, clearances};
use mortise_output::lines;
use mortise_task::Placed;
use serde::Serialize;

use super::reading::Reading;
use super::units;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file of an assembly
    file: PathBuf,
    /// Largest gap that is listed, as 100um or 0.1mm
    #[arg(long, value_name = "LENGTH", default_value = "1mm", allow_negative_numbers = true, value_parser = gap_mm)]
    below: f64,
    #[command(flatten)]
    reading: Reading,
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
}

fn gap_mm(text: &str) -> Result<f64, String> {
    let mm = units::length_mm(text)?;
    if mm > 0.0 {
        Ok(mm)
    } else {
        Err("must be more than 0".into())
    }
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    below_um: f64,
    /// Pairs that overlap, deepest first, then by gap.
    pairs: Vec<PairReport<'a>>,
    /// Number of pairs that overlap.
    overlapping: usize,
    warnings: &'a [String],
}

#[derive(Debug, Serialize)]
struct PairReport<'a> {
    a: &'a str,
    b: &'a str,
    /// `apart`, `touching` or `overlapping`.
    state: &'static str,
    /// Least gap; 0 where the parts touch or overlap.
    clearance_um: f64,
    /// Depth of the deepest surface point of either in the other; 0 where they do not overlap.
    overlap_um: f64,
    /// Where, in the file's frame.
    place_mm: [f64; 3],
    /// Unit direction in which `a` moves away from `b` there.
    away: [f64; 3],
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    let model = mortise_brep::load_step(&args.file)?;
    let solids: Vec<Option<Solid>> = model.shapes.iter().map(Solid::sampled).collect();
    // Parts without triangles are near to nothing.
    let (names, placed): (Vec<&str>, Vec<Placed<'_>>) = model
        .parts
        .iter()
        .filter_map(|part| {
            let body = solids.get(part.shape)?.as_ref()?.body()?;
            let pose = part.placement;
            Some((part.name.as_str(), Placed { body, pose }))
        })
        .unzip();
    let found = clearances(&placed, args.below);
    let report = Report {
        below_um: args.below * 1e3,
        overlapping: found.iter().filter(|pair| pair.overlaps()).count(),
        pairs: found.iter().map(|pair| pair_report(&names, pair)).collect(),
        warnings: &model.warnings,
    };
    if args.json {
        lines::json(&report)?;
    } else {
        table(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn pair_report<'a>(names: &[&'a str], pair: &Pair) -> PairReport<'a> {
    let [a, b] = pair.parts.map(|part| names[part]);
    let um = pair.least.distance_mm * 1e3;
    let (state, clearance_um, overlap_um) = if pair.overlaps() {
        ("overlapping", 0.0, -um)
    } else if pair.touches() {
        ("touching", 0.0, 0.0)
    } else {
        ("apart", um, 0.0)
    };
    PairReport {
        a,
        b,
        state,
        clearance_um,
        overlap_um,
        place_mm: pair.least.point.to_array(),
        away: pair.least.away.to_array(),
    }
}

fn table(report: &Report<'_>) -> anyhow::Result<()> {
    let count = report.pairs.len();
    lines::text(&format!(
        "{count} pair{} closer than {:.1} µm, {} overlapping",
        if count == 1 { "" } else { "s" },
        report.below_um,
        report.overlapping
    ))?;
    for pair in &report.pairs {
        let [x, y, z] = pair.place_mm;
        let said = match pair.state {
            "overlapping" => format!("overlap {:.1} µm", pair.overlap_um),
            "touching" => "touching".to_owned(),
            _ => format!("clearance {:.1} µm", pair.clearance_um),
        };
        lines::text(&format!(
            "  {} – {}: {said} at {x:.3}, {y:.3}, {z:.3} mm",
            pair.a, pair.b
        ))?;
    }
    for warning in report.warnings {
        lines::text(&format!("  warning: {warning}"))?;
    }
    Ok(())
}

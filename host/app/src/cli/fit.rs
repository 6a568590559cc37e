//! `mortise fit`: the poses at which two parts fit, and the way in.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use glam::DVec3;
use mortise_brep::LoadOptions;
use mortise_fit::{Fit, FitOptions, Path, PathKind, find, part_named};
use mortise_output::lines;
use serde::Serialize;

use super::reading::Reading;
use super::units;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file
    file: PathBuf,
    /// Part that is put in, by its name
    #[arg(long, value_name = "PART")]
    moving: String,
    /// Part that it is put into, which stays where it is
    #[arg(long, value_name = "PART")]
    against: String,
    /// Overlap that is tolerated, µm
    #[arg(long, value_name = "UM", default_value_t = 1.0, allow_negative_numbers = true, value_parser = overlap)]
    overlap: f64,
    #[command(flatten)]
    reading: Reading,
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// Largest overlap that may be tolerated, µm: beyond it parts do not fit.
const MOST_OVERLAP_UM: f64 = 100.0;

fn overlap(text: &str) -> Result<f64, String> {
    let number = units::real(text)?;
    if (0.0..=MOST_OVERLAP_UM).contains(&number) {
        Ok(number)
    } else {
        Err(format!("must be from 0 to {MOST_OVERLAP_UM}"))
    }
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    moving: &'a str,
    against: &'a str,
    fits: Vec<FitReport>,
    /// Time of the search, without reading the file.
    searched_s: f64,
    warnings: &'a [String],
}

#[derive(Debug, Serialize)]
struct FitReport {
    pose: Pose,
    score: f64,
    area_mm2: f64,
    clearance_um: ClearanceReport,
    residual_um: f64,
    /// Rigid motions that the mating faces leave free.
    freedom: usize,
    /// Pairs of face numbers: of the moving part and of the other.
    faces: Vec<[u32; 2]>,
    path: Option<PathReport>,
}

/// Placement of the moving part in the assembly's frame: x_assembly = R·x_part + p.
#[derive(Debug, Serialize)]
struct Pose {
    /// R, row by row.
    rotation: [f64; 9],
    translation_mm: [f64; 3],
}

#[derive(Debug, Serialize)]
struct ClearanceReport {
    min: f64,
    median: f64,
    max: f64,
}

#[derive(Debug, Serialize)]
struct PathReport {
    kind: &'static str,
    direction: [f64; 3],
    length_mm: f64,
    smallest_clearance_um: f64,
    /// Displacements from the fit at the corners of the way, from outside to the fit.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    corners_mm: Vec<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    screw: Option<ScrewReport>,
    /// Point on the axis along the direction about which the part can turn freely.
    #[serde(skip_serializing_if = "Option::is_none")]
    turns_about_mm: Option<[f64; 3]>,
    /// Whether the mating faces hold the part at the end of the way.
    ends: bool,
}

#[derive(Debug, Serialize)]
struct ScrewReport {
    point_mm: [f64; 3],
    pitch_mm: f64,
}

/// Runs the command. Exit code 1: nothing fits.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    // Exact surfaces answer; facets only lead to them, and coarse ones are made and searched faster.
    let reading = LoadOptions {
        relative_deflection: 1e-3,
        angular_deflection_rad: 0.3,
        ..LoadOptions::default()
    };
    let model = mortise_brep::load_step_with(&args.file, &reading)?;
    let [moving, against] = [
        part_named(&model, &args.moving)?,
        part_named(&model, &args.against)?,
    ];
    let options = FitOptions {
        overlap_mm: 1e-3 * args.overlap,
        ..FitOptions::default()
    };
    let started = Instant::now();
    let found = find(&model, moving, against, &options)?;
    let report = Report {
        moving: &args.moving,
        against: &args.against,
        fits: found.fits.iter().map(fit_report).collect(),
        searched_s: started.elapsed().as_secs_f64(),
        warnings: &model.warnings,
    };
    if args.json {
        lines::json(&report)?;
    } else {
        table(&report)?;
    }
    Ok(ExitCode::from(u8::from(report.fits.is_empty())))
}

fn fit_report(fit: &Fit) -> FitReport {
    let um = |mm: f64| 1e3 * mm;
    FitReport {
        pose: Pose {
            rotation: fit.placement.matrix3.transpose().to_cols_array(),
            translation_mm: fit.placement.translation.to_array(),
        },
        score: fit.score,
        area_mm2: fit.area_mm2,
        clearance_um: ClearanceReport {
            min: um(fit.clearance.min_mm),
            median: um(fit.clearance.median_mm),
            max: um(fit.clearance.max_mm),
        },
        residual_um: um(fit.residual_mm),
        freedom: fit.freedom,
        faces: fit.faces.clone(),
        path: fit.path.as_ref().map(path_report),
    }
}

fn path_report(path: &Path) -> PathReport {
    PathReport {
        kind: kind(path.kind),
        direction: path.direction.to_array(),
        length_mm: path.length_mm,
        smallest_clearance_um: 1e3 * path.smallest_clearance_mm,
        corners_mm: path.corners_mm.iter().map(|corner| corner.to_array()).collect(),
        screw: path.screw.map(|(point, pitch_mm)| ScrewReport {
            point_mm: point.to_array(),
            pitch_mm,
        }),
        turns_about_mm: path.spin.map(|point| point.to_array()),
        ends: path.ends,
    }
}

fn kind(kind: PathKind) -> &'static str {
    match kind {
        PathKind::Line => "line",
        PathKind::Screw => "screw",
        PathKind::Polyline => "polyline",
    }
}

fn table(report: &Report<'_>) -> anyhow::Result<()> {
    let count = report.fits.len();
    lines::text(&format!(
        "{count} fit{} of {} in {}, searched {:.1} s",
        if count == 1 { "" } else { "s" },
        report.moving,
        report.against,
        report.searched_s
    ))?;
    for fit in &report.fits {
        let at = DVec3::from_array(fit.pose.translation_mm);
        let gap = &fit.clearance_um;
        let way = fit.path.as_ref().map_or_else(
            || "no way in found".to_owned(),
            |path| {
                let d = path.direction;
                format!(
                    "{} along ({:.3}, {:.3}, {:.3}), {:.2} mm, clearance {:.2} µm",
                    path.kind, d[0], d[1], d[2], path.length_mm, path.smallest_clearance_um
                )
            },
        );
        lines::text(&format!(
            "  at ({:.3}, {:.3}, {:.3}) mm: {:.2} mm², gap {:.2} to {:.2} µm, residual {:.3} µm, {} free; {way}",
            at.x, at.y, at.z, fit.area_mm2, gap.min, gap.max, fit.residual_um, fit.freedom
        ))?;
    }
    for warning in report.warnings {
        lines::text(&format!("  warning: {warning}"))?;
    }
    Ok(())
}

//! `mortise inspect`: contents of a STEP file.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use mortise_brep::{CadModel, Part, Surface};
use mortise_output::lines;
use serde::Serialize;

use super::reading::Reading;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file
    file: PathBuf,
    #[command(flatten)]
    reading: Reading,
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    unit: &'a str,
    parts: Vec<PartReport<'a>>,
    warnings: &'a [String],
}

#[derive(Debug, Serialize)]
struct PartReport<'a> {
    name: &'a str,
    path: &'a [String],
    faces: BTreeMap<&'static str, usize>,
    edges: usize,
    triangles: usize,
    volume_mm3: f64,
    area_mm2: f64,
    center_of_mass_mm: [f64; 3],
    closed: bool,
    open_edges: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    color: Option<[f32; 3]>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    let model = mortise_brep::load_step(&args.file)?;
    let report = Report {
        unit: &model.unit,
        parts: (model.parts.iter())
            .filter_map(|part| part_report(&model, part))
            .collect(),
        warnings: &model.warnings,
    };
    if args.json {
        lines::json(&report)?;
    } else {
        table(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn part_report<'a>(model: &'a CadModel, part: &'a Part) -> Option<PartReport<'a>> {
    let shape = model.shapes.get(part.shape)?;
    let mut faces = BTreeMap::new();
    for face in &shape.faces {
        *faces.entry(kind(&face.surface)).or_insert(0) += 1;
    }
    Some(PartReport {
        name: &part.name,
        path: &part.path,
        faces,
        edges: shape.edges.len(),
        triangles: shape.mesh.triangles.len(),
        volume_mm3: shape.volume_mm3,
        area_mm2: shape.area_mm2,
        center_of_mass_mm: part.placement.transform_point3(shape.center_of_mass).to_array(),
        closed: shape.closed,
        open_edges: shape.open_edges,
        color: part.color,
    })
}

/// Name of a surface's kind.
fn kind(surface: &Surface) -> &'static str {
    match surface {
        Surface::Plane { .. } => "plane",
        Surface::Cylinder { .. } => "cylinder",
        Surface::Cone { .. } => "cone",
        Surface::Sphere { .. } => "sphere",
        Surface::Torus { .. } => "torus",
        Surface::Spline => "spline",
    }
}

fn table(report: &Report<'_>) -> anyhow::Result<()> {
    let count = report.parts.len();
    lines::text(&format!(
        "{count} part{}, unit {}",
        if count == 1 { "" } else { "s" },
        report.unit
    ))?;
    for part in &report.parts {
        let faces: Vec<String> = part.faces.iter().map(|(kind, n)| format!("{n} {kind}")).collect();
        let shell = if part.closed {
            "closed".to_owned()
        } else {
            format!("{} open edges", part.open_edges)
        };
        let mut name = part.path.to_vec();
        name.push(part.name.to_owned());
        lines::text(&format!(
            "  {}: {:.1} mm³, {shell}, faces: {}",
            name.join(" / "),
            part.volume_mm3,
            faces.join(", ")
        ))?;
    }
    for warning in report.warnings {
        lines::text(&format!("  warning: {warning}"))?;
    }
    Ok(())
}

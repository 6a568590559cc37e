//! `mortise section`: areas in which a plane cuts the parts.

use std::path::PathBuf;
use std::process::ExitCode;

use glam::DVec3;
use mortise_inspect::{CutPlane, Fineness, Section, Solid, section};
use mortise_output::lines;
use serde::Serialize;

use super::reading::Reading;
use super::units;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file
    file: PathBuf,
    /// Plane across an axis of the file: x=12.5mm, y=-3mm or z=250um
    #[arg(long, value_name = "AXIS=LENGTH", value_parser = plane)]
    plane: CutPlane,
    /// One part instead of all
    #[arg(long, value_name = "PART")]
    part: Option<String>,
    #[command(flatten)]
    reading: Reading,
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// Largest distance of a section's sides from the exact curves, mm.
const SAG_MM: f64 = 1e-3;

fn plane(text: &str) -> Result<CutPlane, String> {
    let wrong = || format!("`{text}` is not a plane; write it as in x=12.5mm");
    let (axis, length) = text.split_once('=').ok_or_else(wrong)?;
    let axis = match axis.trim() {
        "x" | "X" => DVec3::X,
        "y" | "Y" => DVec3::Y,
        "z" | "Z" => DVec3::Z,
        _ => return Err(wrong()),
    };
    CutPlane::new(axis * units::length_mm(length)?, axis).ok_or_else(wrong)
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    unit: &'static str,
    plane: PlaneReport,
    /// Parts that the plane cuts.
    parts: Vec<PartReport<'a>>,
    area_mm2: f64,
    warnings: &'a [String],
}

#[derive(Debug, Serialize)]
struct PlaneReport {
    origin_mm: [f64; 3],
    normal: [f64; 3],
}

#[derive(Debug, Serialize)]
struct PartReport<'a> {
    name: &'a str,
    path: &'a [String],
    /// Area of the solid in the plane.
    area_mm2: f64,
    /// Closed outlines, holes among them.
    outlines: usize,
    /// Lines in which an open shell is cut, which encloses no solid.
    open_lines: usize,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    let model = mortise_brep::load_step(&args.file)?;
    if let Some(name) = &args.part
        && !model.parts.iter().any(|part| part.name == *name)
    {
        let names: Vec<&str> = model.parts.iter().map(|part| part.name.as_str()).collect();
        anyhow::bail!("there is no part {name}; the file has {}", names.join(", "));
    }
    let mut solids: Vec<Option<Solid>> = model.shapes.iter().map(|_| None).collect();
    let mut parts = Vec::new();
    for part in &model.parts {
        if args.part.as_ref().is_some_and(|name| part.name != *name) {
            continue;
        }
        let (Some(shape), Some(solid)) = (model.shapes.get(part.shape), solids.get_mut(part.shape)) else {
            continue;
        };
        let solid = solid.get_or_insert_with(|| Solid::new(shape));
        let cut = section(solid, &part.placement, &args.plane, Fineness::Exact(SAG_MM));
        if !cut.is_empty() {
            parts.push(part_report(&part.name, &part.path, &cut));
        }
    }
    let report = Report {
        unit: "mm",
        plane: PlaneReport {
            origin_mm: args.plane.origin.to_array(),
            normal: args.plane.normal.to_array(),
        },
        area_mm2: parts.iter().map(|part| part.area_mm2).sum(),
        parts,
        warnings: &model.warnings,
    };
    if args.json {
        lines::json(&report)?;
    } else {
        table(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn part_report<'a>(name: &'a str, path: &'a [String], cut: &Section) -> PartReport<'a> {
    PartReport {
        name,
        path,
        area_mm2: cut.area_mm2(),
        outlines: cut.loops.len(),
        open_lines: cut.open.len(),
    }
}

fn table(report: &Report<'_>) -> anyhow::Result<()> {
    let count = report.parts.len();
    lines::text(&format!(
        "{count} part{} cut, {:.3} mm²",
        if count == 1 { "" } else { "s" },
        report.area_mm2
    ))?;
    for part in &report.parts {
        let open = match part.open_lines {
            0 => String::new(),
            1 => ", 1 line of an open shell".to_owned(),
            n => format!(", {n} lines of open shells"),
        };
        let outlines = if part.outlines == 1 { "outline" } else { "outlines" };
        let mut name = part.path.to_vec();
        name.push(part.name.to_owned());
        lines::text(&format!(
            "  {}: {:.3} mm², {} {outlines}{open}",
            name.join(" / "),
            part.area_mm2,
            part.outlines
        ))?;
    }
    for warning in report.warnings {
        lines::text(&format!("  warning: {warning}"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes() {
        let found = plane("x=12.5mm").unwrap();
        assert_eq!((found.origin, found.normal), (DVec3::X * 12.5, DVec3::X));
        assert_eq!(plane("z = -3 mm").unwrap().origin, DVec3::Z * -3.0);
        for text in ["x", "x=1", "w=1mm", "=1mm", "x=", ""] {
            assert!(plane(text).is_err(), "{text}");
        }
    }
}

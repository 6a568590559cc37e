//! `mortise contacts`: the contacts between parts, and their kinds.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use mortise_brep::{CadModel, LoadOptions};
use mortise_mating::{Axis, Contact, Tolerances, identify};
use mortise_output::lines;
use serde::Serialize;

use super::reading::Reading;
use super::units;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file
    file: PathBuf,
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
    /// Largest distance between two surfaces in contact, mm
    #[arg(long, default_value_t = Tolerances::default().linear_mm, value_name = "MM", allow_negative_numbers = true, value_parser = positive)]
    tolerance: f64,
    /// Largest distance between a spline and the plane, cylinder, cone or sphere recognised in it, mm
    #[arg(long, default_value_t = 1e-3, value_name = "MM", allow_negative_numbers = true, value_parser = positive)]
    fit: f64,
    #[command(flatten)]
    reading: Reading,
}

fn positive(text: &str) -> Result<f64, String> {
    let number = units::real(text)?;
    if number > 0.0 && number.is_finite() {
        Ok(number)
    } else {
        Err("must be more than 0".into())
    }
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    parts: Vec<&'a str>,
    contacts: Vec<PairReport<'a>>,
    warnings: &'a [String],
}

/// All contacts of one kind between two parts; the names are in alphabetical order.
#[derive(Debug, Serialize)]
struct PairReport<'a> {
    kind: &'static str,
    a: &'a str,
    b: &'a str,
    /// Number of contact patches.
    count: usize,
    /// Axis of the contact with the largest area.
    axis: AxisReport,
    radius_mm: Option<f64>,
    half_angle_rad: Option<f64>,
    /// Total area.
    area_mm2: f64,
    length_mm: f64,
    /// Largest deviation.
    fit_um: f64,
    /// One entry per pair of surfaces; faces on one surface are merged.
    surfaces: Vec<SurfaceReport>,
}

#[derive(Debug, Serialize)]
struct SurfaceReport {
    count: usize,
    axis: AxisReport,
    radius_mm: Option<f64>,
    half_angle_rad: Option<f64>,
    area_mm2: f64,
    length_mm: f64,
    fit_um: f64,
    /// Pairs of face numbers: of `a` and of `b`.
    faces: Vec<[u32; 2]>,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct AxisReport {
    origin_mm: [f64; 3],
    direction: [f64; 3],
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    let options = LoadOptions {
        recognise_mm: args.fit,
        ..LoadOptions::default()
    };
    let model = mortise_brep::load_step_with(&args.file, &options)?;
    let tolerances = Tolerances {
        linear_mm: args.tolerance,
        ..Tolerances::default()
    };
    let contacts = identify(&model, &tolerances);
    let report = Report {
        parts: model.parts.iter().map(|part| part.name.as_str()).collect(),
        contacts: pairs(&model, &contacts),
        warnings: &model.warnings,
    };
    if args.json {
        lines::json(&report)?
    } else {
        table(&report)?
    }
    Ok(ExitCode::SUCCESS)
}

fn pairs<'a>(model: &'a CadModel, contacts: &[Contact]) -> Vec<PairReport<'a>> {
    let mut pairs: BTreeMap<_, Vec<SurfaceReport>> = BTreeMap::new();
    for contact in contacts {
        let [a, b] = contact.parts.map(|part| model.parts[part].name.as_str());
        let turned = b < a;
        let key = if turned {
            (contact.kind, b, a)
        } else {
            (contact.kind, a, b)
        };
        pairs.entry(key).or_default().push(surface(contact, turned));
    }
    let pair = |((kind, a, b), mut surfaces): (
        (mortise_mating::ContactKind, &'a str, &'a str),
        Vec<SurfaceReport>,
    )| {
        surfaces.sort_by(|s, t| t.size().total_cmp(&s.size()));
        let largest = surfaces.first()?;
        Some(PairReport {
            kind: kind.name(),
            a,
            b,
            count: surfaces.iter().map(|s| s.count).sum(),
            axis: largest.axis,
            radius_mm: largest.radius_mm,
            half_angle_rad: largest.half_angle_rad,
            area_mm2: surfaces.iter().map(|s| s.area_mm2).sum(),
            length_mm: surfaces.iter().map(|s| s.length_mm).sum(),
            fit_um: surfaces.iter().map(|s| s.fit_um).fold(0.0, f64::max),
            surfaces,
        })
    };
    pairs.into_iter().filter_map(pair).collect()
}

impl SurfaceReport {
    fn size(&self) -> f64 {
        self.area_mm2 + self.length_mm
    }
}

/// `turned`: the parts are named in reverse order.
fn surface(contact: &Contact, turned: bool) -> SurfaceReport {
    SurfaceReport {
        count: contact.count,
        axis: axis(&contact.axis),
        radius_mm: contact.radius_mm,
        half_angle_rad: contact.half_angle_rad,
        area_mm2: contact.area_mm2,
        length_mm: contact.length_mm,
        fit_um: contact.fit_mm * 1e3,
        faces: contact
            .faces
            .iter()
            .map(|&[a, b]| if turned { [b, a] } else { [a, b] })
            .collect(),
    }
}

fn axis(axis: &Axis) -> AxisReport {
    AxisReport {
        origin_mm: axis.origin.to_array(),
        direction: axis.direction.to_array(),
    }
}

fn table(report: &Report<'_>) -> anyhow::Result<()> {
    let plural = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
    let (parts, pairs) = (report.parts.len(), report.contacts.len());
    lines::text(&format!(
        "{}, {}",
        plural(parts, "part"),
        plural(pairs, "pair of surfaces in contact")
            .replace("pair of surfaces in contacts", "pairs of surfaces in contact")
    ))?;
    for pair in &report.contacts {
        let times = if pair.count == 1 {
            String::new()
        } else {
            format!(" × {}", pair.count)
        };
        let diameter = pair
            .radius_mm
            .map_or(String::new(), |r| format!(", ⌀ {:.3} mm", 2.0 * r));
        let size = if pair.length_mm > 0.0 {
            format!("{:.2} mm long", pair.length_mm)
        } else {
            format!("{:.2} mm²", pair.area_mm2)
        };
        // Below a nanometre the deviation is rounding of a spline that represents the surface exactly.
        let fit = match pair.fit_um {
            0.0 => String::new(),
            um if um < 1e-3 => ", in splines".to_owned(),
            um => format!(", in splines to {um:.3} µm"),
        };
        lines::text(&format!(
            "  {}{times}: {} – {}{diameter}, {size}{fit}",
            pair.kind, pair.a, pair.b
        ))?;
    }
    for warning in report.warnings {
        lines::text(&format!("  warning: {warning}"))?;
    }
    Ok(())
}

//! Where a surface is felt: the textbook's pointshell shrunk by a share of a voxel, for several voxels, against the exact surface.
//!
//! A voxel's centre lies up to half a voxel inside the surface, so a shell of them touches a wall too early (phantom force); shrunk by more than half
//! a voxel it penetrates before it touches.

use mortise_bake::{Method, PointshellKind};
use mortise_haptics::{Settings, Vec3};
use serde::Serialize;

use super::bench::{Bench, HandCommand, Rig};
use super::slab::Slab;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::error::LabError;
use crate::variant::Variant;

/// Height of the part's start above the slab, mm, speed at which it is lowered, mm/s, and depth below first contact at the end, mm.
const GAP_MM: f64 = 3.0;
const LOWER_MM_PER_S: f64 = 10.0;
const BELOW_MM: f64 = 3.0;
/// Smallest force that counts as felt, N.
const FELT_N: f32 = 0.05;
/// Shrink distances, percent of a voxel, and voxels, mm.
const SHRINKS: [f64; 6] = [0.0, 25.0, 50.0, 75.0, 90.0, 100.0];
const CELLS_MM: [f64; 3] = [0.5, 1.0, 2.0];

/// One lowering.
#[derive(Clone, Debug, Serialize)]
pub struct Felt {
    /// Model of the scene.
    pub method: &'static str,
    /// Edge of a voxel or cell, mm.
    pub cell_mm: f64,
    /// Shrink distance, percent of a voxel; absent for Mortise's own shell.
    pub shrink_percent: f64,
    /// Gap at which the wall is first felt, mm: positive is phantom contact, negative penetration; absent when never felt.
    pub gap_mm: Option<f64>,
}

impl std::fmt::Display for Felt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}, {} mm, shrunk by {} %: ",
            self.method, self.cell_mm, self.shrink_percent
        )?;
        match self.gap_mm {
            Some(gap) => write!(f, "felt at a gap of {gap:.4} mm"),
            None => write!(f, "not felt"),
        }
    }
}

const TEXTBOOK: &str = "voxmap, classic shell";
const OURS: &str = "field (ours)";

fn lower(variant: &Variant, method: &'static str, shrink_percent: f64) -> Result<Felt, LabError> {
    let slab = Slab::bake(variant, 10.0, GAP_MM)?;
    let scene = slab.scene()?;
    let mut rig = Rig::held();
    // A stiff hand that contact cannot hold up, so that the path is known.
    rig.plant.stiffness = 20e3;
    rig.plant.damping = 100.0;
    rig.hand_damping = 99.0;
    let settings = Settings::default();
    let period = f64::from(settings.period_s);
    let mut bench = Bench::new(&scene, slab.part, settings, rig);
    let way = 1e-3 * (GAP_MM + BELOW_MM);
    let ticks = (way / (1e-3 * LOWER_MM_PER_S) / period) as u32;
    let mut start = None;
    let mut gap_mm = None;
    for i in 0..ticks {
        let out = bench.step(&HandCommand {
            position: -1e-3 * LOWER_MM_PER_S * period * f64::from(i),
            speed: -1e-3 * LOWER_MM_PER_S,
            push: 0.0,
        });
        let z = f64::from(out.object.position.z);
        let start = *start.get_or_insert(z);
        if out.contact.force.dot(Vec3::Z) > FELT_N {
            gap_mm = Some(GAP_MM - 1e3 * (start - z));
            break;
        }
    }
    Ok(Felt {
        method,
        cell_mm: variant.cell_mm,
        shrink_percent,
        gap_mm,
    })
}

/// Every textbook shell on every voxel, and Mortise's own.
///
/// # Errors
/// Anything that prevents a scene from being baked.
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Felt)) -> Result<Vec<Felt>, LabError> {
    let mut all = Vec::new();
    let cells = if quick { &CELLS_MM[1..2] } else { &CELLS_MM[..] };
    for &cell in cells {
        let ours = lower(&Variant::board(cell), OURS, 0.0)?;
        out(&ours);
        all.push(ours);
        for shrink_percent in SHRINKS {
            let variant = Variant {
                method: Method::Occupancy,
                shell: PointshellKind::Classic {
                    voxel_mm: None,
                    shrink_percent,
                },
                ..Variant::textbook(cell)
            };
            let felt = lower(&variant, TEXTBOOK, shrink_percent)?;
            out(&felt);
            all.push(felt);
        }
    }
    Ok(all)
}

/// Gap over shrink distance.
pub fn chart(all: &[Felt]) -> Chart {
    let mut series: Vec<Series> = (CELLS_MM.iter().enumerate())
        .map(|(index, &cell)| Series {
            name: format!("voxmap {cell} mm"),
            look: [Look::VermilionSquare, Look::OrangeCross, Look::PurpleDiamond][index],
            line: Line::Solid,
            points: (all.iter())
                .filter(|felt| felt.method == TEXTBOOK && felt.cell_mm == cell)
                .filter_map(|felt| {
                    Some(Point {
                        x: felt.shrink_percent,
                        y: felt.gap_mm?,
                        ..Point::default()
                    })
                })
                .collect(),
        })
        .collect();
    let worst = (all.iter().filter(|felt| felt.method == OURS))
        .filter_map(|felt| felt.gap_mm)
        .fold(
            0.0f64,
            |worst, gap| if gap.abs() > worst.abs() { gap } else { worst },
        );
    series.push(Series {
        name: "field, any of these cells (ours), at its worst".into(),
        look: Look::BlueDisc,
        line: Line::Solid,
        points: (SHRINKS.iter())
            .map(|&x| Point {
                x,
                y: worst,
                ..Point::default()
            })
            .collect(),
    });
    Chart {
        title: "Where a flat wall is felt: shrunk pointshells and voxels".into(),
        note: "Peg ø20 mm lowered onto a slab at 10 mm/s; felt from 0.05 N on. Above 0: phantom force. Below: the part is inside before anything is felt.".into(),
        x: Axis::new("shell shrunk by, % of a voxel").linear(),
        y: Axis::new("gap at which it is felt, mm").linear(),
        series: series.into_iter().filter(|series| !series.points.is_empty()).collect(),
    }
}

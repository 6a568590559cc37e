//! `mortise probe`: gap, depth and contact forces at given poses, or first touch along a motion from each.

use std::path::PathBuf;
use std::process::ExitCode;

use mortise_bake::{Method, PointshellKind};
use mortise_output::lines;
use mortise_scenario::probe::{self, Model, ProbeScene};
use mortise_scenario::sweep::Along;

use super::reading::Reading;
use super::units;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file or baked scene image
    scene: PathBuf,
    /// Moving part: its name, or its number in an image
    #[arg(long, value_name = "PART")]
    moving: String,
    /// Part that the moving part is placed against [default: the other one of two]
    #[arg(long, value_name = "PART")]
    against: Option<String>,
    /// CSV with the columns name,x,y,z,qw,qx,qy,qz: mm, moving part in the fixed part's frame
    #[arg(long, value_name = "CSV")]
    poses: PathBuf,
    /// Motion of the moving part from each pose, instead of measuring there: first touch along dx,dy,dz, mm, and rx,ry,rz, degrees about its origin
    #[arg(long, value_name = "DX,DY,DZ[,RX,RY,RZ]", allow_hyphen_values = true)]
    along: Option<Along>,
    /// Cell edge of a STEP file's scene, mm [default: chosen so that the image fits]
    #[arg(long, value_name = "MM", value_parser = units::real, allow_negative_numbers = true)]
    cell: Option<f64>,
    /// Contact method for a STEP file's scene: distance-field or occupancy [default: distance-field]
    #[arg(long, value_name = "METHOD")]
    method: Option<Method>,
    /// Pointshell of a STEP file's scene: error-bounded, or classic (the textbook's: one point per voxel)
    #[arg(long, value_name = "SHELL", default_value = "error-bounded", value_parser = ["error-bounded", "classic"])]
    shell: String,
    /// Inward shift of the classic shell's points, percent of a voxel
    #[arg(
        long,
        value_name = "PERCENT",
        default_value = "0",
        value_parser = units::real,
        allow_negative_numbers = true
    )]
    shrink: f64,
    #[command(flatten)]
    reading: Reading,
    /// One JSON object per pose
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    // The poses are read first: an error in them is reported without waiting for a bake.
    let poses = probe::read_poses(&args.poses)?;
    let model = Model {
        cell_mm: args.cell,
        method: args.method,
        shell: match args.shell.as_str() {
            "classic" => PointshellKind::Classic {
                voxel_mm: None,
                shrink_percent: args.shrink,
            },
            _ => PointshellKind::ErrorBounded,
        },
    };
    let scene = ProbeScene::load_by(&args.scene, &model)?;
    let pair = scene.pair(&args.moving, args.against.as_deref())?;
    for pose in &poses {
        if let Some(along) = &args.along {
            let row = scene.sweep(pair, pose, along)?;
            if args.json {
                lines::json(&row)?;
            } else {
                lines::text(&row.to_string())?;
            }
            continue;
        }
        let row = scene.probe(pair, pose)?;
        if args.json {
            lines::json(&row)?;
        } else {
            lines::text(&row.to_string())?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

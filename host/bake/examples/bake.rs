//! Bakes a STEP file and prints the result: `cargo run --release -p mortise-bake --example bake -- FILE [CELL_MM] [int8|int16] [classic] [all]`.

use std::ops::ControlFlow;
use std::time::Instant;

use mortise_bake::{BakeOptions, Grabbable, PointshellKind, SampleFormat, bake};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    mortise_brep::child::init();
    let mut arguments = std::env::args().skip(1);
    let file = arguments
        .next()
        .ok_or("give a STEP file, and optionally a cell edge in mm and int8 or int16")?;
    let mut options = BakeOptions::default();
    for argument in arguments {
        match argument.as_str() {
            "int8" => (options.format, options.band_cells) = (SampleFormat::Int8, 1.0),
            "int16" => options.format = SampleFormat::Int16,
            "classic" => {
                options.shell = PointshellKind::Classic {
                    voxel_mm: None,
                    shrink_percent: 0.0,
                };
            }
            "all" => options.grabbable = Grabbable::All,
            cell => {
                options.cell_mm = Some(cell.parse()?);
                options.image_limit_bytes = u64::from(u32::MAX);
            }
        }
    }
    let start = Instant::now();
    let model = mortise_brep::load_step(&file)?;
    let loaded = start.elapsed();
    let start = Instant::now();
    let baked = bake(&model, &options, &|_| ControlFlow::Continue(()))?;
    let took = start.elapsed();
    for shape in &baked.report.shapes {
        println!(
            "{:24} cell {:6.3} step {:8.5} bricks {:5} of {:6} in {:?} points {:?} bytes {} signs {}/{}{} error {:.5} splines {}",
            shape.name,
            shape.cell_mm,
            shape.scale_mm,
            shape.bricks,
            shape.stored_entries,
            shape.brick_dims,
            shape.points,
            shape.bytes.total(),
            shape.sign_disagreements,
            shape.sign_tests,
            if shape.sign_by_winding { " by winding" } else { "" },
            shape.surface_error_mm,
            shape.spline_faces,
        );
    }
    println!("{:?}", baked.report.bytes);
    for warning in &baked.report.warnings {
        println!("warning: {warning}");
    }
    println!(
        "{} parts, {} shapes, {} bytes; read in {loaded:.2?}, baked in {took:.2?}",
        baked.report.parts.len(),
        baked.report.shapes.len(),
        baked.image.len()
    );
    Ok(())
}

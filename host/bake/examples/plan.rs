//! Plans a STEP file and prints the plan: `cargo run --release -p mortise-bake --example plan -- FILE ACCURACY_UM [FLASH_KIB] [TICK]`.

use std::ops::ControlFlow;
use std::time::Instant;

use mortise_bake::{Grabbable, Request, plan};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    mortise_brep::child::init();
    let mut arguments = std::env::args().skip(1);
    let file = arguments
        .next()
        .ok_or("give a STEP file and an accuracy in micrometres")?;
    let accuracy: f64 = arguments
        .next()
        .ok_or("give an accuracy in micrometres")?
        .parse()?;
    let flash: u64 = arguments.next().map_or(Ok(1 << 22), |kib| kib.parse())?;
    let request = Request {
        accuracy_mm: accuracy / 1000.0,
        flash_bytes: flash * 1024,
        tick_instructions: arguments.next().map(|tick| tick.parse()).transpose()?,
        grabbable: Grabbable::AllButLargest,
    };
    let model = mortise_brep::load_step(&file)?;
    let start = Instant::now();
    let planned = plan(&model, &request, &|_| ControlFlow::Continue(()))?;
    let took = start.elapsed();
    for (shape, report) in planned.plan.shapes.iter().zip(&planned.plan.report.shapes) {
        println!(
            "{shape:?}\n    {} bricks, {:?} points, {} bytes",
            report.bricks,
            report.points,
            report.bytes.total()
        );
    }
    for tick in planned.plan.ticks.iter().take(3) {
        println!("{tick:?}");
    }
    println!(
        "met {} fits {} at {:.2} µm: {} bytes in {took:.2?}; {:?}",
        planned.met,
        planned.fits,
        1e3 * planned.plan.accuracy_mm,
        planned.image.len(),
        planned.plan.report.bytes
    );
    Ok(())
}

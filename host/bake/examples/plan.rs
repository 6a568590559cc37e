//! Plans a STEP file and prints what was reached in how much time: `cargo run --release -p mortise-bake --example plan -- FILE [ACCURACY_UM [KIB]]`.

use std::ops::ControlFlow;
use std::time::Instant;

use mortise_bake::{Request, plan};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    mortise_brep::child::init();
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("give a STEP file")?;
    let mut request = Request::default();
    if let Some(um) = arguments.next() {
        request.accuracy_mm = um.parse::<f64>()? / 1000.0;
    }
    if let Some(kib) = arguments.next() {
        request.flash_bytes = kib.parse::<u64>()? << 10;
    }
    let start = Instant::now();
    let model = mortise_brep::load_step(&file)?;
    let loaded = start.elapsed();
    let start = Instant::now();
    let planned = plan(&model, &request, &|_| ControlFlow::Continue(()))?;
    let took = start.elapsed();
    println!("{}", planned.reached(&request));
    for shape in &planned.plan.shapes {
        println!(
            "  {}: cells of {:.3} mm, limited by {}; {:.2} µm in fits, {:.1} µm elsewhere, {:.1} µm at edges",
            shape.name,
            shape.cell_mm,
            shape.why,
            1000.0 * (shape.field_error_in_fits_mm + shape.shell_error_in_fits_mm),
            1000.0 * shape.error_elsewhere_mm,
            1000.0 * shape.error_at_edges_mm,
        );
    }
    println!(
        "met {}, fits {}, {:?}; read in {loaded:.2?}, planned in {took:.2?}",
        planned.met, planned.fits, planned.limit
    );
    Ok(())
}

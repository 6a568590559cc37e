//! Fits of two parts of a STEP file: `cargo run --release -p mortise-fit --example fit -- FILE MOVING AGAINST`.

use mortise_fit::{FitOptions, find};

fn main() {
    mortise_brep::child::init();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, moving, against] = arguments.as_slice() else {
        eprintln!("usage: fit FILE MOVING AGAINST");
        std::process::exit(2);
    };
    let n = |name: &str, or: f64| std::env::var(name).ok().and_then(|t| t.parse().ok()).unwrap_or(or);
    let options = mortise_brep::LoadOptions { relative_deflection: n("REL", 5e-4), angular_deflection_rad: n("ANG", 0.2), ..Default::default() };
    let started = std::time::Instant::now();
    let loaded = mortise_brep::load_step_with(file, &options);
    println!("read {:.2} s", started.elapsed().as_secs_f64());
    let model = match loaded {
        Ok(model) => model,
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(2);
        }
    };
    for shape in &model.shapes { println!("{} triangles, deflection {:.4}", shape.mesh.triangles.len(), shape.deflection_mm); }
    let index = |name: &str| model.parts.iter().position(|part| part.name == name).unwrap_or(usize::MAX);
    let started = std::time::Instant::now();
    match find(&model, index(moving), index(against), &FitOptions::default()) {
        Ok(found) => {
            println!("{} rated, {} refined, {:.2} s", found.rated, found.refined, started.elapsed().as_secs_f64());
            for fit in &found.fits {
                println!(
                    "score {:.4} area {:.1} gap {:.2}/{:.2}/{:.2} µm residual {:.3} µm free {} at {:.3} q {:.4} path {:?}",
                    fit.score, fit.area_mm2, fit.clearance.min_mm * 1e3, fit.clearance.median_mm * 1e3, fit.clearance.max_mm * 1e3,
                    fit.residual_mm * 1e3, fit.freedom, fit.placement.translation, glam::DQuat::from_mat3(&fit.placement.matrix3), fit.path
                );
            }
        }
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(2);
        }
    }
}

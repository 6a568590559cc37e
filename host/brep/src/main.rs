//! `mortise-brep FILE…`: reads STEP files and prints their content, one line per part.

use mortise_brep::{CadModel, load_step};
use std::process::ExitCode;

fn main() -> ExitCode {
    mortise_brep::child::init();
    let paths: Vec<_> = std::env::args_os().skip(1).collect();
    if paths.is_empty() {
        eprintln!("usage: mortise-brep FILE.step ...");
        return ExitCode::from(2);
    }
    let mut code = ExitCode::SUCCESS;
    for path in paths {
        match load_step(&path) {
            Ok(model) => print(&path.to_string_lossy(), &model),
            Err(error) => {
                eprintln!("{error}");
                code = ExitCode::from(2);
            }
        }
    }
    code
}

fn print(path: &str, model: &CadModel) {
    println!(
        "{path}: {} parts, {} shapes, in {}",
        model.parts.len(),
        model.shapes.len(),
        model.unit
    );
    for part in &model.parts {
        let shape = &model.shapes[part.shape];
        let closed = if shape.closed { "closed" } else { "open" };
        println!(
            "  {}: {} faces, {} edges, {} triangles, {:.2} mm³, {closed}",
            part.path
                .iter()
                .chain([&part.name])
                .map(String::as_str)
                .collect::<Vec<_>>()
                .join("/"),
            shape.faces.len(),
            shape.edges.len(),
            shape.mesh.triangles.len(),
            shape.volume_mm3,
        );
    }
    for warning in &model.warnings {
        println!("  warning: {warning}");
    }
}

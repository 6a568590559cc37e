//! Inside and outside of every closed part there is, against the CAD kernel's own classifier.
//!
//! Files are looked for in `MORTISE_SHARED`, else in `shared` beside the workspace; where they are absent the tests say so and pass.
//! `MORTISE_SIGN_POINTS=100000` asks for as many points as the stated result; without it a hundredth, so that the tests stay quick.
//! `MORTISE_SIGN_FILE=name` looks at files whose path holds `name` only.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use libtest_mimic::{Arguments, Failed, Trial};
use mortise_bake::{SignOptions, check_signs};
use mortise_brep::{LoadOptions, child, load_step_with};

fn main() -> ExitCode {
    child::init();
    let arguments = Arguments::from_args();
    let root = std::env::var_os("MORTISE_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    let cad = root.join("cad");
    let mut files = Vec::new();
    find(&cad, &mut files);
    files.sort();
    if files.is_empty() {
        println!("skipped: no STEP files in {}", cad.display());
    }
    let trials = files.into_iter().map(|file| {
        let name = file.strip_prefix(&cad).unwrap_or(&file).display().to_string();
        Trial::test(name, move || signs_of(&file))
    });
    libtest_mimic::run(&arguments, trials.collect()).exit_code()
}

fn find(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            find(&path, files);
        } else if path
            .extension()
            .is_some_and(|e| ["step", "stp"].iter().any(|known| e.eq_ignore_ascii_case(known)))
        {
            files.push(path);
        }
    }
}

fn signs_of(file: &Path) -> Result<(), Failed> {
    let load = LoadOptions::default();
    let model = match load_step_with(file, &load) {
        Ok(model) => model,
        Err(error) => {
            // Refusing a file is another test's concern; here it has no sign to be wrong.
            println!("not read: {error}");
            return Ok(());
        }
    };
    let options = SignOptions {
        points: std::env::var("MORTISE_SIGN_POINTS").map_or(Ok(1000), |n| n.parse())?,
        cells: 48.0,
        time_limit_s: 1800,
    };
    let mut wrong = Vec::new();
    for (index, shape) in model.shapes.iter().enumerate() {
        let name = model
            .parts
            .iter()
            .find(|p| p.shape == index)
            .map_or("?", |p| &p.name);
        let check = check_signs(file, &load, index, shape, &options)?;
        println!(
            "{}: {name}: {} points, {} undecided; surface: {} wrong, {} within {:.1e} mm; field of {:.2} mm cells: {} wrong, {} within {:.2} mm \
             ({} there with the other sign){}{}",
            file.display(),
            check.points,
            check.undecided,
            check.wrong,
            check.near,
            check.tolerance_mm,
            check.cell_mm,
            check.field_wrong,
            check.field_near,
            check.field_tolerance_mm,
            check.field_near_wrong,
            if check.closed { "" } else { "; not closed" },
            if check.by_winding {
                "; by winding number"
            } else {
                ""
            },
        );
        for example in &check.examples {
            println!("  {example:?}");
        }
        if check.closed && check.wrong + check.field_wrong > 0 {
            wrong.push(format!("{name}: {} and {}", check.wrong, check.field_wrong));
        }
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(format!("wrong signs: {}", wrong.join("; ")).into())
    }
}

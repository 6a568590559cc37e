//! Inside and outside of all closed parts, against the CAD kernel's own classifier.
//!
//! Files are looked for in `MORTISE_SHARED`, else in `shared` beside the workspace; if they are absent the tests report it and pass.
//! `MORTISE_SIGN_POINTS=100000 cargo test --release -p mortise-bake --test signs -- real/` compares as many points as the stated result; without it a
//! few hundred per shape keep the tests quick.

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use libtest_mimic::{Arguments, Failed, Trial};
use mortise_bake::{SignCheck, SignOptions, check_signs};
use mortise_brep::{LoadOptions, Shape, child, load_step_with};

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

/// Shapes compared so far, by their tessellation to a millionth of a millimetre: many files write the same parts differently.
static SEEN: Mutex<BTreeSet<u64>> = Mutex::new(BTreeSet::new());

fn is_new(shape: &Shape) -> bool {
    let mut hash = DefaultHasher::new();
    shape.mesh.triangles.hash(&mut hash);
    shape.faces.len().hash(&mut hash);
    for v in &shape.mesh.vertices {
        v.to_array().map(|c| (c * 1e6).round() as i64).hash(&mut hash);
    }
    SEEN.lock()
        .unwrap_or_else(PoisonError::into_inner)
        .insert(hash.finish())
}

fn signs_of(file: &Path) -> Result<(), Failed> {
    let load = LoadOptions::default();
    let model = match load_step_with(file, &load) {
        Ok(model) => model,
        Err(error) => {
            // Rejected files are covered by another test; they have no sign to compare.
            println!("not read: {error}");
            return Ok(());
        }
    };
    let full = std::env::var("MORTISE_SIGN_POINTS").ok();
    let options = SignOptions {
        points: full.as_ref().map_or(Ok(400), |n| n.parse())?,
        cells: if full.is_some() { 64.0 } else { 24.0 },
        time_limit_s: 1800,
    };
    let mut wrong = Vec::new();
    let mut again = 0;
    for (index, shape) in model.shapes.iter().enumerate() {
        if !is_new(shape) {
            again += 1;
            continue;
        }
        let name = model
            .parts
            .iter()
            .find(|p| p.shape == index)
            .map_or("?", |p| &p.name);
        let start = Instant::now();
        let check = check_signs(file, &load, index, shape, &options)?;
        let failed = check.closed && check.wrong + check.field_wrong > 0;
        // Every point needs an answer here; only the full run for the stated result may be split up.
        if full.is_none() && check.points + check.undecided < check.asked {
            return Err(format!(
                "{name}: the kernel answered at {} of {} points",
                check.points, check.asked
            )
            .into());
        }
        if full.is_some() || failed || !check.closed {
            println!("{}: {name}: {}", file.display(), line(&check, start));
        }
        for example in &check.examples {
            println!("  {example:?}");
        }
        if failed {
            wrong.push(format!("{name}: {} and {}", check.wrong, check.field_wrong));
        }
    }
    if again > 0 {
        println!("{}: {again} shapes are those of another file", file.display());
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(format!("wrong signs: {}", wrong.join("; ")).into())
    }
}

fn line(check: &SignCheck, start: Instant) -> String {
    format!(
        "{} of {} points, {} undecided, the kernel contradicts itself at {}; surface: {} wrong, {} within {:.1} um; field of {:.2} mm cells: {} wrong, {} within {:.2} mm ({} there with \
         the other sign); {:.1} s{}{}",
        check.points,
        check.asked,
        check.undecided,
        check.contradictions,
        check.wrong,
        check.near,
        check.tolerance_mm * 1e3,
        check.cell_mm,
        check.field_wrong,
        check.field_near,
        check.field_tolerance_mm,
        check.field_near_wrong,
        start.elapsed().as_secs_f64(),
        if check.closed { "" } else { "; not closed" },
        if check.by_winding {
            "; by winding number"
        } else {
            ""
        },
    )
}

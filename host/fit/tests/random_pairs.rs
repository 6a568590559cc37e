//! Random pairs, each part's geometry moved at random: the finder reports the designed pose first, and every alternative.
//!
//! `MORTISE_FIT_PAIRS` sets how many pairs are tried.

use std::io::Write as _;
use std::time::Instant;

use mortise_fit::{Fit, FitOptions, PathKind, find};
use mortise_shapes::{Designed, Free, KINDS};

#[test]
fn designed_poses_are_found() {
    let count = std::env::var("MORTISE_FIT_PAIRS")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(KINDS as u64);
    let mut wrong = Vec::new();
    for seed in 0..count {
        let designed = Designed::random(seed);
        let line = tried(seed, &designed);
        println!("{}", line.0);
        if !line.1 {
            wrong.push(line.0);
        }
    }
    println!("{} of {count} right", count as usize - wrong.len());
    assert!(
        100 * wrong.len() as u64 <= count,
        "{} of {count} wrong:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}

/// What was found, in a line, and whether it is right.
fn tried(seed: u64, designed: &Designed) -> (String, bool) {
    let mut file = tempfile::Builder::new()
        .suffix(".step")
        .tempfile()
        .expect("a temporary file");
    file.write_all(designed.text().as_bytes()).expect("written");
    let model = mortise_brep::load_step(file.path()).expect("the kernel reads it");
    let named = |name: &str| {
        model
            .parts
            .iter()
            .position(|part| part.name == name)
            .expect("the part")
    };
    let (moving, fixed) = (named("moving"), named("fixed"));
    let started = Instant::now();
    let found = find(&model, moving, fixed, &FitOptions::default()).expect("closed parts");
    let spent = started.elapsed().as_secs_f64();
    let back = model.parts[fixed].placement.inverse();
    // Of each alternative the nearest fit's error.
    let off = |fit: &Fit, index: usize| designed.error(&(back * fit.placement), index);
    let places: Vec<f64> = (0..designed.alternatives.len())
        .map(|index| {
            (found.fits.iter())
                .map(|fit| off(fit, index))
                .fold(f64::INFINITY, f64::min)
        })
        .collect();
    let worst = places.iter().copied().fold(0.0, f64::max);
    let first = (found.fits.first())
        .is_some_and(|fit| (0..places.len()).any(|index| off(fit, index) <= designed.within));
    let path = found.fits.first().and_then(|fit| fit.path.as_ref());
    // What the designed pose leaves free along a straight way and about it.
    let learnt = path.is_none_or(|path| {
        path.kind != PathKind::Line
            || path.spin.is_some() == (designed.free == Free::Spin)
                && path.ends == (designed.free != Free::SlideZ)
    });
    let right = first && worst <= designed.within && learnt;
    let line = format!(
        "{seed} {}: {} c {:.3} mm, {} of {} places, off {:.3} µm, {} fits, {:.2} s, gap {:?} µm, path {:?}, {}",
        designed.kind,
        if right { "right" } else { "WRONG" },
        designed.clearance,
        places.iter().filter(|error| **error <= designed.within).count(),
        places.len(),
        1e3 * worst,
        found.fits.len(),
        spent,
        found
            .fits
            .first()
            .map(|fit| (1e5 * fit.clearance.min_mm).round() / 100.0),
        path.map(|path| (path.kind, (1e5 * path.smallest_clearance_mm).round() / 100.0)),
        path.map_or_else(String::new, |path| {
            let about = path.spin.map_or("", |_| ", free to turn");
            format!("ends {}{about}", path.ends)
        }),
    );
    (line, right)
}

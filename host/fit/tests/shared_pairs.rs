//! The shared free-form pairs, the moving part scattered: the seated pose is found, in the place that the fit determines.
//!
//! They are looked for in `MORTISE_SHARED`, else in `shared` beside the workspace; if they are absent the test reports it and passes.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::ExactSurface;
use mortise_brep::{CadModel, LoadOptions};
use mortise_fit::{FitOptions, PathKind, find, part_named};

/// Name, gap of the seated pose, mm (the folder's table), and how far the first fit's may be from it, mm.
///
/// The ellipsoid's gap is not the same everywhere: its evenest pose is a little beside the seated one.
const PAIRS: [(&str, f64, f64); 6] = [
    ("dovetail", 0.05, 1e-3),
    ("tslot_nut", 0.10, 1e-3),
    ("keyed_shaft", 0.04, 1e-3),
    ("square_taper", 0.03, 1e-3),
    ("torus_ring", 0.15, 1e-3),
    ("ellipsoid_socket", 0.077_334_665, 3e-3),
];

/// Two prisms whose inclines face each other do not hold each other, nor do crossed bars.
const NOT_FITTING: [&str; 2] = ["wedges", "bars_s05"];

/// Pegs of three sections, each 0.25 mm clear of its hole all round, and in how many ways each goes in but for slides and turns that stay free: by either
/// end, the square one turned by quarters, the combined one as it is or turned over.
const SECTIONS: [(&str, usize); 3] = [("circular", 1), ("square", 4), ("combined", 1)];
const SECTION_GAP_MM: f64 = 0.25;

fn folder() -> Option<PathBuf> {
    in_shared("09_free_form")
}

fn in_shared(folder: &str) -> Option<PathBuf> {
    let shared = std::env::var_os("MORTISE_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    let folder = shared.join("cad").join(folder);
    folder.is_dir().then_some(folder)
}

fn reading() -> LoadOptions {
    LoadOptions {
        relative_deflection: 1e-3,
        angular_deflection_rad: 0.3,
        ..LoadOptions::default()
    }
}

/// A pair's model with its first part moved away, and both parts' indices.
fn scattered(folder: &Path, name: &str, parts: [&str; 2]) -> (CadModel, usize, usize) {
    let mut model =
        mortise_brep::load_step_with(folder.join(format!("{name}.step")), &reading()).expect("it is read");
    let [moving, fixed] = parts.map(|name| part_named(&model, name).expect("the part"));
    let turn = DQuat::from_scaled_axis(DVec3::new(0.7, -1.9, 1.1));
    model.parts[moving].placement =
        DAffine3::from_rotation_translation(turn, DVec3::new(120.0, -75.0, 210.0))
            * model.parts[moving].placement;
    (model, moving, fixed)
}

#[test]
fn loose_pegs_of_any_section_are_put_in_the_middle_of_their_holes() {
    let Some(folder) = in_shared("04_sections") else {
        println!("skipped: {} pairs of ../shared/cad are not here", SECTIONS.len());
        return;
    };
    for (name, ways) in SECTIONS {
        let (model, moving, fixed) = scattered(&folder, name, ["peg", "block"]);
        let found = find(&model, moving, fixed, &FitOptions::default()).expect("closed parts");
        println!("{name}: {:?}", found.fits);
        assert!(found.fits.len() >= ways, "{name}: {} fits", found.fits.len());
        for fit in &found.fits[..ways] {
            let gap = fit.clearance.min_mm;
            assert!((gap - SECTION_GAP_MM).abs() < 1e-3, "{name}: {:?}", fit.clearance);
            let path = fit.path.as_ref().unwrap_or_else(|| panic!("{name}: no way in"));
            assert_eq!(path.kind, PathKind::Line, "{name}: {path:?}");
            assert!(
                (path.smallest_clearance_mm - SECTION_GAP_MM).abs() < 1e-3,
                "{name}: {path:?}"
            );
        }
    }
}

#[test]
fn scattered_parts_are_put_back() {
    let Some(folder) = folder() else {
        println!(
            "skipped: {} pairs of ../shared/cad are not here",
            PAIRS.len() + NOT_FITTING.len()
        );
        return;
    };
    let scattered = |name: &str| scattered(&folder, name, ["moving", "fixed"]);
    for (name, gap, within) in PAIRS {
        let (model, moving, fixed) = scattered(name);
        let found = find(&model, moving, fixed, &FitOptions::default()).expect("closed parts");
        let fit = found
            .fits
            .first()
            .unwrap_or_else(|| panic!("{name}: nothing fits"));
        println!(
            "{name}: {} fits, gap {:?}, path {:?}",
            found.fits.len(),
            fit.clearance,
            fit.path
        );
        assert!(
            (fit.clearance.min_mm - gap).abs() < within,
            "{name}: {:?}",
            fit.clearance
        );
        let path = fit.path.as_ref().unwrap_or_else(|| panic!("{name}: no way in"));
        assert_eq!(path.kind, PathKind::Line, "{name}: {path:?}");
        assert!(path.smallest_clearance_mm > 0.0, "{name}: {path:?}");
        // By another way: the fixed part's exact distance at corners of the moving part.
        let surface = ExactSurface::new(&model.shapes[model.parts[fixed].shape]);
        let to_fixed = model.parts[fixed].placement.inverse() * fit.placement;
        for &vertex in &model.shapes[model.parts[moving].shape].mesh.vertices {
            let near = surface
                .nearest(to_fixed.transform_point3(vertex))
                .expect("a surface");
            assert!(near.distance > gap - within - 1e-6, "{name}: {}", near.distance);
        }
    }
    for name in NOT_FITTING {
        let (model, moving, fixed) = scattered(name);
        let found = find(&model, moving, fixed, &FitOptions::default()).expect("closed parts");
        assert!(found.fits.is_empty(), "{name}: {:?}", found.fits);
    }
}

/// Twisted and tapered sides: no straight line leads out. The placement in the file is a candidate, and its evenest pose is within a micrometre of it.
#[test]
fn a_twisted_peg_goes_in_by_a_screw() {
    let Some(folder) = folder() else {
        println!("skipped: 1 pair of ../shared/cad is not here");
        return;
    };
    let model =
        mortise_brep::load_step_with(folder.join("loft_peg_c0.02.step"), &reading()).expect("it is read");
    let [moving, fixed] = ["moving", "fixed"].map(|name| part_named(&model, name).expect("the part"));
    let found = find(&model, moving, fixed, &FitOptions::default()).expect("closed parts");
    let fit = found.fits.first().expect("it fits as placed");
    assert!(
        (fit.clearance.min_mm - 0.019_751_888).abs() < 1e-3,
        "{:?}",
        fit.clearance
    );
    let path = fit.path.as_ref().expect("a way in");
    assert_eq!(path.kind, PathKind::Screw, "{path:?}");
    // 1.8 degrees a millimetre is a turn in 200 mm.
    let (_, pitch) = path.screw.expect("a screw");
    assert!((pitch.abs() - 200.0).abs() < 20.0, "{path:?}");
    assert!(path.smallest_clearance_mm > 0.0, "{path:?}");
}

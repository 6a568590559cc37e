//! The shared free-form pairs, the moving part scattered: the seated pose is found, in the place that the fit determines.
//!
//! They are looked for in `MORTISE_SHARED`, else in `shared` beside the workspace; if they are absent the test reports it and passes.

use std::path::PathBuf;

use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::ExactSurface;
use mortise_brep::LoadOptions;
use mortise_fit::{FitOptions, PathKind, find, part_named};

/// Name, gap of the seated pose, mm (the folder's table), how far the first fit's gaps may be from it, mm, and the kind of way in.
///
/// Semi-axes and sections give the ellipsoid and the loft a gap that is not the same everywhere: the evenest pose is a little beside the seated one.
const PAIRS: [(&str, f64, f64, PathKind); 7] = [
    ("dovetail", 0.05, 1e-3, PathKind::Line),
    ("tslot_nut", 0.10, 1e-3, PathKind::Line),
    ("keyed_shaft", 0.04, 1e-3, PathKind::Line),
    ("square_taper", 0.03, 1e-3, PathKind::Line),
    ("torus_ring", 0.15, 1e-3, PathKind::Line),
    ("ellipsoid_socket", 0.077_334_665, 3e-3, PathKind::Line),
    ("loft_peg_c0.02", 0.019_751_888, 1e-3, PathKind::Screw),
];

/// Two prisms whose inclines face each other do not hold each other, nor do crossed bars.
const NOT_FITTING: [&str; 2] = ["wedges", "bars_s05"];

fn folder() -> Option<PathBuf> {
    let shared = std::env::var_os("MORTISE_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    let folder = shared.join("cad/09_free_form");
    folder.is_dir().then_some(folder)
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
    let reading = LoadOptions {
        relative_deflection: 1e-3,
        angular_deflection_rad: 0.3,
        ..LoadOptions::default()
    };
    let scattered = |name: &str| {
        let mut model =
            mortise_brep::load_step_with(folder.join(format!("{name}.step")), &reading).expect("it is read");
        let [moving, fixed] = ["moving", "fixed"].map(|name| part_named(&model, name).expect("the part"));
        let turn = DQuat::from_scaled_axis(DVec3::new(0.7, -1.9, 1.1));
        model.parts[moving].placement =
            DAffine3::from_rotation_translation(turn, DVec3::new(120.0, -75.0, 210.0))
                * model.parts[moving].placement;
        (model, moving, fixed)
    };
    for (name, gap, within, kind) in PAIRS {
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
        assert_eq!(path.kind, kind, "{name}: {path:?}");
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

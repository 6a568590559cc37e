//! Distance to free-form faces against the CAD kernel's own search.
//!
//! Files are looked for in `MORTISE_SHARED`, else in `shared` beside the workspace; where they are absent the test says so and passes.

use std::path::PathBuf;

use glam::DVec3;
use mortise_bake::ExactSurface;
use mortise_brep::{LoadOptions, Shape, Surface, load_step_with, oracle};

/// One micrometre over what the model itself states, mm.
const TOLERANCE_MM: f64 = 1e-3;

/// Up to `count` points 0 to 2 mm off the tessellation of the free-form faces, spread over them.
fn points_near_free_forms(shape: &Shape, count: usize) -> Vec<DVec3> {
    let mesh = &shape.mesh;
    let own: Vec<usize> = (0..mesh.triangles.len())
        .filter(|&t| shape.faces[mesh.triangle_face[t] as usize].surface == Surface::Spline)
        .collect();
    let count = count.min(4 * own.len());
    (0..count)
        .map(|i| {
            let t = own[i * own.len() / count];
            let [a, b, c] = mesh.triangles[t].map(|v| mesh.vertices[v as usize]);
            let r = |base: f64| (i as f64 * base).fract();
            let (x, y) = (r(0.754_877_666), 0.5 * r(0.569_840_29));
            let normal = (b - a).cross(c - a).normalize_or_zero();
            a * (1.0 - x) + (b * (1.0 - y) + c * y) * x + normal * (4.0 * r(0.381_966) - 2.0)
        })
        .collect()
}

/// No point the kernel finds is nearer than ours, and ours is on the kernel's surface.
#[test]
fn free_forms_agree_with_the_kernel() {
    let root = std::env::var_os("MORTISE_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    let files = [
        "ahand_L-Palm_Shell.step",
        "dn_flex_assembly.step",
        "soarm_STS3215_03a.step",
        "wrs_02-PANEL.step",
        "NIST_MBE_PMI_5.stp",
    ];
    let mut skipped = 0;
    for name in files {
        let file = root.join("cad/real").join(name);
        if !file.exists() {
            skipped += 1;
            continue;
        }
        let load = LoadOptions::default();
        let model = load_step_with(&file, &load).unwrap();
        for (index, shape) in model.shapes.iter().enumerate() {
            if !shape.faces.iter().any(|f| f.surface == Surface::Spline) {
                continue;
            }
            let surface = ExactSurface::new(shape);
            let points = points_near_free_forms(shape, 200);
            let ours: Vec<_> = points.iter().map(|&p| surface.nearest(p).unwrap()).collect();
            let feet: Vec<DVec3> = ours.iter().map(|n| n.point).collect();
            let theirs = oracle::nearest(&file, &load, index, &points).unwrap();
            let beside = oracle::nearest(&file, &load, index, &feet).unwrap();
            let tolerance = TOLERANCE_MM + surface.surface_error_mm();
            let (mut farther, mut off, mut missed) = (0.0f64, 0.0f64, 0);
            for (i, ours) in ours.iter().enumerate() {
                let d = ours.distance.abs();
                assert!((d - points[i].distance(ours.point)).abs() < 1e-9);
                if let Some(theirs) = theirs[i] {
                    farther = farther.max(d - theirs.distance);
                    missed += usize::from(theirs.distance > d + tolerance);
                }
                if let Some(beside) = beside[i] {
                    off = off.max(beside.distance);
                }
            }
            println!(
                "{name}, shape {index}: {} splines; of {} points at most {:.2} um farther than the kernel's and {:.2} um off its surface, stated {:.2} um; \
                 the kernel missed {missed}",
                shape.splines.len(),
                points.len(),
                farther * 1e3,
                off * 1e3,
                surface.surface_error_mm() * 1e3
            );
            assert!(farther < tolerance && off < tolerance, "{name}");
        }
    }
    println!("skipped: {skipped} of {} files are not there", files.len());
}

//! Distance to free-form faces, and to those recognised as a simpler surface, against the CAD kernel's own search.
//!
//! Files are looked for in `MORTISE_SHARED`, else in `shared` beside the workspace; if they are absent the test reports it and passes.

use std::path::{Path, PathBuf};

use glam::DVec3;
use mortise_bake::{ExactSurface, PointshellOptions, sample_pointshell};
use mortise_brep::oracle::{self, Side};
use mortise_brep::{Face, LoadOptions, Shape, Surface, load_step_with};
use mortise_protocol::image::NO_FACE;

/// One micrometre above the model's own stated error, mm.
const TOLERANCE_MM: f64 = 1e-3;

fn is_written_as_spline(face: &Face) -> bool {
    face.surface == Surface::Spline || face.fit_mm.is_some()
}

/// Up to `count` points 0 to 2 mm off the tessellation of the free-form faces, spread over them.
fn points_near_free_forms(shape: &Shape, count: usize) -> Vec<DVec3> {
    let mesh = &shape.mesh;
    let own: Vec<usize> = (0..mesh.triangles.len())
        .filter(|&t| is_written_as_spline(&shape.faces[mesh.triangle_face[t] as usize]))
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

/// Normals of samples of free-form faces point out of the solid; returns the samples.
fn shell_points_out(file: &Path, load: &LoadOptions, index: usize, surface: &ExactSurface) -> Vec<DVec3> {
    /// Larger than the tolerance, smaller than any wall.
    const STEP_MM: f64 = 0.01;
    let shell = sample_pointshell(surface, &PointshellOptions::everywhere(0.01, 5.0));
    let own: Vec<_> = shell
        .points
        .iter()
        // At an edge the normal is a mean, and a fillet that runs out into a wall has no well-defined side there.
        .filter(|p| p.edge_face == NO_FACE)
        .filter(|p| is_written_as_spline(&surface.shape().faces[usize::from(p.face)]))
        .collect();
    let step = own.len().div_ceil(60).max(1);
    let own: Vec<_> = own.into_iter().step_by(step).collect();
    let at = |by: f64| own.iter().map(move |p| p.position + p.normal * by);
    let beside: Vec<DVec3> = at(STEP_MM).chain(at(-STEP_MM)).collect();
    // Each question reads the file again.
    let sides = oracle::classify(file, load, index, &beside, 1e-7).unwrap();
    for (i, (p, found)) in own.iter().cycle().zip(sides).enumerate() {
        let side = if i < own.len() { Side::Out } else { Side::In };
        assert_eq!(found, side, "{p:?}");
    }
    own.iter().map(|p| p.position).collect()
}

/// No nearest point found by the kernel is nearer than ours, and ours is on the kernel's surface.
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
        // All its splines are cylinders.
        "as1-oc-214.stp",
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
            if !shape.faces.iter().any(is_written_as_spline) {
                continue;
            }
            let surface = ExactSurface::new(shape);
            let points = points_near_free_forms(shape, 100);
            let ours: Vec<_> = points.iter().map(|&p| surface.nearest(p).unwrap()).collect();
            let feet: Vec<DVec3> = ours.iter().map(|n| n.point).collect();
            let shell = shell_points_out(&file, &load, index, &surface);
            let asked: Vec<DVec3> = points.iter().chain(&feet).chain(&shell).copied().collect();
            let found = oracle::nearest(&file, &load, index, &asked).unwrap();
            let (theirs, beside) = found.split_at(points.len());
            let (beside, samples) = beside.split_at(feet.len());
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
            for sample in samples.iter().flatten() {
                assert!(sample.distance < tolerance, "{name}: {sample:?}");
            }
        }
    }
    println!("skipped: {skipped} of {} files are not there", files.len());
}

//! Sections of every shared part that reads, against the CAD kernel's volume and the mesh's. Skipped with a note when they are absent.

use crate::support::{self, volume_below};
use glam::{DAffine3, DVec3};
use mortise_inspect::{CutPlane, Fineness, Solid, section};

/// Planes across each part of more than 5,000 triangles, and of fewer.
const PLANES: [usize; 2] = [48, 160];

/// Areas in an oblique direction, in which no face lies level, add up to the kernel's volume within 0.1 %: the rest of the sum by middle heights is below that
/// for a part with an area that bends at a few heights. And each equals the growth of the mesh's volume at its height.
#[test]
fn areas_add_up_to_the_kernels_volume() {
    let Some(folder) = support::shared("areas") else {
        return;
    };
    let normal = DVec3::new(0.39, 0.57, 0.723).normalize();
    let (mut parts, mut unread, mut open, mut worst) = (0, 0, 0, 0f64);
    // Several files hold the same parts in other spellings.
    let mut seen = std::collections::HashSet::new();
    for file in support::step_files(&folder) {
        let Ok(model) = mortise_brep::load_step(&file) else {
            unread += 1;
            continue;
        };
        for shape in &model.shapes {
            if !seen.insert((
                (shape.volume_mm3 * 1e3).round() as i64,
                shape.mesh.triangles.len(),
            )) {
                continue;
            }
            let solid = Solid::new(shape);
            let zero = CutPlane::new(DVec3::ZERO, normal).unwrap();
            let heights = shape.mesh.vertices.iter().map(|&v| zero.height(v));
            let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                (l.min(x), h.max(x))
            });
            if !shape.closed || low >= high {
                open += 1;
                continue;
            }
            let planes = PLANES[usize::from(shape.mesh.triangles.len() < 5_000)];
            let step = (high - low) / planes as f64;
            let mut volume = 0.0;
            for i in 0..planes {
                let h = low + (i as f64 + 0.5) * step;
                let at = |h: f64| CutPlane::new(normal * h, normal).unwrap();
                let exact = section(&solid, &DAffine3::IDENTITY, &at(h), Fineness::Exact(1e-2));
                assert!(exact.open.is_empty(), "{}", file.display());
                // What crosses itself within the deflection is no more than that wide.
                let (area, by_loops) = (exact.area_mm2(), exact.loop_area_mm2(&at(h)));
                let length: f64 = (exact.loops.iter().flat_map(|l| l.points.windows(2)))
                    .map(|w| w[0].distance(w[1]))
                    .sum();
                let wide = 2.0 * length * shape.deflection_mm;
                assert!(
                    (area - by_loops).abs() <= wide + 1e-9 * area,
                    "{}: {area} {by_loops}",
                    file.display()
                );
                volume += exact.area_mm2() * step;
                if i % 16 == 0 {
                    let facets = section(&solid, &DAffine3::IDENTITY, &at(h), Fineness::Facets);
                    let (area, by_loops) = (facets.area_mm2(), facets.loop_area_mm2(&at(h)));
                    let d = 1e-5 * (high - low);
                    let mesh = &solid.shape().mesh;
                    let growth =
                        (volume_below(mesh, &at(h + d)) - volume_below(mesh, &at(h - d))) / (2.0 * d);
                    let unit = 1e-3 * (shape.volume_mm3 / (high - low));
                    assert!(
                        (by_loops - growth).abs() < unit,
                        "{}: {by_loops} {growth}",
                        file.display()
                    );
                    assert!(
                        (area - by_loops).abs() < unit,
                        "{}: {area} {by_loops}",
                        file.display()
                    );
                }
            }
            let error = (volume - shape.volume_mm3).abs() / shape.volume_mm3;
            println!(
                "{:.1e} {} {volume:.3} {:.3}",
                error,
                file.display(),
                shape.volume_mm3
            );
            worst = worst.max(error);
            parts += 1;
        }
    }
    println!("{parts} shapes, worst {worst:.1e}; {open} open, {unread} files not read");
    assert!(parts > 100 && worst < 1e-3);
}

//! Rules by which surfaces answer in a cell are right all over the cell, however narrow a slot or rib enters it and however large the cell is.

use std::ops::ControlFlow;

use crate::common::*;
use glam::{DAffine3, DVec2, DVec3};
use mortise_bake::{BakeOptions, ExactSurface, bake};
use mortise_brep::{Curve, Edge, Face, Mesh, Shape, Surface};
use mortise_haptics::{Rendered, Vec3, rendered_distance};
use mortise_protocol::image::{Nearby, SceneImage};
use proptest::prelude::*;

/// Exact distances and single precision, mm.
const TOLERANCE_MM: f64 = 3e-4;
/// Places tried of each shape.
const PLACES: usize = 6_000;
/// Farthest place from the surface at which errors count, mm.
const REACH_MM: f64 = 0.2;

/// The prism over a simple polygon, counter-clockwise in x and y, from z = 0 to `height`, mm: its faces are the bottom, the top, then one from each corner to
/// the next.
fn prism(outline: &[DVec2], height: f64) -> Shape {
    let n = outline.len();
    let at = |z: f64| outline.iter().map(move |p| p.extend(z));
    let mut mesh = Mesh {
        vertices: at(0.0).chain(at(height)).collect(),
        ..Mesh::default()
    };
    let plane = |origin: DVec3, normal: DVec3| {
        let frame = frame_at(origin, normal);
        Face {
            surface: Surface::Plane { frame },
            fit_mm: None,
            reversed: false,
            area_mm2: 1.0,
            edges: Vec::new(),
            color: None,
        }
    };
    let mut faces = vec![
        plane(outline[0].extend(0.0), -DVec3::Z),
        plane(outline[0].extend(height), DVec3::Z),
    ];
    for [a, b, c] in ears(outline) {
        let up = n as u32;
        mesh.triangles.extend([[a, c, b], [a + up, b + up, c + up]]);
        mesh.triangle_face.extend([0, 1]);
    }
    let mut edges = Vec::new();
    let mut edge = |from: DVec3, to: DVec3, own: [usize; 2], faces: &mut Vec<Face>| {
        for f in own {
            faces[f].edges.push(edges.len() as u32);
        }
        edges.push(Edge {
            curve: Curve::Line {
                origin: from,
                direction: (to - from).normalize(),
            },
            length_mm: from.distance(to),
            faces: own.map(|f| f as u32).to_vec(),
            polyline: vec![from, to],
        });
    };
    for i in 0..n {
        let (p, q) = (outline[i], outline[(i + 1) % n]);
        let normal = (q - p).extend(0.0).cross(DVec3::Z).normalize();
        faces.push(plane(p.extend(0.0), normal));
        let [a, b] = [i, (i + 1) % n].map(|i| i as u32);
        let [c, d] = [a, b].map(|v| v + n as u32);
        mesh.triangles.extend([[a, b, d], [a, d, c]]);
        mesh.triangle_face.extend([faces.len() as u32 - 1; 2]);
    }
    for i in 0..n {
        let (p, q) = (outline[i], outline[(i + 1) % n]);
        edge(p.extend(0.0), q.extend(0.0), [0, i + 2], &mut faces);
        edge(p.extend(height), q.extend(height), [1, i + 2], &mut faces);
        edge(
            p.extend(0.0),
            p.extend(height),
            [(i + n - 1) % n + 2, i + 2],
            &mut faces,
        );
    }
    finish(Shape {
        faces,
        edges,
        mesh,
        ..Shape::default()
    })
}

/// Triangles of a simple polygon by cutting off ears.
fn ears(outline: &[DVec2]) -> Vec<[u32; 3]> {
    let mut left: Vec<u32> = (0..outline.len() as u32).collect();
    let mut found = Vec::new();
    let at = |i: u32| outline[i as usize];
    let turn = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - b);
    while left.len() > 3 {
        let n = left.len();
        let ear = (0..n).find(|&i| {
            let [a, b, c] = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
            let inside = |p: DVec2| {
                turn(at(a), at(b), p) >= 0.0 && turn(at(b), at(c), p) >= 0.0 && turn(at(c), at(a), p) >= 0.0
            };
            turn(at(a), at(b), at(c)) > 0.0
                && left
                    .iter()
                    .all(|&other| [a, b, c].contains(&other) || !inside(at(other)))
        });
        let i = ear.expect("a simple polygon has an ear");
        found.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
        left.remove(i);
    }
    found.push([left[0], left[1], left[2]]);
    found
}

/// A block with a slot of this width and depth and a rib beside it, at these places of its top, mm.
fn slotted([width, depth, at, rib, rise]: [f64; 5]) -> Shape {
    let (half, top) = (15.0, 8.0);
    let points = [
        [-half, 0.0],
        [half, 0.0],
        [half, top],
        [at + width + rib + 1.0, top],
        [at + width + rib + 1.0, top + rise],
        [at + width + 1.0, top + rise],
        [at + width + 1.0, top],
        [at + width, top],
        [at + width, top - depth],
        [at, top - depth],
        [at, top],
        [-half, top],
    ];
    prism(&points.map(DVec2::from_array), 20.0)
}

/// Error of an answer that is a bound by design outside convex edges and inside re-entrant ones: too much, or of the wrong sign.
fn error(rendered: &Rendered, exact: f64) -> f64 {
    let distance = f64::from(rendered.distance) * 1000.0;
    let off = (distance - exact).abs();
    let sign = match rendered.nearby {
        Nearby::Convex(group) if group.is_plain() => 1.0,
        Nearby::Reentrant(group) if group.is_plain() => -1.0,
        Nearby::Convex(_) | Nearby::Reentrant(_) => exact.signum(),
        _ => return off,
    };
    // Within the tolerance a bound has no sign.
    let is_bound = sign * exact > TOLERANCE_MM && distance * exact >= 0.0;
    if is_bound {
        (distance.abs() - exact.abs()).max(0.0)
    } else {
        off
    }
}

/// Places are on and beside the faces; those next to the planes of the grid, where the slot opens, are taken as often as others.
fn is_right_all_over(sizes: [f64; 5], cell: f64) -> Result<(), TestCaseError> {
    let shape = slotted(sizes);
    let options = BakeOptions {
        cell_mm: Some(cell),
        ..BakeOptions::default()
    };
    let baked = bake(
        &model(vec![("part", shape.clone(), DAffine3::IDENTITY)]),
        &options,
        &|_| ControlFlow::Continue(()),
    )
    .unwrap();
    let aligned = AlignedBytes::new(&baked.image);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    let board = image.shape(0);
    let surface = ExactSurface::new(&shape);
    let mut by_surfaces = 0;
    for i in 0..PLACES {
        let r = |step: f64| ((i as f64 + 0.5) * step).fract();
        let triangle = shape.mesh.triangles[(r(0.911_592) * shape.mesh.triangles.len() as f64) as usize];
        let [a, b, c] = triangle.map(|v| shape.mesh.vertices[v as usize]);
        let (x, y) = (r(0.831_000), r(0.757_533));
        let (x, y) = if x + y > 1.0 { (1.0 - x, 1.0 - y) } else { (x, y) };
        let way = DVec3::new(r(0.690_561), r(0.629_510), r(0.573_856)) * 2.0 - 1.0;
        // The extension of a face beyond its edge too.
        let on = a + (b - a) * x + (c - a) * y + (a - b) * if i % 3 == 0 { r(0.412_345) } else { 0.0 };
        let p = on + way * REACH_MM * r(0.523_123).powi(3);
        let at = (p / 1000.0).as_vec3();
        let exact = surface.nearest(at.as_dvec3() * 1000.0).unwrap();
        let Some(found) = rendered_distance(&board, Vec3::from_array(at.to_array())) else {
            continue;
        };
        if found.interpolated {
            continue;
        }
        by_surfaces += 1;
        let off = error(&found, exact.distance);
        // Farther off, between the places at which it was tested, a bound may exceed the distance by micrometres.
        prop_assert!(
            exact.distance.abs() > REACH_MM || off <= TOLERANCE_MM,
            "{off} mm at {p}: {found:?}, exact {}",
            exact.distance
        );
        // A bound of zero clear of the surface would be felt.
        let stated = f64::from(found.distance) * 1000.0;
        prop_assert!(
            stated.abs() > 1e-5 || exact.distance.abs() <= 0.01,
            "{stated} at {p}, exact {}",
            exact.distance
        );
    }
    prop_assert!(by_surfaces > PLACES / 4, "{by_surfaces}");
    Ok(())
}

/// Faces beyond a cell are nearest in a small part of it: at the end of a thin rib (the first four), about a slot's corner next to the cell (the
/// others).
#[test]
fn faces_next_to_a_cell_are_in_its_rule() {
    for (sizes, cell) in [
        ([0.3, 0.3, 0.0, 0.2, 0.2], 2.847_424),
        ([2.431_61, 0.3, 0.0, 0.620_421, 3.690_378], 3.547_849),
        ([0.3, 0.3, 2.054_147, 0.814_94, 1.753_772], 3.968_388),
        ([2.029_727, 0.3, -4.328_124, 0.2, 3.105_703], 3.056_839),
        ([0.3, 2.527_722, 0.0, 0.2, 0.2], 2.778_46),
        ([0.3, 2.169_623, 2.008_318, 0.2, 0.2], 2.687_352),
    ] {
        is_right_all_over(sizes, cell).unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn slots_and_ribs_are_in_the_rules(
        width in 0.3f64..4.0, depth in 0.3f64..3.0, at in -6.0f64..4.0, rib in 0.2f64..3.0, rise in 0.2f64..4.0,
        cell in 0.8f64..12.0,
    ) {
        is_right_all_over([width, depth, at, rib, rise], cell)?;
    }
}

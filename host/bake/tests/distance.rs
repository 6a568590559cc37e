//! Exact distance against closed forms, on tessellations coarse enough that facets alone fail.

use crate::common::*;
use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::ExactSurface;
use mortise_brep::{Shape, Surface};
use proptest::prelude::*;

/// Rounding of a few operations on numbers up to 100 mm, in double precision.
const EXACT_MM: f64 = 1e-9;

fn check(surface: &ExactSurface, expected: impl Fn(DVec3) -> f64, p: DVec3) -> Result<(), TestCaseError> {
    let found = surface.nearest(p).unwrap();
    let d = expected(p);
    prop_assert!(
        (found.distance - d).abs() < EXACT_MM,
        "at {p}: {} instead of {d}, nearest {}, face {}",
        found.distance,
        found.point,
        found.face
    );
    prop_assert!((found.point.distance(p) - d.abs()).abs() < EXACT_MM);
    Ok(())
}

fn points(size: f64) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
}

/// Points within facets' reach of the surface of radius `r` about z.
fn near_radius(r: f64, off: f64, z: std::ops::Range<f64>) -> impl Strategy<Value = DVec3> {
    (-off..off, 0.0..std::f64::consts::TAU, z)
        .prop_map(move |(d, a, z)| DVec3::new((r + d) * a.cos(), (r + d) * a.sin(), z))
}

thread_local! {
    static BLOCK: ExactSurface = ExactSurface::new(&block_with_hole([25.0, 20.0], 30.0, 9.375, 24));
    static PEG: ExactSurface = ExactSurface::new(&peg(8.875, 60.0, 16));
    static SPHERE: ExactSurface = ExactSurface::new(&sphere(10.0, 16));
    static TORUS: ExactSurface = ExactSurface::new(&torus(12.0, 4.0, 20));
    static CONE: ExactSurface = ExactSurface::new(&cone(8.0, 20.0, 16));
    static TURNED: (DAffine3, ExactSurface) = {
        let to = DAffine3::from_rotation_translation(
            DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0),
            DVec3::new(40.0, -7.0, 12.0),
        );
        (to, ExactSurface::new(&moved(&block_with_hole([25.0, 20.0], 30.0, 9.375, 24), to)))
    };
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn block_with_hole_is_exact(p in points(45.0)) {
        BLOCK.with(|s| check(s, |p| block_distance([25.0, 20.0], 30.0, 9.375, p), p))?;
    }

    /// Points between the hole's circle and the chords of its facets, also on and near both rims.
    #[test]
    fn block_is_exact_about_its_hole(p in near_radius(9.375, 0.2, -1.0..31.0)) {
        BLOCK.with(|s| check(s, |p| block_distance([25.0, 20.0], 30.0, 9.375, p), p))?;
    }

    #[test]
    fn block_is_exact_in_the_plane_of_its_rim(p in near_radius(9.375, 0.3, 29.9999..30.0001)) {
        BLOCK.with(|s| check(s, |p| block_distance([25.0, 20.0], 30.0, 9.375, p), p))?;
    }

    #[test]
    fn turned_block_is_exact(p in points(45.0)) {
        TURNED.with(|(to, s)| {
            check(s, |p| block_distance([25.0, 20.0], 30.0, 9.375, to.inverse().transform_point3(p)), to.transform_point3(p))
        })?;
    }

    #[test]
    fn peg_is_exact(p in points(80.0), q in near_radius(8.875, 0.3, -1.0..61.0)) {
        PEG.with(|s| { check(s, |p| peg_distance(8.875, 60.0, p), p)?; check(s, |p| peg_distance(8.875, 60.0, p), q) })?;
    }

    #[test]
    fn sphere_is_exact(p in points(25.0)) {
        SPHERE.with(|s| check(s, |p| p.length() - 10.0, p))?;
    }

    #[test]
    fn torus_is_exact(p in points(25.0)) {
        TORUS.with(|s| check(s, |p| (p.x.hypot(p.y) - 12.0).hypot(p.z) - 4.0, p))?;
    }

    #[test]
    fn cone_is_exact(p in points(40.0), q in near_radius(2.0, 3.0, 10.0..22.0)) {
        let (r, h) = (8.0f64, 20.0f64);
        let expected = |p: DVec3| {
            let rho = p.x.hypot(p.y);
            let slant = r.hypot(h);
            // Along the slant from base rim to tip, and perpendicular to it.
            let along = (((rho - r) * -r + p.z * h) / slant).clamp(0.0, slant);
            let on = (r - along * r / slant, along * h / slant);
            let side = (rho - on.0).hypot(p.z - on.1);
            let base = (rho - r).max(0.0).hypot(p.z);
            let inside = p.z > 0.0 && (rho - r) * h + p.z * r < 0.0;
            side.min(base) * if inside { -1.0 } else { 1.0 }
        };
        CONE.with(|s| { check(s, expected, p)?; check(s, expected, q) })?;
    }
}

/// Degenerate places: points on a hole's axis, equally far from the whole wall or rim; a corner and a point of the rim.
#[test]
fn degenerate_places_are_exact() {
    BLOCK.with(|s| {
        for z in [-3.0, 0.0, 1e-13, 15.0, 30.0, 42.0] {
            let p = DVec3::new(0.0, 0.0, z);
            let d = s.nearest(p).unwrap().distance;
            assert!(
                (d - block_distance([25.0, 20.0], 30.0, 9.375, p)).abs() < EXACT_MM,
                "{z}: {d}"
            );
        }
        for p in [DVec3::new(25.0, 20.0, 30.0), DVec3::new(9.375, 0.0, 30.0)] {
            assert!(s.nearest(p).unwrap().distance.abs() < EXACT_MM);
        }
    });
}

/// A half cylinder: the foot on the full cylinder lies outside the trim for half of all points.
#[test]
fn trim_of_a_half_cylinder_is_respected() {
    let full = peg(5.0, 10.0, 16);
    let mut half = Shape {
        faces: vec![full.faces[1].clone()],
        mesh: full.mesh.clone(),
        ..Shape::default()
    };
    half.faces[0].edges.clear();
    let keep: Vec<[u32; 3]> = full
        .mesh
        .triangles
        .iter()
        .zip(&full.mesh.triangle_face)
        .filter(|(t, f)| **f == 1 && t.iter().all(|&v| full.mesh.vertices[v as usize].y > -1e-9))
        .map(|(t, _)| *t)
        .collect();
    half.mesh.triangle_face = vec![0; keep.len()];
    half.mesh.triangles = keep;
    let half = finish(half);
    assert!(!half.closed);
    let surface = ExactSurface::new(&half);
    assert!(surface.sign_by_winding());
    // Below the half shell: nearest is the straight border at (±5, 0).
    let p = DVec3::new(1.0, -7.0, 5.0);
    let d = surface.nearest(p).unwrap().distance.abs();
    assert!((d - 4.0f64.hypot(7.0)).abs() < EXACT_MM, "{d}");
    let p = DVec3::new(1.0, 7.0, 5.0);
    let d = surface.nearest(p).unwrap().distance.abs();
    assert!((d - (50f64.sqrt() - 5.0)).abs() < EXACT_MM, "{d}");
}

/// With one facet missing the sign is still right everywhere but in the gap.
#[test]
fn a_leaky_block_keeps_its_sign() {
    let mut shape = block_with_hole([25.0, 20.0], 30.0, 9.375, 48);
    let gone = shape.mesh.triangle_face.iter().position(|&f| f == 6).unwrap();
    shape.mesh.triangles.remove(gone);
    shape.mesh.triangle_face.remove(gone);
    let shape = finish(shape);
    assert_eq!(shape.open_edges, 3);
    let surface = ExactSurface::new(&shape);
    let mut wrong = 0;
    let mut tested = 0;
    for i in 0..20_000u32 {
        // Halton-like coverage of the box around the block.
        let u = |base: f64| (f64::from(i) * base).fract() * 2.0 - 1.0;
        let p = DVec3::new(
            u(0.819_172_5) * 35.0,
            u(0.671_043_6) * 30.0,
            15.0 + u(0.549_700_5) * 25.0,
        );
        let d = block_distance([25.0, 20.0], 30.0, 9.375, p);
        let in_gap = p.truncate().length() < 12.0;
        if d.abs() < 1e-6 || in_gap {
            continue;
        }
        tested += 1;
        wrong += u32::from((surface.nearest(p).unwrap().distance < 0.0) != (d < 0.0));
    }
    assert_eq!(wrong, 0, "of {tested}");
}

/// A shape written inside out is reversed.
#[test]
fn an_inverted_mesh_is_turned_round() {
    let mut shape = sphere(5.0, 12);
    for t in &mut shape.mesh.triangles {
        t.swap(0, 1);
    }
    let surface = ExactSurface::new(&finish(shape));
    assert!(surface.nearest(DVec3::ZERO).unwrap().distance < 0.0);
}

/// Spline faces are represented by their tessellation: the error is its chord error.
#[test]
fn a_spline_face_is_its_tessellation() {
    let mut shape = sphere(10.0, 64);
    shape.faces[0].surface = Surface::Spline;
    let surface = ExactSurface::new(&shape);
    let chord = 10.0 * (1.0 - (std::f64::consts::PI / 64.0).cos());
    for i in 0..2000u32 {
        let u = |base: f64| (f64::from(i) * base).fract() * 40.0 - 20.0;
        let p = DVec3::new(u(0.819_172_5), u(0.671_043_6), u(0.549_700_5));
        let d = surface.nearest(p).unwrap().distance - (p.length() - 10.0);
        // Two chord errors: the facets curve in both directions.
        assert!((-1e-9..2.0 * chord + 1e-9).contains(&d), "{d} at {p}");
    }
}

/// A flat disc of radius 10 without the quarter x > 0, y < 0, as one open face with a coarse rim: its centre is a re-entrant corner.
fn three_quarter_disc() -> Shape {
    use mortise_brep::{Curve, Edge, Face, Mesh};
    let n = 12;
    let mut vertices = vec![DVec3::ZERO];
    vertices.extend((0..=n).map(|i| {
        let a = 1.5 * std::f64::consts::PI * f64::from(i) / f64::from(n);
        DVec3::new(10.0 * a.cos(), 10.0 * a.sin(), 0.0)
    }));
    let triangles: Vec<[u32; 3]> = (0..n).map(|i| [0, i + 1, i + 2]).collect();
    let line = |to: DVec3| Edge {
        curve: Curve::Line {
            origin: DVec3::ZERO,
            direction: to.normalize(),
        },
        length_mm: 10.0,
        faces: vec![0],
        polyline: vec![DVec3::ZERO, to],
    };
    let rim = Edge {
        curve: Curve::Circle {
            frame: world(),
            radius: 10.0,
        },
        length_mm: 15.0 * std::f64::consts::PI,
        faces: vec![0],
        polyline: vertices[1..].to_vec(),
    };
    finish(Shape {
        faces: vec![Face {
            surface: Surface::Plane { frame: world() },
            fit_mm: None,
            reversed: false,
            area_mm2: 1.0,
            edges: vec![0, 1, 2],
            color: None,
        }],
        edges: vec![line(vertices[1]), rim, line(vertices[vertices.len() - 1])],
        mesh: Mesh {
            triangle_face: vec![0; triangles.len()],
            vertices,
            triangles,
        },
        ..Shape::default()
    })
}

thread_local! {
    static VOID: ExactSurface =
        ExactSurface::new(&with_void(&sphere(60.0, 24), &block_with_hole([25.0, 20.0], 30.0, 9.375, 24)));
    static DISC: ExactSurface = ExactSurface::new(&three_quarter_disc());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    /// Points beyond a corner of the top face but within its facets' range: the corner is nearest, not the plane.
    #[test]
    fn block_is_exact_about_its_corners(p in points(0.4), q in points(0.05)) {
        let corner = DVec3::new(25.0, 20.0, 30.0);
        BLOCK.with(|s| {
            for p in [p, q, DVec3::new(p.x, p.y, q.z)] {
                check(s, |p| block_distance([25.0, 20.0], 30.0, 9.375, p), corner + p)?;
            }
            Ok::<(), TestCaseError>(())
        })?;
    }

    /// In the solid around a block-shaped void edges and corners are re-entrant: the sign comes from their own normals.
    #[test]
    fn a_void_is_exact(p in points(45.0), q in points(3.0)) {
        let expected = |p: DVec3| (p.length() - 60.0).max(-block_distance([25.0, 20.0], 30.0, 9.375, p));
        VOID.with(|s| {
            check(s, expected, p)?;
            check(s, expected, DVec3::new(25.0, 20.0, 30.0) + q)
        })?;
    }

    /// Points within range of a re-entrant corner and of the ends of the rim.
    #[test]
    fn a_face_is_exact_about_its_corners(p in points(0.5), height in -0.2f64..0.2) {
        for center in [DVec3::ZERO, DVec3::X * 10.0, -DVec3::Y * 10.0, DVec3::new(-7.0, 7.0, 0.0)] {
            let p = center + DVec3::new(p.x, p.y, height);
            let rho = p.x.hypot(p.y);
            let in_quarter = p.x > 0.0 && p.y < 0.0;
            // Distance in the plane: 0 inside; else to the straight sides (clamped to their ends) or the rim.
            let to_side = |along: f64, across: f64| (along - along.clamp(0.0, 10.0)).hypot(across);
            let flat = if in_quarter {
                to_side(p.x, p.y).min(to_side(-p.y, p.x))
            } else {
                (rho - 10.0).max(0.0)
            };
            let expected = flat.hypot(p.z);
            let found = DISC.with(|s| s.nearest(p).unwrap());
            prop_assert!((found.distance.abs() - expected).abs() < EXACT_MM, "{} instead of {expected} at {p}", found.distance);
        }
    }
}

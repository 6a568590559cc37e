//! Sections against closed forms, and caps against the volume of the mesh that they cut.

use std::f64::consts::PI;

use crate::support::{assert_no_leak, shapes, volume_below};
use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::Shape;
use mortise_inspect::{CutPlane, Fineness, Section, Solid, section};
use proptest::prelude::*;

/// Relative error of areas: by [`Fineness::Exact`] the sides of a full circle lack 2.7·10⁻⁴ of its area, of an arc less.
const AREA: f64 = 3e-4;
const EXACT: Fineness = Fineness::Exact(1e-3);

fn cut(shape: &Shape, point: DVec3, normal: DVec3, fineness: Fineness) -> (Section, CutPlane) {
    let plane = CutPlane::new(point, normal).unwrap();
    let found = section(&Solid::new(shape), &DAffine3::IDENTITY, &plane, fineness);
    (found, plane)
}

fn assert_area(shape: &Shape, point: DVec3, normal: DVec3, want: f64) {
    assert_area_of(shape, point, normal, want, want);
}

/// `whole`: the area of all loops, holes added.
fn assert_area_of(shape: &Shape, point: DVec3, normal: DVec3, want: f64, whole: f64) {
    let (found, plane) = cut(shape, point, normal, EXACT);
    let got = found.area_mm2();
    assert!((got - want).abs() <= AREA * whole, "{got} {want}");
    assert!((found.loop_area_mm2(&plane) - got).abs() < 1e-9 * want);
    assert!(found.open.is_empty());
    assert_no_leak(&found, &plane);
}

fn direction() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0f64)
        .prop_map(DVec3::from_array)
        .prop_filter("a direction", |v| v.length() > 0.1)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    #[test]
    fn a_ball_is_cut_in_a_circle(radius in 0.2..80.0f64, at in -0.95..0.95f64, normal in direction(), n in 8..16usize) {
        let h = at * radius;
        assert_area(&shapes::sphere(radius, 4 * n), normal.normalize() * h, normal, PI * (radius * radius - h * h));
    }

    /// Below the ends an oblique plane cuts a cylinder in an ellipse, along the axis in a rectangle.
    #[test]
    fn a_cylinder_is_cut_in_an_ellipse_or_a_rectangle(radius in 0.2..20.0f64, tilt in 0.0..1.1f64, about in 0.0..7.0f64, aside in -0.95..0.95f64) {
        let height = 6.0 * radius;
        let peg = shapes::peg(radius, height, 32);
        let normal = DVec3::new(tilt.sin() * about.cos(), tilt.sin() * about.sin(), tilt.cos());
        assert_area(&peg, DVec3::Z * height / 2.0, normal, PI * radius * radius / tilt.cos());
        let across = DVec3::new(about.cos(), about.sin(), 0.0);
        let c = aside * radius;
        assert_area(&peg, across * c, across, 2.0 * (radius * radius - c * c).sqrt() * height);
    }

    #[test]
    fn a_bored_block_is_cut_in_a_frame(half in prop::array::uniform2(6.0..40.0f64), share in 0.05..0.9f64, z in 0.001..1.0f64) {
        let radius = share * half[0].min(half[1]);
        let height = 10.0;
        let block = shapes::block_with_hole(half, height, radius, 32);
        let want = 4.0 * half[0] * half[1] - PI * radius * radius;
        assert_area_of(&block, DVec3::Z * height * z, DVec3::Z, want, 4.0 * half[0] * half[1]);
        // Along the axis of the hole, two strips.
        assert_area(&block, DVec3::ZERO, DVec3::X, 2.0 * (half[1] - radius) * height);
    }

    #[test]
    fn a_cone_is_cut_in_a_circle_or_a_triangle(radius in 0.5..20.0f64, height in 0.5..40.0f64, at in 0.02..0.95f64, about in 0.0..7.0f64) {
        let cone = shapes::cone(radius, height, 32);
        let r = radius * (1.0 - at);
        assert_area(&cone, DVec3::Z * height * at, DVec3::Z, PI * r * r);
        assert_area(&cone, DVec3::ZERO, DVec3::new(about.cos(), about.sin(), 0.0), radius * height);
    }

    #[test]
    fn a_ring_is_cut_in_two_circles_or_an_annulus(major in 5.0..30.0f64, share in 0.1..0.8f64, at in -0.9..0.9f64, about in 0.0..7.0f64) {
        let minor = share * major;
        let ring = shapes::torus(major, minor, 48);
        let s = (1.0 - at * at).sqrt() * minor;
        assert_area_of(&ring, DVec3::Z * minor * at, DVec3::Z, 4.0 * PI * major * s, 2.0 * PI * (major * major + s * s));
        assert_area(&ring, DVec3::ZERO, DVec3::new(about.cos(), about.sin(), 0.0), 2.0 * PI * minor * minor);
    }

    /// A cavity is left out.
    #[test]
    fn a_cavity_is_a_hole(radius in 1.0..4.5f64, at in -0.9..0.9f64) {
        let hollow = shapes::with_void(&shapes::block(DVec3::splat(5.0)), &shapes::sphere(radius, 24));
        let h = at * radius;
        assert_area_of(&hollow, DVec3::Z * h, DVec3::Z, 100.0 - PI * (radius * radius - h * h), 100.0);
    }
}

/// Shapes whose facets are cut as they are.
fn facetted(which: usize) -> Shape {
    match which {
        0 => shapes::block(DVec3::new(3.0, 4.0, 5.0)),
        1 => shapes::peg(4.0, 9.0, 17),
        2 => shapes::block_with_hole([9.0, 7.0], 6.0, 3.0, 12),
        3 => shapes::cone(5.0, 8.0, 9),
        4 => shapes::torus(8.0, 3.0, 11),
        5 => shapes::sphere(6.0, 12),
        _ => shapes::with_void(&shapes::block(DVec3::splat(5.0)), &shapes::sphere(3.0, 12)),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(60) })]

    /// Between heights of vertices the area is a quadratic polynomial, which two Gauss points integrate exactly: to the slab's volume, whatever the direction,
    /// also along axes of symmetry, where planes pass through many vertices.
    #[test]
    fn areas_add_up_to_the_volume(which in 0..7usize, free in direction(), axis in 0..6usize) {
        let normal = if axis < 3 { DVec3::AXES[axis] } else { free };
        let shape = facetted(which);
        let solid = Solid::new(&shape);
        let plane = |h: f64| {
            let n = normal.normalize();
            CutPlane::new(n * h, n).unwrap()
        };
        let at = |h: f64| {
            let found = section(&solid, &DAffine3::IDENTITY, &plane(h), Fineness::Facets);
            assert_no_leak(&found, &plane(h));
            assert!((found.loop_area_mm2(&plane(h)) - found.area_mm2()).abs() < 1e-9 * (1.0 + found.area_mm2()));
            assert!(found.open.is_empty());
            found.area_mm2()
        };
        let zero = plane(0.0);
        let mut heights: Vec<f64> = shape.mesh.vertices.iter().map(|&v| zero.height(v)).collect();
        heights.sort_by(f64::total_cmp);
        heights.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        let mut total = 0.0;
        for w in heights.windows(2) {
            let (middle, half) = ((w[0] + w[1]) / 2.0, (w[1] - w[0]) / 2.0);
            let volume = half * (at(middle - half / 3f64.sqrt()) + at(middle + half / 3f64.sqrt()));
            let slab = volume_below(&shape.mesh, &plane(w[1])) - volume_below(&shape.mesh, &plane(w[0]));
            prop_assert!((volume - slab).abs() < 1e-9 * shape.volume_mm3, "{volume} {slab}");
            total += volume;
            // Through vertices, too, the section is one: that just below.
            let (on, below) = (at(w[1]), at(w[1] - half * 1e-6));
            prop_assert!((on - below).abs() < 1e-4 * (1.0 + on), "{on} {below}");
        }
        prop_assert!((total - shape.volume_mm3).abs() < 1e-9 * shape.volume_mm3);
    }

    /// Where the assembly stands does not matter.
    #[test]
    fn a_section_moves_with_its_part(which in 0..7usize, about in direction(), angle in 0.0..6.0f64, far in prop::array::uniform3(-300.0..300.0f64), normal in direction(), h in -2.0..2.0f64) {
        let shape = facetted(which);
        let solid = Solid::new(&shape);
        let pose = DAffine3::from_rotation_translation(DQuat::from_axis_angle(about.normalize(), angle), DVec3::from_array(far));
        let plane = CutPlane::new(normal.normalize() * h, normal).unwrap();
        let there = CutPlane::new(pose.transform_point3(plane.origin), pose.transform_vector3(plane.normal)).unwrap();
        let a = section(&solid, &DAffine3::IDENTITY, &plane, Fineness::Facets).area_mm2();
        let b = section(&solid, &pose, &there, Fineness::Facets).area_mm2();
        prop_assert!((a - b).abs() <= 1e-6 * (1.0 + a), "{a} {b}");
    }
}

#[test]
fn along_a_face_the_section_is_the_one_below() {
    let block = shapes::block(DVec3::new(1.0, 2.0, 3.0));
    for (z, want) in [(-3.0, 0.0), (-2.0, 8.0), (3.0, 8.0), (3.0 + 1e-7, 0.0)] {
        let (found, plane) = cut(&block, DVec3::Z * z, DVec3::Z, EXACT);
        assert!((found.area_mm2() - want).abs() < 1e-9, "{z}");
        assert_no_leak(&found, &plane);
    }
    // Through an edge of the block, and beside one that it touches.
    let edge = DVec3::new(1.0, 2.0, 0.0);
    let (through, _) = cut(&block, edge, DVec3::new(2.0, -1.0, 0.0), EXACT);
    assert!((through.area_mm2() - 6.0 * 20f64.sqrt()).abs() < 1e-9);
    let (touching, _) = cut(&block, edge, DVec3::new(1.0, 1.0, 0.0), EXACT);
    assert!(touching.area_mm2() < 1e-9);
}

#[test]
fn an_open_shell_has_lines_and_no_cap() {
    let mut cup = shapes::block(DVec3::ONE);
    cup.mesh.triangles.truncate(10);
    cup.mesh.triangle_face.truncate(10);
    let cup = shapes::finish(cup);
    assert!(!cup.closed);
    // Level: a closed line. Upright: one that ends at the rim.
    for (normal, points) in [(DVec3::Z, 8), (DVec3::X, 7)] {
        let (found, _) = cut(&cup, DVec3::ZERO, normal, EXACT);
        assert!(found.loops.is_empty() && found.cap.triangles.is_empty());
        assert_eq!(found.open.iter().map(|l| l.points.len()).sum::<usize>(), points);
    }
    // Beside a closed solid of the same part only that has a cap.
    let mut both = shapes::moved(
        &shapes::block(DVec3::ONE),
        DAffine3::from_translation(DVec3::X * 5.0),
    );
    let more = both.mesh.vertices.len() as u32;
    both.mesh.vertices.extend(&cup.mesh.vertices);
    both.mesh
        .triangles
        .extend(cup.mesh.triangles.iter().map(|t| t.map(|v| v + more)));
    both.mesh.triangle_face.extend(&cup.mesh.triangle_face);
    let (found, _) = cut(&shapes::finish(both), DVec3::ZERO, DVec3::Z, EXACT);
    assert!((found.area_mm2() - 4.0).abs() < 1e-9);
    assert_eq!(found.open.len(), 1);
}

/// Solids of one part that overlap are covered once.
#[test]
fn overlapping_solids_are_covered_once() {
    let mut both = shapes::block(DVec3::ONE);
    let other = shapes::moved(&both, DAffine3::from_translation(DVec3::new(0.5, 0.7, 0.1)));
    let more = both.mesh.vertices.len() as u32;
    both.mesh.vertices.extend(&other.mesh.vertices);
    both.mesh
        .triangles
        .extend(other.mesh.triangles.iter().map(|t| t.map(|v| v + more)));
    both.mesh.triangle_face.extend(&other.mesh.triangle_face);
    let (found, _) = cut(&shapes::finish(both), DVec3::ZERO, DVec3::Z, Fineness::Facets);
    assert!(
        (found.area_mm2() - (8.0 - 1.5 * 1.3)).abs() < 1e-9,
        "{}",
        found.area_mm2()
    );
}

#[test]
fn nothing_is_cut_beside_a_part_or_of_none() {
    let (found, _) = cut(&shapes::sphere(3.0, 12), DVec3::Z * 4.0, DVec3::Z, EXACT);
    assert!(found.is_empty() && found.area_mm2() == 0.0);
    let (found, _) = cut(&Shape::default(), DVec3::ZERO, DVec3::Z, EXACT);
    assert!(found.is_empty());
    assert_eq!(CutPlane::new(DVec3::ZERO, DVec3::ZERO), None);
}

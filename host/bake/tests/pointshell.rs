//! The pointshell lies on the exact surface, inside the trim, as dense as requested and no denser than needed. The omission of points that partners
//! make redundant is tested in `contact_sampling.rs`.

use std::f64::consts::TAU;

use crate::common::*;
use glam::DVec3;
use mortise_bake::{ExactSurface, Pointshell, PointshellOptions, ShellPoint, sample_pointshell};
use mortise_brep::Shape;
use mortise_protocol::image::NO_FACE;

fn sample(shape: &Shape, epsilon_mm: f64, max_spacing_mm: f64) -> (ExactSurface, Pointshell) {
    let surface = ExactSurface::new(shape);
    let shell = sample_pointshell(
        &surface,
        &PointshellOptions::everywhere(epsilon_mm, max_spacing_mm),
    );
    assert_eq!(
        shell.points.len(),
        shell.face_points + shell.edge_points + shell.corner_points
    );
    for p in &shell.points {
        assert!((p.normal.length() - 1.0).abs() < 1e-12);
        assert!(usize::from(p.face) < shape.faces.len());
    }
    (surface, shell)
}

/// Each point is on the surface, to rounding, regardless of the facets; a point slightly off along the normal is outside.
fn check_on(surface: &ExactSurface, shell: &Pointshell, exact: impl Fn(DVec3) -> f64) {
    for p in &shell.points {
        let d = exact(p.position);
        assert!(d.abs() < 1e-9, "{d} at {}", p.position);
        assert!(exact(p.position + p.normal * 1e-3) > 0.0, "{p:?}");
        assert!(exact(p.position - p.normal * 1e-3) < 0.0, "{p:?}");
        assert!(surface.nearest(p.position).unwrap().distance.abs() < 1e-9);
    }
}

fn of_face(shell: &Pointshell, face: u16) -> Vec<&ShellPoint> {
    shell
        .points
        .iter()
        .filter(|p| p.face == face && p.edge_face == NO_FACE)
        .collect()
}

#[test]
fn thesis_peg_has_the_points_its_error_bound_asks() {
    let (r, h, epsilon, spacing) = (8.875, 60.0, 0.01, 6.0);
    let (surface, shell) = sample(&peg(r, h, 24), epsilon, spacing);
    check_on(&surface, &shell, |p| peg_distance(r, h, p));
    assert!(
        (400..=1500).contains(&shell.points.len()),
        "{}",
        shell.points.len()
    );
    // Around: the smallest count whose chord error is within the bound. Rims: 2 circles of it; wall: rows of it, 6 mm apart.
    let around = (TAU * r / (8.0f64 * r * epsilon).sqrt()).ceil() as usize;
    let rows = (h / spacing) as usize;
    assert_eq!(shell.edge_points, 2 * around);
    assert_eq!(of_face(&shell, 1).len(), rows * around);
    assert_eq!(shell.corner_points, 0);
    // Along straight directions no denser than requested. Flats: about π r² / spacing².
    let flat = of_face(&shell, 0).len();
    assert!((4..=12).contains(&flat), "{flat}");
    for p in &shell.points {
        if p.edge_face != NO_FACE {
            let faces = (p.face.min(p.edge_face), p.face.max(p.edge_face));
            assert!(faces == (0, 1) || faces == (1, 2), "{faces:?}");
            // Between a flat end and the wall the normal is half-way.
            let radial = DVec3::new(p.position.x, p.position.y, 0.0).normalize();
            assert!((p.normal.dot(radial) - 0.5f64.sqrt()).abs() < 1e-9);
        }
    }
}

/// Halving ε gives √2 as many points around, and no more along.
#[test]
fn density_follows_the_error_bound() {
    let count = |epsilon: f64| {
        let (_, shell) = sample(&peg(8.875, 60.0, 24), epsilon, 6.0);
        of_face(&shell, 1).len()
    };
    let ratio = count(0.0025) as f64 / count(0.01) as f64;
    assert!((ratio - 2.0).abs() < 0.05, "{ratio}");
}

#[test]
fn block_with_hole_is_sampled_inside_its_trim() {
    let (r, half, h) = (9.375, [25.0, 20.0], 30.0);
    let (surface, shell) = sample(&block_with_hole(half, h, r, 24), 0.01, 5.0);
    check_on(&surface, &shell, |p| block_distance(half, h, r, p));
    // No point of the top floats over the hole.
    assert!(
        of_face(&shell, 1)
            .iter()
            .all(|p| p.position.truncate().length() >= r)
    );
    // Corners once each, with two of their three faces.
    assert_eq!(shell.corner_points, 8);
    let corners = &shell.points[shell.face_points + shell.edge_points..];
    for c in corners {
        assert!(
            (c.position.x.abs() - 25.0).abs() < 1e-9 && (c.normal.abs() - 1.0 / 3f64.sqrt()).length() < 1e-6
        );
        assert!(c.face != c.edge_face && c.edge_face != NO_FACE);
    }
    // The concave-looking rim of the hole is a convex edge too.
    let rim = shell
        .points
        .iter()
        .filter(|p| p.edge_face == 6 || p.face == 6 && p.edge_face != NO_FACE)
        .count();
    assert_eq!(rim, 2 * (TAU * r / (8.0f64 * r * 0.01).sqrt()).ceil() as usize);
}

#[test]
fn curved_faces_are_covered() {
    for (shape, exact, spacing) in [
        (
            sphere(10.0, 24),
            Box::new(|p: DVec3| p.length() - 10.0) as Box<dyn Fn(DVec3) -> f64>,
            (8.0f64 * 10.0 * 0.01).sqrt(),
        ),
        (
            torus(12.0, 4.0, 24),
            Box::new(|p: DVec3| (p.x.hypot(p.y) - 12.0).hypot(p.z) - 4.0),
            5.0,
        ),
    ] {
        let (surface, shell) = sample(&shape, 0.01, 5.0);
        check_on(&surface, &shell, exact);
        // Every mesh vertex has a point within one spacing (half a lattice cell's diagonal and the shift of rows).
        for v in &shape.mesh.vertices {
            let near = shell
                .points
                .iter()
                .map(|p| p.position.distance(*v))
                .fold(f64::INFINITY, f64::min);
            assert!(near <= spacing, "{near} > {spacing} at {v}");
        }
    }
}

#[test]
fn cone_keeps_its_points_on_the_slant() {
    let (r, h) = (8.0, 20.0);
    let (_, shell) = sample(&cone(r, h, 24), 0.01, 4.0);
    for p in of_face(&shell, 1) {
        let rho = p.position.truncate().length();
        assert!((rho - r * (1.0 - p.position.z / h)).abs() < 1e-9);
        assert!(p.position.z > 0.0 && p.position.z <= h);
    }
    assert!(of_face(&shell, 1).len() > 50);
    // The tip, where no edge ends, has one point.
    let tips = shell
        .points
        .iter()
        .filter(|p| (p.position - DVec3::Z * h).length() < 1e-9);
    assert_eq!(tips.clone().count(), 1);
    assert!(tips.into_iter().all(|p| p.normal == DVec3::Z));
}

/// A spline face that is a cylinder gets few points along its generators.
#[test]
fn a_spline_cylinder_is_sampled_like_a_cylinder() {
    let mut shape = peg(8.875, 60.0, 64);
    shape.faces[1].surface = mortise_brep::Surface::Spline;
    let (_, shell) = sample(&shape, 0.01, 6.0);
    let exact = sample(&peg(8.875, 60.0, 64), 0.01, 6.0).1;
    let (spline, exact) = (of_face(&shell, 1).len(), of_face(&exact, 1).len());
    assert!(
        spline * 2 > exact && spline < exact * 2,
        "{spline} against {exact}"
    );
    for p in of_face(&shell, 1) {
        // Points lie on the facets, within their chord error; the normal is smooth, within the angle of the same chord.
        let radial = DVec3::new(p.position.x, p.position.y, 0.0);
        assert!((radial.length() - 8.875).abs() < 8.875 * (1.0 - (TAU / 128.0).cos()) + 1e-9);
        assert!(p.normal.dot(radial.normalize()) > (TAU / 128.0).cos());
    }
}

//! The textbook pointshell: a point for each voxel the surface crosses, on moving parts only.

use std::ops::ControlFlow;

use crate::common::*;
use glam::{DAffine3, DVec3};
use mortise_bake::{BakeOptions, ExactSurface, PointshellKind, bake, classic_pointshell};
use mortise_protocol::image::SceneImage;

fn classic(shrink_percent: f64) -> BakeOptions {
    BakeOptions {
        cell_mm: Some(1.0),
        shell: PointshellKind::Classic {
            voxel_mm: None,
            shrink_percent,
        },
        ..BakeOptions::default()
    }
}

/// Points are centres on one grid, all different; each lies in a crossed voxel, and every crossed voxel has one.
#[test]
fn every_crossed_voxel_has_its_centre() {
    let (r, h, voxel) = (8.875, 30.0, 1.0);
    let surface = ExactSurface::new(&peg(r, h, 24));
    let shell = classic_pointshell(&surface, voxel, 0.0, "peg").unwrap();
    let first = shell.points[0].position;
    let mut seen = std::collections::HashSet::new();
    for p in &shell.points {
        let steps = (p.position - first) / voxel;
        assert!((steps - steps.round()).length() < 1e-4, "{steps}");
        assert!(seen.insert(steps.round().to_array().map(|x| x as i64)));
        // Within the voxel's half diagonal, and a 64th of a voxel for the last halving.
        assert!(peg_distance(r, h, p.position).abs() <= voxel * (0.75f64.sqrt() + 1.0 / 64.0));
        assert!((p.normal.length() - 1.0).abs() < 1e-12);
    }
    // Points of the surface itself, near and far from edges: each lies in a voxel that has a point.
    for i in 0..20_000 {
        let u = |k: f64| (f64::from(i) * k).fract();
        let (a, z) = (u(0.754_877_666) * std::f64::consts::TAU, u(0.569_840_291) * h);
        let rho = if i % 3 == 0 {
            r * u(0.437_016_024).sqrt()
        } else {
            r
        };
        let z = if i % 3 == 0 {
            if i % 2 == 0 { 0.0 } else { h }
        } else {
            z
        };
        let p = DVec3::new(rho * a.cos(), rho * a.sin(), z);
        let near = (-1..=1).any(|k| {
            // On the boundary between two voxels either one is accepted.
            let aside = ((p - first) / voxel + DVec3::splat(f64::from(k) * 1e-6))
                .round()
                .to_array()
                .map(|x| x as i64);
            seen.contains(&aside)
        });
        assert!(near, "{p}");
    }
    // About the area over voxel²: 4/π times that around the wall, exactly that on the flats.
    let expected = (4.0 / std::f64::consts::PI * std::f64::consts::TAU * r * h
        + std::f64::consts::TAU * r * r)
        / voxel.powi(2);
    let ratio = shell.points.len() as f64 / expected;
    assert!(
        (0.95..1.35).contains(&ratio),
        "{} against {expected}",
        shell.points.len()
    );
}

/// Voxel normals point roughly outward; on the flats exactly.
#[test]
fn normals_are_the_voxels_own() {
    let (r, h) = (8.875, 30.0);
    let surface = ExactSurface::new(&peg(r, h, 24));
    let shell = classic_pointshell(&surface, 0.5, 0.0, "peg").unwrap();
    for p in &shell.points {
        let rho = p.position.truncate().length();
        if rho < r - 2.0 {
            let up = if p.position.z > h / 2.0 {
                DVec3::Z
            } else {
                -DVec3::Z
            };
            assert!((p.normal - up).length() < 1e-9, "{p:?}");
        } else if p.position.z > 2.0 && p.position.z < h - 2.0 {
            let radial = DVec3::new(p.position.x, p.position.y, 0.0) / rho;
            assert!(p.normal.dot(radial) > 0.8, "{p:?}");
        }
    }
}

/// Shrinking moves every point inward along its normal, by a voxel at most.
#[test]
fn shrinking_moves_inward() {
    let surface = ExactSurface::new(&peg(8.875, 30.0, 24));
    let shell = |shrink: f64| classic_pointshell(&surface, 1.0, shrink, "peg").unwrap();
    let (plain, half, whole) = (shell(0.0), shell(50.0), shell(100.0));
    for ((a, b), c) in plain.points.iter().zip(&half.points).zip(&whole.points) {
        assert!((a.position - a.normal * 0.5 - b.position).length() < 1e-6);
        assert!((a.position - a.normal - c.position).length() < 1e-6);
    }
}

/// The method tests one direction: fixed parts have no points, and the image is still valid.
#[test]
fn only_what_moves_has_points() {
    let model = model(vec![
        (
            "block",
            block_with_hole([25.0, 20.0], 30.0, 9.375, 24),
            DAffine3::IDENTITY,
        ),
        (
            "peg",
            peg(8.875, 60.0, 24),
            DAffine3::from_translation(DVec3::Z * 80.0),
        ),
    ]);
    let baked = bake(&model, &classic(20.0), &|_| ControlFlow::Continue(())).unwrap();
    let points: Vec<usize> = baked
        .report
        .shapes
        .iter()
        .map(|s| s.points.iter().sum())
        .collect();
    assert!(points[0] == 0 && points[1] > 4_000, "{points:?}");
    let aligned = AlignedBytes::new(&baked.image);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    assert_eq!(image.shape(0).points.len(), 0);
    assert_eq!(image.shape(1).points.len(), points[1]);
}

#[test]
fn shrinking_more_than_a_voxel_is_refused() {
    let model = model(vec![("peg", peg(8.875, 60.0, 24), DAffine3::IDENTITY)]);
    let error = bake(&model, &classic(101.0), &|_| ControlFlow::Continue(())).unwrap_err();
    assert!(error.to_string().starts_with("shrink_percent = 101"), "{error}");
}

//! Parts joined to one shape: their mass is that of their triangles, and distances outside are the least of theirs.

use crate::support;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_brep::Shape;
use mortise_task::Body;
use mortise_task::joined::joined;

/// Volume, centre of mass and inertia about it, of a closed mesh: tetrahedra from the origin to each triangle.
fn mass(shape: &Shape) -> (f64, DVec3, DMat3) {
    let (mut volume, mut first, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
    let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
    for triangle in &shape.mesh.triangles {
        let [a, b, c] = triangle.map(|v| shape.mesh.vertices[v as usize]);
        let v = a.dot(b.cross(c)) / 6.0;
        let sum = a + b + c;
        volume += v;
        first += sum * (v / 4.0);
        second += (outer(a, a) + outer(b, b) + outer(c, c) + outer(sum, sum)) * (v / 20.0);
    }
    let center = first / volume;
    let about = second - outer(center, center) * volume;
    let trace = about.x_axis.x + about.y_axis.y + about.z_axis.z;
    (volume, center, DMat3::from_diagonal(DVec3::splat(trace)) - about)
}

#[test]
fn mass_is_that_of_the_triangles() {
    for seed in [3, 14, 25] {
        // Polygonal plugs: their triangles are exact.
        let assembly = support::random(seed).1;
        let mut model = assembly.model;
        model.parts[1].placement = DAffine3::from_rotation_translation(
            DQuat::from_rotation_arc(DVec3::X, DVec3::new(0.2, 0.6, -0.7).normalize()),
            DVec3::new(3.0, -20.0, 40.0),
        );
        for parts in [&[0][..], &[1], &[0, 1], &[1, 0]] {
            let whole = joined(&model, parts);
            let (volume, center, inertia) = mass(&whole);
            assert!((whole.volume_mm3 - volume).abs() < 1e-6 * volume, "{seed}");
            assert!(whole.center_of_mass.distance(center) < 1e-5, "{seed}");
            let own = DMat3::from_cols_array_2d(&whole.inertia_mm5).transpose();
            let off = (own - inertia).to_cols_array().map(f64::abs);
            let largest = inertia.to_cols_array().map(f64::abs);
            let most = |values: [f64; 9]| values.into_iter().fold(0.0, f64::max);
            assert!(most(off) < 1e-6 * most(largest), "{seed}: {off:?}");
        }
    }
}

#[test]
fn distances_outside_are_the_least() {
    let assembly = support::own("mating/tests/data/two_pin_exact.step");
    let whole = Body::new(&joined(&assembly.model, &[0, 1])).expect("a body");
    let place = assembly.placement(0);
    let mut random = fastrand::Rng::with_seed(19);
    let (low, high) = assembly.bounds_of(&[0, 1], DAffine3::IDENTITY);
    let mut outside = 0;
    for _ in 0..2000 {
        let mut share = || 1.6 * random.f64() - 0.3;
        let p = low + (high - low) * DVec3::new(share(), share(), share());
        let from = |part: usize| {
            let at = assembly.placement(part).inverse().transform_point3(p);
            assembly
                .body(part)
                .surface()
                .nearest(at)
                .expect("a distance")
                .distance
        };
        let least = from(0).min(from(1));
        let found = whole.surface().nearest(place.inverse().transform_point3(p));
        let found = found.expect("a distance").distance;
        if least > 1e-6 {
            outside += 1;
            assert!((found - least).abs() < 1e-6, "{found} for {least} at {p}");
        } else {
            // Inside, the nearest face may be one between two parts.
            let nearest = from(0).abs().min(from(1).abs());
            assert!(
                (found.abs() - nearest).abs() < 1e-6,
                "{found} for {nearest} at {p}"
            );
        }
    }
    assert!(outside > 500);
}

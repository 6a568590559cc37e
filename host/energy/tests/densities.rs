//! Densities against closed forms, and forces against differences of the energy.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_brep::{Curve, Edge, Face, Frame, Mesh, Shape, Surface};
use mortise_energy::{Density, Kernel, Pair};
use nalgebra::Complex;
use proptest::prelude::*;

fn face(surface: Surface, edges: Vec<u32>) -> Face {
    Face {
        surface,
        fit_mm: None,
        reversed: false,
        area_mm2: 1.0,
        edges,
        color: None,
    }
}

fn frame(origin: DVec3, z: DVec3) -> Frame {
    let x = z.any_orthonormal_vector();
    Frame {
        origin,
        x,
        y: z.cross(x),
        z,
    }
}

/// A ball about the origin.
fn ball(radius: f64, rings: u32) -> Shape {
    let (across, mut mesh) = (2 * rings, Mesh::default());
    let at = |ring: u32, i: u32| {
        let (polar, around) = (
            PI * f64::from(ring) / f64::from(rings),
            TAU * f64::from(i % across) / f64::from(across),
        );
        radius
            * DVec3::new(
                polar.sin() * around.cos(),
                polar.sin() * around.sin(),
                polar.cos(),
            )
    };
    mesh.vertices.push(at(0, 0));
    for ring in 1..rings {
        mesh.vertices.extend((0..across).map(|i| at(ring, i)));
    }
    mesh.vertices.push(-at(0, 0));
    let last = mesh.vertices.len() as u32 - 1;
    let node = |ring: u32, i: u32| match ring {
        0 => 0,
        ring if ring == rings => last,
        ring => 1 + (ring - 1) * across + i % across,
    };
    for ring in 0..rings {
        for i in 0..across {
            let [a, b, c, d] = [
                node(ring, i),
                node(ring + 1, i),
                node(ring + 1, i + 1),
                node(ring, i + 1),
            ];
            mesh.triangles.extend(
                [[a, b, c], [a, c, d]]
                    .into_iter()
                    .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]),
            );
        }
    }
    mesh.triangle_face = vec![0; mesh.triangles.len()];
    let surface = Surface::Sphere {
        frame: frame(DVec3::ZERO, DVec3::Z),
        radius,
    };
    Shape {
        faces: vec![face(surface, Vec::new())],
        mesh,
        closed: true,
        ..Shape::default()
    }
}

/// A box with these corners.
fn cuboid(low: DVec3, high: DVec3) -> Shape {
    let corner = |k: u32| DVec3::select(glam::BVec3::new(k & 1 > 0, k & 2 > 0, k & 4 > 0), high, low);
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let mut mesh = Mesh {
        vertices: (0..8).map(corner).collect(),
        ..Mesh::default()
    };
    let mut faces = Vec::new();
    let mut edges: Vec<Edge> = Vec::new();
    let mut ends: Vec<[u32; 2]> = Vec::new();
    for (number, quad) in (0..).zip(quads) {
        let [a, b, c, d] = quad;
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
        mesh.triangle_face.extend([number; 2]);
        let mut own = Vec::new();
        for (p, q) in [(a, b), (b, c), (c, d), (d, a)] {
            let pair = [p.min(q), p.max(q)];
            let index = ends.iter().position(|known| *known == pair).unwrap_or_else(|| {
                let [from, to] = pair.map(corner);
                ends.push(pair);
                edges.push(Edge {
                    curve: Curve::Line {
                        origin: from,
                        direction: (to - from).normalize(),
                    },
                    length_mm: from.distance(to),
                    faces: Vec::new(),
                    polyline: vec![from, to],
                });
                edges.len() - 1
            });
            edges[index].faces.push(number);
            own.push(index as u32);
        }
        let normal = (corner(b) - corner(a)).cross(corner(c) - corner(a)).normalize();
        faces.push(face(
            Surface::Plane {
                frame: frame(corner(a), normal),
            },
            own,
        ));
    }
    Shape {
        faces,
        edges,
        mesh,
        closed: true,
        ..Shape::default()
    }
}

fn near(found: Complex<f64>, truth: Complex<f64>, share: f64) -> bool {
    (found - truth).norm() <= share * truth.norm()
}

/// All of a ball is equally far from its centre: iλ₂/σ, from eq. 4 with ε = 0 over the whole solid angle.
#[test]
fn the_centre_of_a_ball() {
    let kernel = Kernel::default();
    let found = Density::new(&ball(10.0, 48), kernel).at(DVec3::ZERO);
    let truth = Complex::new(0.0, kernel.inside / kernel.sigma);
    assert!(near(found, truth, 0.01), "{found} {truth}");
}

/// Beside the middle of a face much larger than the distance the density is that of a plane, at any height and on both sides.
#[test]
fn beside_a_plane_it_is_the_same_at_every_height() {
    let kernel = Kernel::default();
    let density = Density::new(&cuboid(DVec3::splat(-50.0), DVec3::splat(50.0)), kernel);
    for height in [1e-5, 0.01, 0.3, 2.0, 10.0] {
        for is_outside in [true, false] {
            let z = 50.0 + if is_outside { height } else { -height };
            let found = density.at(DVec3::new(1.0, -2.0, z));
            let truth = kernel.beside_a_plane(is_outside);
            assert!(near(found, truth, 0.01), "{height} {is_outside}: {found} {truth}");
        }
    }
}

/// Within a ball, off its centre, by one integral over the polar angle.
fn in_ball(kernel: Kernel, radius: f64, off: f64) -> Complex<f64> {
    const STEPS: usize = 20_000;
    let xi = off - radius;
    let of = |cosine: f64| {
        let eta = (radius * radius + off * off - 2.0 * radius * off * cosine).sqrt();
        // v·n for p on the axis: (p − q)·q / (η R).
        let flux = (off * cosine - radius) / eta;
        kernel.at(xi, eta) * (flux * TAU * radius * radius)
    };
    (0..STEPS)
        .map(|i| of(2.0 * (i as f64 + 0.5) / STEPS as f64 - 1.0) * (2.0 / STEPS as f64))
        .sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn within_a_ball(
        radius in 5.0f64..20.0,
        share in 0.05f64..0.9,
        way in prop::array::uniform3(-1.0f64..1.0),
        sigma in 0.1f64..0.4,
    ) {
        let kernel = Kernel { sigma, ..Kernel::default() };
        let way = DVec3::from_array(way).try_normalize().unwrap_or(DVec3::X);
        let found = Density::new(&ball(radius, 64), kernel).at(share * radius * way);
        let truth = in_ball(kernel, radius, share * radius);
        prop_assert!(near(found, truth, 0.03), "{found} {truth}");
    }
}

/// Two solids with nothing symmetric between them.
fn pair() -> Pair {
    let kernel = Kernel::default();
    let fixed = Density::new(
        &cuboid(DVec3::new(-6.0, -5.0, -7.0), DVec3::new(6.0, 5.0, 0.0)),
        kernel,
    );
    let moving = Density::new(
        &cuboid(DVec3::new(-2.0, -3.0, -4.0), DVec3::new(2.0, 3.0, 4.0)),
        kernel,
    );
    let turned = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.3));
    Pair::new(&fixed, &moving, [1.0, 3.0], turned, 1.0)
}

/// Force and torque are the negative gradient of the energy: differences over 10³ random poses, within 1 % of the largest.
#[test]
fn force_and_torque_are_the_gradient() {
    const POSES: usize = 1000;
    // Small beside the lattice's step, so that few samples change their cell.
    const STEP: f64 = 1e-5;
    let pair = pair();
    let mut state = 7u64;
    let mut number = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let (mut worst, mut largest) = ([0f64; 2], [0f64; 2]);
    for _ in 0..POSES {
        let mut vector = || DVec3::new(number(), number(), number());
        let (turn, shift) = (vector(), 6.0 * vector());
        let pose = DAffine3::from_rotation_translation(DQuat::from_scaled_axis(turn), shift);
        let felt = pair.at(&pose);
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let moved = |by: f64| DAffine3 {
                translation: pose.translation + by * axis,
                ..pose
            };
            let turned = |by: f64| DAffine3 {
                matrix3: DMat3::from_quat(DQuat::from_axis_angle(axis, by)) * pose.matrix3,
                ..pose
            };
            let differences = [
                (pair.at(&moved(STEP)).energy - pair.at(&moved(-STEP)).energy) / (2.0 * STEP),
                (pair.at(&turned(STEP)).energy - pair.at(&turned(-STEP)).energy) / (2.0 * STEP),
            ];
            for (k, felt) in [felt.force.dot(axis), felt.torque.dot(axis)]
                .into_iter()
                .enumerate()
            {
                worst[k] = worst[k].max((felt + differences[k]).abs());
                largest[k] = largest[k].max(felt.abs());
            }
        }
    }
    for k in 0..2 {
        assert!(worst[k] <= 0.01 * largest[k], "{worst:?} of {largest:?}");
    }
}

/// What is moved with both solids changes nothing, and far apart nothing is felt.
#[test]
fn far_apart_nothing_is_felt() {
    let far = pair().at(&DAffine3::from_translation(DVec3::new(100.0, 0.0, 0.0)));
    assert_eq!(far.energy, 0.0);
    assert_eq!(far.force, DVec3::ZERO);
}

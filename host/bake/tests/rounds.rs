//! Rounds and fillets answer by their surfaces in cells as large as their radii: smooth edges separate the faces that meet there.

mod common;

use std::f64::consts::FRAC_PI_2;
use std::ops::ControlFlow;

use common::*;
use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::{BakeOptions, ExactSurface, bake};
use mortise_brep::{Shape, Surface};
use mortise_haptics::{Vec3, rendered_distance};
use mortise_protocol::image::{SceneImage, patch_kind};
use proptest::prelude::*;

/// Chords of an arc of a profile: as fine as a modeller's.
const CHORDS: usize = 12;
const PLACES: usize = 4_000;
/// Error allowed at the surface, mm: two tenths of a micrometre of a rule's tests, and single precision at some centimetres.
const AT_SURFACE_MM: f64 = 4e-4;

/// A quarter of a circle of a profile, from one angle to another, without its end.
fn arc(center: [f64; 2], radius: f64, from: f64, to: f64, face: u32) -> impl Iterator<Item = ProfilePoint> {
    (0..CHORDS).map(move |i| {
        let angle = from + (to - from) * i as f64 / CHORDS as f64;
        (
            center[0] + radius * angle.cos(),
            center[1] + radius * angle.sin(),
            face,
        )
    })
}

/// A peg of these radius and height on a flange: a fillet where they meet, and a round at the peg's end.
fn filleted(radius: f64, height: f64, fillet: f64, round: f64) -> Shape {
    let (flange, thick) = (radius + fillet + 6.0, 4.0);
    let top = thick + height;
    let (hollow, end) = ([radius + fillet, thick + fillet], [radius - round, top - round]);
    let mut profile = vec![(0.0, 0.0, 0), (flange, 0.0, 1), (flange, thick, 2)];
    profile.extend(arc(hollow, fillet, -FRAC_PI_2, -2.0 * FRAC_PI_2, 3));
    profile.push((radius, hollow[1], 4));
    profile.extend(arc(end, round, 0.0, FRAC_PI_2, 5));
    profile.extend([(end[0], top, 6), (0.0, top, 6)]);
    let at = |z: f64, up: DVec3| frame_at(DVec3::Z * z, up);
    let tube = |[major, z]: [f64; 2], minor: f64| Surface::Torus {
        frame: at(z, DVec3::Z),
        major,
        minor,
    };
    let cylinder = |radius| Surface::Cylinder {
        frame: world(),
        radius,
    };
    let plane = |z, up| Surface::Plane { frame: at(z, up) };
    let surfaces = [
        (plane(0.0, -DVec3::Z), false),
        (cylinder(flange), false),
        (plane(thick, DVec3::Z), false),
        (tube(hollow, fillet), true),
        (cylinder(radius), false),
        (tube(end, round), false),
        (plane(top, DVec3::Z), false),
    ];
    revolve(&profile, false, &surfaces, 96)
}

/// Share of the places about `shape` whose distance is interpolated in cells of this size; at the others it has the right sign and no larger magnitude,
/// and is exact at the surface.
fn interpolated(shape: Shape, cell_mm: f64) -> f64 {
    let exact = ExactSurface::new(&shape);
    let vertices = shape.mesh.vertices.clone();
    let options = BakeOptions {
        cell_mm: Some(cell_mm),
        image_limit_bytes: 16 << 20,
        ..BakeOptions::default()
    };
    let model = model(vec![("part", shape, DAffine3::IDENTITY)]);
    let baked = bake(&model, &options, &|_| ControlFlow::Continue(())).expect("it bakes");
    let bytes = AlignedBytes::new(&baked.image);
    let image = SceneImage::open(bytes.bytes()).expect("it opens");
    let shape = image.shape(0);
    assert!(shape.patches.iter().all(|patch| patch.kind == patch_kind::SIDE));
    let mut count = 0;
    for i in 0..PLACES {
        let u = |step: f64| ((i as f64 + 0.5) * step).fract();
        let vertex = vertices[(u(0.754_877_666) * vertices.len() as f64) as usize];
        let aside = DVec3::new(u(0.569_840_291), u(0.430_159_709), u(0.324_717_957)) * 2.0 - 1.0;
        // A third of the places at the surface, by their feet.
        let near = vertex + aside * 0.3 * cell_mm;
        let p = match exact.nearest(near) {
            Some(foot) if i % 3 == 0 => foot.point + aside * 1e-4,
            _ => near,
        };
        let at = (p / 1000.0).as_vec3();
        let true_mm = exact.nearest(at.as_dvec3() * 1000.0).expect("a surface").distance;
        let Some(rendered) = rendered_distance(&shape, Vec3::from_array(at.to_array())) else {
            continue;
        };
        if rendered.interpolated {
            count += 1;
            continue;
        }
        let found = f64::from(rendered.distance) * 1000.0;
        let context = || format!("{found} for {true_mm} at {p} by {:?}", rendered.nearby);
        if true_mm.abs() < 2e-4 {
            assert!((found - true_mm).abs() <= AT_SURFACE_MM, "{}", context());
        } else {
            let small = found.abs() <= AT_SURFACE_MM;
            assert!(found * true_mm > 0.0 || small, "{}", context());
            assert!(found.abs() <= true_mm.abs() + AT_SURFACE_MM, "{}", context());
        }
    }
    count as f64 / PLACES as f64
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn surfaces_answer_at_rounds_and_fillets(
        radius in 6.0f64..12.0,
        height in 12.0f64..20.0,
        fillet in 1.0f64..4.0,
        round in 1.0f64..4.0,
        cell in 0.7f64..3.0,
        axis in prop::array::uniform3(-1.0f64..1.0),
        angle in 0.0f64..3.0,
    ) {
        let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::X);
        let turn = DAffine3::from_quat(DQuat::from_axis_angle(axis, angle));
        let shape = moved(&filleted(radius, height, fillet, round), turn);
        let share = interpolated(shape, cell);
        prop_assert!(share <= 0.01, "{share}");
    }
}

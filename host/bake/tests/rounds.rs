//! Rounds and fillets answer by their surfaces in cells as large as their radii: smooth edges separate the faces that meet there.

use std::f64::consts::FRAC_PI_2;
use std::ops::ControlFlow;

use crate::common::*;
use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::{BakeOptions, ExactSurface, bake};
use mortise_brep::{Shape, Surface};
use mortise_haptics::{Vec3, rendered_distance};
use mortise_protocol::image::{SceneImage, patch_kind};
use proptest::prelude::*;

/// Chords of an arc of a profile: as fine as a modeller's.
const CHORDS: usize = 12;
const PLACES: usize = 4_000;
/// Places where radii are less than the cells: rules fail in corners of few of these.
const MORE_PLACES: usize = 20_000;
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

/// Share of `places` about `shape` whose distance is interpolated in cells of this size; at the others it has the right sign and no larger magnitude,
/// and is exact at the surface.
fn interpolated(shape: Shape, cell_mm: f64, places: usize) -> f64 {
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
    for i in 0..places {
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
    count as f64 / places as f64
}

/// `shape` turned about an axis through the origin.
fn turned(shape: &Shape, axis: [f64; 3], angle: f64) -> Shape {
    let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::X);
    moved(shape, DAffine3::from_quat(DQuat::from_axis_angle(axis, angle)))
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
        let shape = turned(&filleted(radius, height, fillet, round), axis, angle);
        let share = interpolated(shape, cell, PLACES);
        prop_assert!(share <= 0.01, "{share}");
    }

    /// A round or fillet that does not enter a cell larger than its radius can still be nearest in a corner of the cell.
    #[test]
    fn surfaces_answer_in_cells_larger_than_the_radii(
        radius in 6.0f64..12.0,
        height in 12.0f64..20.0,
        fillet in 1.0f64..1.7,
        round in 1.0f64..1.7,
        cell in 2.0f64..3.0,
        axis in prop::array::uniform3(-1.0f64..1.0),
        angle in 0.0f64..3.0,
    ) {
        let shape = turned(&filleted(radius, height, fillet, round), axis, angle);
        let share = interpolated(shape, cell, MORE_PLACES);
        prop_assert!(share <= 0.01, "{share}");
    }
}

/// Members in which a lattice of tests leaves out the corners of cells where a round or fillet is nearest.
#[test]
fn surfaces_answer_in_corners_of_cells() {
    // Radius, height, fillet, round and cell; axis and angle of turning.
    let members = [
        (
            "10.984215998163261 12.829025789968604 1.0 1.3039372745892277 2.882879688188263",
            "-1 0 0 2.328195889760354",
        ),
        (
            "6.664135686121881 15.54195799678564 1.4517870605457575 1.3036027349997312 2.432942829094827",
            "0.7725005009987742 -0.3301573892330633 -0.5424380833712271 1.3862619940191507",
        ),
        (
            "8.377446200698614 13.233283810317516 1.1179601880721748 1.182671287516132 2.1521541494876146",
            "-0.3190533449673444 0.9372968066533425 -0.1402842090279429 0.74311912804842",
        ),
    ];
    let numbers = |text: &str| -> Vec<f64> {
        (text.split(' ').map(str::parse))
            .collect::<Result<_, _>>()
            .expect("numbers")
    };
    for (sizes, turn) in members {
        let ([radius, height, fillet, round, cell], [x, y, z, angle]) = (
            <[f64; 5]>::try_from(numbers(sizes)).expect("five sizes"),
            <[f64; 4]>::try_from(numbers(turn)).expect("an axis and an angle"),
        );
        let shape = turned(&filleted(radius, height, fillet, round), [x, y, z], angle);
        assert!(interpolated(shape, cell, MORE_PLACES) <= 0.01);
    }
}

//! Surfaces whose origin lies far from the shape, as some files have them, answer as accurately as others.

use std::ops::ControlFlow;

use crate::common::*;
use glam::{DAffine3, DVec3};
use mortise_bake::{BakeOptions, bake};
use mortise_brep::{Shape, Surface};
use mortise_haptics::{Vec3, rendered_distance};
use mortise_protocol::image::SceneImage;
use proptest::prelude::*;

/// The shape with the origins of its planes, cylinders and cones moved by `far` mm, along their axis or in their plane.
fn with_far_origins(mut shape: Shape, far: f64) -> Shape {
    for face in &mut shape.faces {
        match &mut face.surface {
            Surface::Plane { frame } => frame.origin += (frame.x + 0.3 * frame.y) * far,
            Surface::Cylinder { frame, .. } => frame.origin += frame.z * far,
            Surface::Cone {
                frame,
                radius,
                half_angle,
            } => {
                frame.origin += frame.z * far;
                *radius += far * half_angle.tan();
            }
            _ => {}
        }
    }
    shape
}

/// Largest error of the board's distance near the surface of a shape, mm, where surfaces give it exactly; `exact` is the closed form.
fn worst(shape: Shape, exact: impl Fn(DVec3) -> f64) -> f64 {
    let model = model(vec![("shape", shape, DAffine3::IDENTITY)]);
    let options = BakeOptions {
        cell_mm: Some(1.0),
        ..BakeOptions::default()
    };
    let baked = bake(&model, &options, &|_| ControlFlow::Continue(())).expect("it bakes");
    let mut words = vec![0u32; baked.image.len().div_ceil(4)];
    bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..baked.image.len()].copy_from_slice(&baked.image);
    let image = SceneImage::open(bytemuck::cast_slice(&words)).expect("just written");
    let shape = image.shape(0);
    let (mut worst, mut places) = (0.0f64, 0);
    for i in 0..40_000 {
        let r = |step: f64| ((f64::from(i) + 0.5) * step).fract() * 2.0 - 1.0;
        let at = (DVec3::new(r(0.819_173), r(0.671_044), r(0.549_700)) * 0.012 + DVec3::Z * 0.01).as_vec3();
        let true_mm = exact(at.as_dvec3() * 1000.0);
        // Inside, near the surface: there a convex edge's faces are exact.
        if !(-0.5..0.0).contains(&true_mm) {
            continue;
        }
        let found = rendered_distance(&shape, Vec3::from_array(at.to_array())).expect("in a cell");
        worst = worst.max((1000.0 * f64::from(found.distance) - true_mm).abs());
        places += 1;
    }
    assert!(places > 500, "{places}");
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_peg_answers_wherever_its_origins_are(exponent in 0.0f64..6.0, backward: bool) {
        let far = 10f64.powf(exponent) * if backward { -1.0 } else { 1.0 };
        let (radius, height) = (10.0, 20.0);
        let exact = |p: DVec3| (p.truncate().length() - radius).max(p.z - height).max(-p.z);
        let worst = worst(with_far_origins(peg(radius, height, 32), far), exact);
        prop_assert!(worst < 1e-3, "{worst} mm off with origins {far} mm away");
    }
}

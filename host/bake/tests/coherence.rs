//! What a tick keeps from earlier ones (bounds, faces, pairs of edges) changes no contact: a tick that begins anew renders the same.

use crate::common::*;
use glam::{DAffine3, DVec3, Quat, Vec3};
use mortise_bake::{BakeOptions, Grabbable, bake};
use mortise_brep::Shape;
use mortise_haptics::{Input, Pose, Settings, State, Twist, tick};
use mortise_protocol::image::SceneImage;
use proptest::prelude::*;
use std::ops::ControlFlow;

/// Moves a part by a hand and compares each tick with one that begins anew. Returns the number of ticks in which a contact pushed.
///
/// Candidates may differ: of a straight edge any place may be looked at that lies between two others.
fn compare(fixed: Shape, moving: Shape, at: DVec3, goals: &[([f32; 3], f32, u32)]) -> usize {
    let options = BakeOptions {
        cell_mm: Some(1.0),
        grabbable: Grabbable::All,
        ..BakeOptions::default()
    };
    let parts = vec![
        ("fixed", fixed, DAffine3::IDENTITY),
        ("moving", moving, DAffine3::from_translation(at)),
    ];
    let baked = bake(&model(parts), &options, &|_| ControlFlow::Continue(()));
    let image = baked.expect("it bakes").image;
    let image = AlignedBytes::new(&image);
    let scene = SceneImage::open(image.bytes()).expect("a scene");
    let mut settings = Settings::default();
    // Ample: where it runs out, what is found depends on what it takes.
    settings.contact.point_budget = 20_000;
    let mut kept = State::new();
    kept.load_scene(&scene);
    let mut handle = Pose::new((at / 1000.0).as_vec3(), Quat::IDENTITY);
    kept.grab(&scene, 1, &handle).expect("it is free");
    let mut touching = 0;
    for &(goal, angle, ticks) in goals {
        let step = (Vec3::from_array(goal) + (at / 1000.0).as_vec3() - handle.position) / ticks as f32;
        let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), angle / ticks as f32);
        for _ in 0..ticks {
            handle = Pose::new(handle.position + step, (turn * handle.orientation).normalize());
            let input = Input {
                handle,
                handle_twist: Twist {
                    linear: step * 1e3,
                    angular: Vec3::ZERO,
                },
                enabled: true,
            };
            let mut anew = kept.clone();
            anew.invalidate_coherence();
            let [a, b] = [&mut kept, &mut anew].map(|state| tick(state, &scene, &settings, &input));
            assert_eq!(a.work.contacts, b.work.contacts, "{input:?}");
            // Contacts are summed in another order.
            let off = a.object.position.distance(b.object.position);
            assert!(off < 1e-7, "{off} {input:?}");
            touching += usize::from(a.work.contacts > 0);
        }
    }
    touching
}

fn goals(reach: f32, down: f32) -> impl Strategy<Value = Vec<([f32; 3], f32, u32)>> {
    let place = (-reach..reach, -reach..reach, -down..reach).prop_map(|(x, y, z)| [x, y, z]);
    prop::collection::vec((place, -0.3f32..0.3, 5u32..200), 1..6)
}

/// Solids that reach at most 6 mm from their middle downwards or upwards.
fn solid() -> impl Strategy<Value = Shape> {
    let size = || 0.5f64..6.0;
    prop_oneof![
        (0.5f64..15.0, size(), size()).prop_map(|(x, y, z)| block(DVec3::new(x, y, z))),
        (size(), 0.5f64..6.0).prop_map(|(radius, height)| peg(radius, height, 48)),
        size().prop_map(|radius| sphere(radius, 48)),
        (1.0f64..3.0).prop_map(|minor| torus(2.0 * minor, minor, 48)),
        (size(), size()).prop_map(|(radius, height)| cone(radius, height, 48)),
        (1.0f64..6.0, size()).prop_map(|(radius, height)| block_with_hole([8.0, 9.0], height, radius, 48)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Straight edges that cross.
    #[test]
    fn of_crossed_bars(goals in goals(8e-3, 8e-3)) {
        let [along, across] = [DVec3::new(20.0, 1.5, 1.5), DVec3::new(1.5, 20.0, 1.5)];
        compare(block(along), block(across), DVec3::new(0.0, 0.0, 4.0), &goals);
    }

    /// Solids of any proportions, flat and round ones, and one with a hole.
    #[test]
    fn of_any_two(fixed in solid(), moving in solid(), goals in goals(10e-3, 14e-3)) {
        let above = DVec3::new(0.0, 0.0, 14.0);
        compare(fixed, moving, above, &goals);
    }

    /// Rims that run along each other, and cross when the peg tilts.
    #[test]
    fn of_a_peg_in_its_hole(goals in goals(1e-3, 9e-3)) {
        let plate = block_with_hole([15.0, 15.0], 10.0, 5.05, 48);
        compare(plate, peg(5.0, 12.0, 48), DVec3::new(0.0, 0.0, 11.0), &goals);
    }
}

/// A span whose middle is far and whose end is near: here one contact pushed where two did.
#[test]
fn a_long_edge_near_its_end_counts_as_near() {
    let [along, across] = [DVec3::new(20.0, 1.5, 1.5), DVec3::new(1.5, 20.0, 1.5)];
    let goals = [
        ([0.004_475_004_5, 0.0, 0.0], -0.205_478_39, 138),
        ([0.0, 0.0, -0.005_978_404], -0.131_781_46, 5),
    ];
    let touching = compare(block(along), block(across), DVec3::new(0.0, 0.0, 4.0), &goals);
    assert!(touching > 0);
}

/// The motions of bars press them on each other.
#[test]
fn bars_pressed_on_each_other_touch() {
    let [along, across] = [DVec3::new(20.0, 1.5, 1.5), DVec3::new(1.5, 20.0, 1.5)];
    let goals = [([0.0, 0.0, -3e-3], 0.1, 100), ([3e-3, 1e-3, -3e-3], -0.2, 100)];
    let touching = compare(block(along), block(across), DVec3::new(0.0, 0.0, 4.0), &goals);
    assert!(touching > 100, "{touching}");
}

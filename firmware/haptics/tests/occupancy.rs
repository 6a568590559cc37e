//! Voxmap contact: tangent planes against the closed form, and the voxmap's search against an exhaustive one.

use crate::support;
use std::sync::LazyLock;

use crate::support::hand::{Hand, run};
use crate::support::image::{Image, Voxmap};
use crate::support::solids::Solid;
use crate::support::{
    BLOCK_HALF, PEG_HALF, SLAB, axis_on_axis, box_of, hole_and_peg_in_voxels, slab_and_box_in_voxels,
};
use glam::{DQuat, DVec3};
use mortise_haptics::{GuidanceMethod, Input, Pose, Prober, Quat, Settings, State, Twist, Vec3, tick};
use mortise_protocol::image::Voxel;
use proptest::prelude::*;

/// Voxels that do not divide the slab: its top lies 0.1 mm over the middle of a voxel.
const CELL: f64 = 0.6e-3;
/// Error of single precision for positions of some 30 mm, in a few operations, m.
const ROUNDING_M: f64 = 3e-8;

/// Points along each side of the box.
const ACROSS: usize = 6;
/// Points of its lower face.
const POINTS: usize = ACROSS * ACROSS;
static FLAT: LazyLock<Image> = LazyLock::new(|| slab_and_box_in_voxels(CELL, 1e-3, ACROSS));
static SLAB_VOXELS: LazyLock<Voxmap> = LazyLock::new(|| Voxmap::of(&SLAB, CELL));
static HOLE: LazyLock<Image> = LazyLock::new(|| hole_and_peg_in_voxels(1e-3, 2e-3));

fn settings() -> Settings {
    Settings::default()
}

/// Height of the flat over the middle of its voxels, m.
fn above_the_middle(map: &Voxmap) -> f64 {
    let (voxel, center) = map.look_up([0.0, 0.0, SLAB.half[2]]);
    assert_eq!(voxel, Voxel::Surface);
    SLAB.half[2] - center[2]
}

/// A flat on a flat: the depth is measured from the middle of the voxel, wherever in it the surface lies.
#[test]
fn on_a_flat_the_depth_counts_from_the_middle_of_the_voxel() {
    let scene = FLAT.open();
    let above = above_the_middle(&SLAB_VOXELS);
    assert!(
        above.abs() > 0.05e-3,
        "the flat must not lie in the middle: {above}"
    );
    let mut prober = Prober::new();
    for true_depth in [-0.25e-3, -0.05e-3, 0.0, 0.05e-3, 0.12e-3] {
        // The box's middle over the slab's: 4 mm of slab, 5 mm of box.
        let z = 9e-3 - true_depth;
        let pose = Pose::new(Vec3::new(0.0, 0.0, z as f32), Quat::IDENTITY);
        let found = prober.probe(&scene, 1, 0, &pose, &settings().contact).unwrap();
        // In the surface's layer of voxels, and how far past its middle.
        let in_layer = (above - true_depth).abs() < 0.5 * CELL;
        let depth = true_depth - above;
        if in_layer && depth > 0.0 {
            assert_eq!(usize::from(found.contacts), POINTS, "{true_depth}");
            assert!(
                (f64::from(found.nearest.distance_m) + depth).abs() < ROUNDING_M,
                "{found:?}"
            );
            let force = POINTS as f64 * 200e3 * depth;
            assert!((f64::from(found.wrench.force.z) - force).abs() < POINTS as f64 * 200e3 * ROUNDING_M);
        } else {
            assert_eq!(found.contacts, 0, "{true_depth}: {found:?}");
            assert!(found.nearest.distance_m >= 0.0);
        }
    }
}

/// Position of a point of the box moved inward by this many metres, and its inward normal.
fn point_at(
    point: &support::solids::SurfacePoint,
    position: DVec3,
    turn: DQuat,
    inward_m: f64,
) -> (DVec3, DVec3) {
    let n = -(turn * DVec3::from_array(point.normal));
    (
        position + turn * DVec3::from_array(point.position) + inward_m * n,
        n,
    )
}

/// Every point's contact by the definition, in double precision: (inward normal, gap).
fn by_definition(map: &Voxmap, position: DVec3, turn: DQuat, inward_m: f64) -> Vec<(DVec3, f64)> {
    let points = box_of(ACROSS).points();
    points
        .iter()
        .filter_map(|point| {
            let (p, n) = point_at(point, position, turn, inward_m);
            let (voxel, center) = map.look_up(p.to_array());
            (voxel == Voxel::Surface).then(|| (n, (p - DVec3::from_array(center)).dot(n)))
        })
        .collect()
}

/// Whether a point lies so near to a voxel's side that single precision may assign it to the neighbour.
fn near_a_side(map: &Voxmap, position: DVec3, turn: DQuat, inward_m: f64) -> bool {
    box_of(ACROSS).points().iter().any(|point| {
        let p = point_at(point, position, turn, inward_m).0.to_array();
        (0..3).any(|a| {
            let g = (p[a] - map.origin[a]) / map.cell;
            (g - g.round()).abs() * map.cell < ROUNDING_M
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn contacts_are_those_of_the_definition(
        at in [-8e-3f64..8e-3, -8e-3f64..8e-3, 8.2e-3f64..9.6e-3],
        turn in [-0.08f64..0.08, -0.08f64..0.08, -3.0f64..3.0],
        shrinking in 0.0f32..1.0,
        shrunk in any::<bool>(),
    ) {
        let mut contact = settings().contact;
        contact.shrinking = if shrunk { shrinking } else { 0.0 };
        let inward_m = f64::from(contact.shrinking) * CELL;
        let (scene, map) = (FLAT.open(), &*SLAB_VOXELS);
        let (position, turn) = (DVec3::from_array(at), DQuat::from_scaled_axis(DVec3::from_array(turn)));
        prop_assume!(!near_a_side(map, position, turn, inward_m));
        let expected = by_definition(map, position, turn, inward_m);
        let pose = Pose::new(
            Vec3::from_array(position.as_vec3().to_array()),
            Quat::from_array(turn.as_quat().to_array()),
        );
        let mut prober = Prober::new();
        let found = prober.probe(&scene, 1, 0, &pose, &contact).unwrap();
        let touching: Vec<_> = expected.iter().filter(|(_, gap)| *gap < 0.0).collect();
        // Single precision may decide otherwise for a point within rounding of its plane.
        let sure = expected.iter().all(|(_, gap)| gap.abs() > ROUNDING_M);
        prop_assume!(sure);
        prop_assert_eq!(usize::from(found.contacts), touching.len());
        let sum: DVec3 = touching.iter().map(|(n, gap)| -*n * *gap).sum();
        let force = 200e3 * sum;
        let error = DVec3::from_array(found.wrench.force.to_array().map(f64::from)) - force;
        prop_assert!(error.length() <= 200e3 * ROUNDING_M * (1.0 + touching.len() as f64), "{}", error);
        let deepest = expected.iter().map(|e| e.1).fold(f64::INFINITY, f64::min);
        if deepest < 0.0 {
            prop_assert!((f64::from(found.nearest.distance_m) - deepest).abs() < ROUNDING_M);
            prop_assert!(found.nearest.in_band && !found.nearest.exact);
        } else {
            prop_assert!(found.nearest.distance_m >= 0.0 && !found.nearest.in_band && !found.nearest.exact);
        }
    }

    /// Advancement bounds change no result with voxmaps either.
    #[test]
    fn coherence_changes_nothing(
        goals in prop::collection::vec(([-6e-3f32..6e-3, -6e-3f32..6e-3, -25e-3f32..10e-3], 0.0f32..0.2, 1u32..80), 1..5),
        shrinking in prop::array::uniform4(0.0f32..1.0),
        explicit in any::<bool>(),
    ) {
        let scene = HOLE.open();
        let mut settings = settings();
        settings.contact.point_budget = 20_000;
        if explicit {
            settings.integrator = mortise_haptics::Integrator::Explicit;
        }
        let mut lazy = State::new();
        lazy.load_scene(&scene);
        lazy.grab(&scene, 1, &Pose::IDENTITY).unwrap();
        let mut eager = lazy.clone();
        let mut handle = Pose::IDENTITY;
        let mut saved = 0i64;
        for ((goal, angle, ticks), shrinking) in goals.into_iter().zip(shrinking) {
            settings.contact.shrinking = shrinking;
            let step = (Vec3::from_array(goal) - handle.position) / ticks as f32;
            let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), angle / ticks as f32);
            for _ in 0..ticks {
                handle = Pose::new(handle.position + step, (turn * handle.orientation).normalize());
                let input = Input {
                    handle,
                    handle_twist: Twist { linear: step * 1e3, angular: Vec3::ZERO },
                    enabled: true,
                };
                eager.invalidate_coherence();
                let a = tick(&mut lazy, &scene, &settings, &input);
                let b = tick(&mut eager, &scene, &settings, &input);
                prop_assert_eq!(&a.handle, &b.handle);
                prop_assert_eq!(&a.object, &b.object);
                prop_assert_eq!(a.work.candidates, b.work.candidates);
                saved += cost(&b.work) - cost(&a.work);
            }
        }
        prop_assert!(saved >= 0);
    }
}

/// Shrinking acts while a part is held: points move inward at once and outward at 10 mm/s, and the box comes to rest lower and higher by as much.
#[test]
fn shrinking_changes_while_a_part_lies_on_another() {
    let scene = FLAT.open();
    let mut settings = settings();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0, 0.0, 6e-3]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    hand.goal[2] = 2e-3;
    let mut rests = Vec::new();
    let mut fastest = 0.0f32;
    for shrinking in [0.0, 0.5, 1.0, 0.0] {
        settings.contact.shrinking = shrinking;
        let mut before = state.object().unwrap().0.position.z;
        run(&mut state, &scene, &settings, &mut hand, 1500, |_, _, out| {
            let Some(out) = out else { return };
            fastest = fastest.max((out.object.position.z - before) / settings.period_s);
            before = out.object.position.z;
        });
        rests.push(f64::from(state.object().unwrap().0.position.z));
    }
    println!("rests at {rests:?} m, rises at {fastest} m/s at most");
    // 36 points of 200 kN/m under at most 10 N: a depth of 1.4 µm, the same in all.
    for (rest, share) in rests.iter().zip([0.0, 0.5, 1.0, 0.0]) {
        assert!((rests[0] - rest - share * CELL).abs() < 3e-6, "{rests:?}");
    }
    // Points moving outward lift the box; a contact met at 10 mm/s may throw it off half as fast again.
    assert!(fastest < 0.015, "{fastest}");
}

/// Distance from the axis to which a hand presses a peg that is half in its hole of voxels, m: by the blend of the thesis, with a target of these
/// `caps` (times the usual ones), or none.
fn pressed_off_axis(caps: Option<f32>) -> f64 {
    let image = hole_and_peg_in_voxels(0.2e-3, 10e-3);
    let scene = image.open();
    let mut settings = settings();
    settings.guidance.method = GuidanceMethod::Thesis;
    settings.contact.point_budget = 20_000;
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0, 0.0, BLOCK_HALF + PEG_HALF - 10e-3]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    hand.goal[0] = 3e-3;
    for t in 0..30u16 {
        if let Some(caps) = caps {
            let mut target = axis_on_axis(t + 1, 200);
            (target.force_cap, target.torque_cap) = (caps * target.force_cap, caps * target.torque_cap);
            state.set_target(&target).unwrap();
        }
        run(&mut state, &scene, &settings, &mut hand, 50, |_, _, _| {});
    }
    f64::from(state.object().unwrap().0.position.x)
}

/// Voxels wedge a peg all round where there is 0.1 mm of clearance. The thesis' blend softens contacts of voxels of guided faces, even without the
/// constraint's spring: x = ½·e^(−θ/θ₀) + ½·e^(−d/d₀) is 1 on the axis, and the peg moves to where the clearance ends.
#[test]
fn contacts_of_guided_voxels_are_softened() {
    let [alone, unevaluated, hybrid] = [None, Some(0.0), Some(1.0)].map(pressed_off_axis);
    println!("{alone} m off alone, {unevaluated} m without the pull, {hybrid} m with it");
    assert!(alone < 5e-6, "{alone}");
    assert!(unevaluated > 50e-6 && unevaluated < 0.4e-3, "{unevaluated}");
    assert!(hybrid > 50e-6 && hybrid < unevaluated, "{unevaluated} {hybrid}");
}

/// The method's known failure: a peg that fits with 10 µm all round "touches", by as much as half a voxel.
#[test]
fn a_centred_peg_touches_where_it_does_not() {
    let image = hole_and_peg_in_voxels(20e-6, 15e-3);
    let scene = image.open();
    let pose = Pose::new(Vec3::new(0.0, 0.0, 10e-3), Quat::IDENTITY);
    let found = Prober::new()
        .probe(&scene, 1, 0, &pose, &settings().contact)
        .unwrap();
    assert!(found.contacts > 20, "{found:?}");
    assert!(found.nearest.distance_m < -0.05e-3, "{found:?}");
}

/// No point is faster than half a voxel a tick; otherwise it would pass through before it is detected.
#[test]
fn no_point_outruns_the_voxels() {
    let image = slab_and_box_in_voxels(CELL, 30e-3, 4);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    state.grab(&scene, 1, &Pose::IDENTITY).unwrap();
    let mut before = state.object().unwrap().0.position;
    let mut farthest = 0.0f32;
    for t in 1..40 {
        let input = Input {
            handle: Pose::new(Vec3::new(1e-3 * t as f32, 0.0, 0.0), Quat::IDENTITY),
            handle_twist: Twist {
                linear: Vec3::X,
                angular: Vec3::ZERO,
            },
            enabled: true,
        };
        let out = tick(&mut state, &scene, &settings(), &input);
        farthest = farthest.max((out.object.position - before).length());
        before = out.object.position;
    }
    let most = 0.5 * CELL as f32;
    assert!(farthest <= most * 1.0001 && farthest > 0.99 * most, "{farthest}");
}

/// Work in field queries, as the budget weighs it.
fn cost(work: &mortise_haptics::Work) -> i64 {
    i64::from(work.points) + 4 * i64::from(work.nodes)
}

//! Probe of parts that are not convex against closed forms: a peg about the hole of a block. Nothing is called exact that is off by over a micrometre,
//! every stated error holds, and a free pose has no contact. First touches along motions.

use std::ops::ControlFlow;

use crate::common::{AlignedBytes, block, block_with_hole, model, peg, sphere};
use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::{BakeOptions, Grabbable, bake};
use mortise_brep::Shape;
use mortise_haptics::{Course, Measure, Motion, Pose, Probe, Prober, Quat, Settings, Sweep, Vec3};
use mortise_protocol::image::{SHAPE_CONVEX, SceneImage};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// Error allowed of an exact answer, mm: a micrometre.
const EXACT_MM: f64 = 1e-3;
/// Overlaps that are shallower may be stated as unproven gaps, mm: edges are searched for deeper ones.
const SHALLOW_MM: f64 = 3e-3;
/// Gap at which a sweep ends, mm.
const TOUCH_MM: f64 = 1e-3;
/// Peg and hole, mm.
const PEG: f64 = 9.3;
const HOLE: f64 = 9.375;
const HEIGHT: f64 = 30.0;
const LENGTH: f64 = 20.0;

struct Scene {
    bytes: AlignedBytes,
}

impl Scene {
    fn new(moving: Shape, fixed: Shape, cell_mm: f64) -> Self {
        let parts = vec![
            ("moving", moving, DAffine3::IDENTITY),
            ("fixed", fixed, DAffine3::IDENTITY),
        ];
        let options = BakeOptions {
            grabbable: Grabbable::All,
            cell_mm: Some(cell_mm),
            image_limit_bytes: 64 << 20,
            ..BakeOptions::default()
        };
        let baked = bake(&model(parts), &options, &|_| ControlFlow::Continue(())).unwrap();
        Self {
            bytes: AlignedBytes::new(&baked.image),
        }
    }

    fn peg_and_block(cell_mm: f64) -> Self {
        let scene = Self::new(
            peg(PEG, LENGTH, 48),
            block_with_hole([25.0, 20.0], HEIGHT, HOLE, 48),
            cell_mm,
        );
        let image = SceneImage::open(scene.bytes.bytes()).unwrap();
        assert_eq!(image.shape_of_part(1).record.flags & SHAPE_CONVEX, 0);
        scene
    }

    fn probe(&self, at: DVec3, turn: DQuat) -> Probe {
        let scene = SceneImage::open(self.bytes.bytes()).unwrap();
        Prober::new()
            .probe(&scene, 0, 1, &pose(at, turn), &Settings::default().contact)
            .unwrap()
    }

    fn sweep(&self, at: DVec3, turn: DQuat, shift_mm: DVec3, turn_rad: DVec3) -> Sweep {
        let scene = SceneImage::open(self.bytes.bytes()).unwrap();
        let motion = Motion {
            shift: Vec3::from_array((shift_mm / 1000.0).as_vec3().to_array()),
            turn: Vec3::from_array(turn_rad.as_vec3().to_array()),
        };
        Prober::new()
            .sweep(
                &scene,
                [0, 1],
                &pose(at, turn),
                &motion,
                &Settings::default().contact,
            )
            .unwrap()
    }
}

fn pose(at: DVec3, turn: DQuat) -> Pose {
    let [x, y, z, w] = turn.as_quat().to_array();
    Pose::new(
        Vec3::from_array((at / 1000.0).as_vec3().to_array()),
        Quat::from_xyzw(x, y, z, w),
    )
}

fn runner(cases: u32) -> TestRunner {
    TestRunner::new_with_rng(
        Config {
            cases,
            failure_persistence: None,
            ..Config::default()
        },
        TestRng::deterministic_rng(RngAlgorithm::ChaCha),
    )
}

/// The answer keeps to its own error, and a free pose has no contact.
fn check(found: &Probe, truth: f64) -> Result<(), TestCaseError> {
    let nearest = found.nearest;
    let off = (1e3 * f64::from(nearest.distance_m) - truth).abs();
    prop_assert_eq!(nearest.measure, Measure::DeepestPoint);
    prop_assert!(off <= 1e3 * f64::from(nearest.error_m), "{} {:?}", truth, nearest);
    prop_assert!(!nearest.exact || off <= EXACT_MM, "{} {:?}", truth, nearest);
    if truth > EXACT_MM {
        prop_assert!(nearest.exact, "{} {:?}", truth, nearest);
        prop_assert_eq!(found.contacts, 0);
    } else if truth < -SHALLOW_MM {
        prop_assert!(nearest.distance_m < 0.0, "{} {:?}", truth, nearest);
    }
    Ok(())
}

/// A peg in its hole: the clearance less the offset aside, or where it is tilted about its middle less what its rims lean.
#[test]
fn peg_in_its_hole() {
    for cell_mm in [1.0, 4.0, 8.0] {
        let scene = Scene::peg_and_block(cell_mm);
        let middle = 0.5 * (HEIGHT - LENGTH);
        runner(200)
            .run(
                &(0.0f64..0.1, -3.1f64..3.1, -0.9f64..0.9),
                |(aside, angle, up)| {
                    let (sin, cos) = angle.sin_cos();
                    let at = DVec3::new(aside * cos, aside * sin, middle + up * middle);
                    check(&scene.probe(at, DQuat::IDENTITY), HOLE - PEG - aside)
                },
            )
            .unwrap();
        runner(100)
            .run(&(1e-4f64..0.01, -3.1f64..3.1), |(tilt, angle)| {
                let turn = DQuat::from_axis_angle(DVec3::new(angle.cos(), angle.sin(), 0.0), tilt);
                let at = DVec3::Z * 0.5 * HEIGHT - turn * DVec3::Z * 0.5 * LENGTH;
                // The rim's farthest point from the hole's axis.
                let reach = PEG * tilt.cos() + 0.5 * LENGTH * tilt.sin();
                check(&scene.probe(at, turn), HOLE - reach)
            })
            .unwrap();
    }
}

/// A peg over the block, far from the hole or above it, and beside the block, at any turn about its axis.
#[test]
fn peg_outside_the_block() {
    for cell_mm in [1.0, 8.0] {
        let scene = Scene::peg_and_block(cell_mm);
        runner(100)
            .run(
                &(0.01f64..30.0, -0.9f64..0.9, -3.1f64..3.1),
                |(gap, share, turn)| {
                    let turn = DQuat::from_rotation_z(turn);
                    let over = DVec3::new(13.0 * share.signum(), 8.0 * share, HEIGHT + gap);
                    check(&scene.probe(over, turn), gap)?;
                    let above = f64::hypot(gap, HOLE - PEG);
                    check(&scene.probe(DVec3::Z * (HEIGHT + gap), turn), above)?;
                    let beside = DVec3::new(25.0 + PEG + gap, 10.0 * share, 5.0 + 4.0 * share);
                    check(&scene.probe(beside, turn), gap)
                },
            )
            .unwrap();
    }
}

/// The course, and the share of the motion, are those of the closed form.
fn touches(found: &Sweep, share: f64, way_mm: f64) -> Result<(), TestCaseError> {
    prop_assert_eq!(found.course, Course::Touch);
    // Free before the touch, and no farther before it than twice the gap that ends a sweep; rounding of the pose besides.
    prop_assert!(found.share <= share + 1e-4 / way_mm, "{} {:?}", share, found);
    prop_assert!(
        found.share + found.error >= share - 1e-4 / way_mm,
        "{} {:?}",
        share,
        found
    );
    prop_assert!(found.error * way_mm <= 16.0 * TOUCH_MM, "{} {:?}", share, found);
    Ok(())
}

/// A ball falls onto a plate; a box onto a box, upright or on its edge.
#[test]
fn convex_parts_touch_where_they_meet() {
    let ball = Scene::new(sphere(5.0, 48), block(DVec3::new(31.0, 17.0, 1.0)), 4.0);
    let boxes = Scene::new(block(DVec3::splat(4.0)), block(DVec3::new(31.0, 17.0, 1.0)), 4.0);
    runner(100)
        .run(
            &(-0.9f64..0.9, 0.5f64..30.0, -1.0f64..1.0),
            |(aside, gap, slope)| {
                let down = gap + 2.0;
                let at = DVec3::new(20.0 * aside, 10.0 * aside, 6.0 + gap);
                let shift = DVec3::new(slope, 0.0, -down);
                touches(
                    &ball.sweep(at, DQuat::IDENTITY, shift, DVec3::ZERO),
                    gap / down,
                    shift.length(),
                )?;
                let at = DVec3::new(20.0 * aside, 8.0 * aside, 5.0 + gap);
                touches(
                    &boxes.sweep(at, DQuat::IDENTITY, shift, DVec3::ZERO),
                    gap / down,
                    shift.length(),
                )?;
                let turn = DQuat::from_rotation_x(0.25 * std::f64::consts::PI);
                let at = DVec3::new(20.0 * aside, 5.0 * aside, 1.0 + 4.0 * 2f64.sqrt() + gap);
                touches(
                    &boxes.sweep(at, turn, shift, DVec3::ZERO),
                    gap / down,
                    shift.length(),
                )?;
                let away = ball.sweep(at + DVec3::Z * 2.0, turn, -shift, DVec3::ZERO);
                prop_assert_eq!((away.course, away.share), (Course::Free, 1.0));
                Ok(())
            },
        )
        .unwrap();
}

/// A box turns about its own axis until its edge meets a plate.
#[test]
fn a_turning_box_touches_with_its_edge() {
    let boxes = Scene::new(block(DVec3::splat(4.0)), block(DVec3::new(31.0, 17.0, 1.0)), 4.0);
    runner(60)
        .run(&(0.05f64..1.5), |gap| {
            // The edge is at 4·√2·sin(45° + turn) below the middle.
            let touch = ((4.0 + gap) / (4.0 * 2f64.sqrt())).asin() - 0.25 * std::f64::consts::PI;
            let all = 0.25 * std::f64::consts::PI;
            let found = boxes.sweep(
                DVec3::Z * (5.0 + gap),
                DQuat::IDENTITY,
                DVec3::ZERO,
                DVec3::X * all,
            );
            touches(&found, touch / all, 4.0 * 3f64.sqrt() * all)
        })
        .unwrap();
}

/// A peg goes down its hole where the offset leaves a gap, else it meets the block's top.
#[test]
fn a_peg_goes_down_its_hole() {
    let scene = Scene::peg_and_block(2.0);
    for (aside, above) in [(0.0, 2.0), (0.05, 1.0), (0.07, 0.5)] {
        let at = DVec3::new(aside, 0.0, HEIGHT + above);
        let found = scene.sweep(at, DQuat::IDENTITY, DVec3::Z * -5.0, DVec3::ZERO);
        assert_eq!((found.course, found.share), (Course::Free, 1.0), "{found:?}");
        let gap = 1e3 * found.gap_m;
        assert!((gap - (HOLE - PEG - aside)).abs() < EXACT_MM, "{found:?}");
    }
    for (aside, above) in [(0.5, 2.0), (3.0, 1.0), (0.1, 0.3)] {
        let at = DVec3::new(aside, 0.0, HEIGHT + above);
        let found = scene.sweep(at, DQuat::IDENTITY, DVec3::Z * -5.0, DVec3::ZERO);
        touches(&found, above / 5.0, 5.0).unwrap();
    }
    // Across the hole to its wall.
    let at = DVec3::new(0.0, 0.0, 5.0);
    let found = scene.sweep(at, DQuat::IDENTITY, DVec3::X, DVec3::ZERO);
    touches(&found, HOLE - PEG, 1.0).unwrap();
    let inside = scene.sweep(DVec3::X * 2.0, DQuat::IDENTITY, DVec3::X, DVec3::ZERO);
    assert_eq!((inside.course, inside.share), (Course::Touch, 0.0));
}

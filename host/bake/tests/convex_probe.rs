//! Probe of convex pairs against closed forms: boxes by separating axes, box and ball by the distance to the box, cylinders side by side and crosswise.

use crate::common;
use std::cell::RefCell;
use std::ops::ControlFlow;

use crate::common::{AlignedBytes, block, box_distance, model, peg, sphere};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_bake::{BakeOptions, Grabbable, bake};
use mortise_brep::Shape;
use mortise_haptics::{Measure, Pose, Probe, Prober, Quat, Settings, Vec3};
use mortise_protocol::image::{SHAPE_CONVEX, SceneImage};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// Error allowed of an exact answer, mm: a micrometre.
const EXACT_MM: f64 = 1e-3;

struct Scene {
    bytes: AlignedBytes,
}

impl Scene {
    fn new(moving: Shape, fixed: Shape) -> Self {
        let parts = vec![
            ("moving", moving, DAffine3::IDENTITY),
            ("fixed", fixed, DAffine3::IDENTITY),
        ];
        let options = BakeOptions {
            grabbable: Grabbable::All,
            // The answers come from faces and edges: the field may be coarse.
            cell_mm: Some(10.0),
            image_limit_bytes: 16 << 20,
            ..BakeOptions::default()
        };
        let baked = bake(&model(parts), &options, &|_| ControlFlow::Continue(())).unwrap();
        Self {
            bytes: AlignedBytes::new(&baked.image),
        }
    }

    fn probe(&self, prober: &mut Prober, at: DVec3, turn: DQuat) -> Probe {
        let scene = SceneImage::open(self.bytes.bytes()).unwrap();
        let [x, y, z, w] = turn.as_quat().to_array();
        let pose = Pose::new(
            Vec3::from_array((at / 1000.0).as_vec3().to_array()),
            Quat::from_xyzw(x, y, z, w),
        );
        prober
            .probe(&scene, 0, 1, &pose, &Settings::default().contact)
            .unwrap()
    }
}

/// Largest separation of two boxes over all axes, mm: negative is the smallest translation that separates; positive is a lower bound of the gap.
fn separating_axes(a: DVec3, b: DVec3, at: DVec3, turn: DQuat) -> f64 {
    let m = DMat3::from_quat(turn);
    let mut axes: Vec<DVec3> = DVec3::AXES
        .into_iter()
        .chain(m.to_cols_array_2d().map(DVec3::from_array))
        .collect();
    for u in DVec3::AXES {
        for v in [m.x_axis, m.y_axis, m.z_axis] {
            let w = u.cross(v);
            if w.length() > 1e-9 {
                axes.push(w.normalize());
            }
        }
    }
    let reach = |half: DVec3, n: DVec3| (half * n.abs()).element_sum();
    (axes.into_iter())
        .map(|n| at.dot(n).abs() - reach(a, m.transpose() * n) - reach(b, n))
        .fold(f64::NEG_INFINITY, f64::max)
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

fn directions() -> impl Strategy<Value = (DVec3, DQuat)> {
    (
        prop::array::uniform3(-1.0f64..1.0),
        prop::array::uniform4(-1.0f64..1.0),
    )
        .prop_filter("long enough", |(d, q)| {
            DVec3::from_array(*d).length() > 0.1 && DQuat::from_array(*q).length() > 0.1
        })
        .prop_map(|(d, q)| (DVec3::from_array(d).normalize(), DQuat::from_array(q).normalize()))
}

/// The answer is exact, within its own bound and a micrometre of `truth`, and its contacts are those of its sign.
fn check(found: &Probe, truth: f64) -> Result<(), TestCaseError> {
    let nearest = found.nearest;
    let error = (1e3 * f64::from(nearest.distance_m) - truth).abs();
    prop_assert!(nearest.exact, "{:?}", nearest);
    prop_assert!(
        error <= 1e3 * f64::from(nearest.error_m) && error <= EXACT_MM,
        "{} {:?}",
        truth,
        nearest
    );
    prop_assert_eq!(nearest.measure, Measure::Translation);
    if truth > EXACT_MM {
        prop_assert_eq!(found.contacts, 0);
    } else if truth < -EXACT_MM {
        prop_assert!(found.contacts > 0);
    }
    Ok(())
}

/// Boxes of any aspect ratio to 1 : 200, near touching: the sign and the depth are those of the separating axes, the gap is no smaller than theirs.
#[test]
fn boxes() {
    let prober = RefCell::new(Prober::new());
    let side = || {
        prop::array::uniform3(-0.6f64..2.0).prop_map(|e| DVec3::from_array(e.map(|e| 0.5 * 10f64.powf(e))))
    };
    runner(40)
        .run(
            &(
                side(),
                side(),
                prop::collection::vec((directions(), -0.5f64..0.5), 150),
            ),
            |(a, b, poses)| {
                let scene = Scene::new(block(a), block(b));
                for ((direction, turn), past) in poses {
                    // Along a direction the separation rises to zero where the boxes touch.
                    let (mut near, mut far) = (0.0, 2.0 * (a.length() + b.length()));
                    for _ in 0..60 {
                        let middle = 0.5 * (near + far);
                        if separating_axes(a, b, direction * middle, turn) < 0.0 {
                            near = middle;
                        } else {
                            far = middle;
                        }
                    }
                    let at = direction * (far + past);
                    let truth = separating_axes(a, b, at, turn);
                    let found = scene.probe(&mut prober.borrow_mut(), at, turn);
                    if truth < 0.0 {
                        check(&found, truth)?;
                    } else {
                        let gap = 1e3 * f64::from(found.nearest.distance_m);
                        prop_assert!(gap >= truth - EXACT_MM, "{} {:?}", truth, found.nearest);
                        check(&found, gap)?;
                    }
                }
                Ok(())
            },
        )
        .unwrap();
}

/// A ball and a box, down to a plate of 0.2 mm: outside the distance to the box, inside the way out through a face, less the radius.
#[test]
fn ball_and_box() {
    let prober = RefCell::new(Prober::new());
    let half = DVec3::new(31.0, 17.0, 0.1);
    let scene = Scene::new(sphere(5.0, 48), block(half));
    runner(2000)
        .run(
            &(prop::array::uniform3(-1.3f64..1.3), directions()),
            |(at, (_, turn))| {
                let at = DVec3::from_array(at) * (half + DVec3::splat(4.0));
                let truth = box_distance(-half, half, at) - 5.0;
                check(&scene.probe(&mut prober.borrow_mut(), at, turn), truth)
            },
        )
        .unwrap();
}

/// Cylinders crosswise at any angle, and side by side: the distance of their axes less the radii, as far as the ends are away.
#[test]
fn cylinders() {
    let prober = RefCell::new(Prober::new());
    let (long, wide, narrow) = (60.0, 4.0, 1.5);
    let scene = Scene::new(peg(wide, long, 64), peg(narrow, long, 48));
    runner(2000)
        .run(
            &(0.3f64..2.8, -5.0f64..5.0, -1.0f64..0.5),
            |(angle, along, gap)| {
                // Both axes run along z from 0: the held one is turned about x, its middle moved over the other one's.
                let turn = DQuat::from_rotation_x(angle);
                let at =
                    DVec3::new(wide + narrow + gap, 0.0, 0.5 * long) - turn * DVec3::Z * (0.5 * long + along);
                check(&scene.probe(&mut prober.borrow_mut(), at, turn), gap)
            },
        )
        .unwrap();
}

/// A block with a hole is not convex, and its pair is measured otherwise.
#[test]
fn a_hole_is_not_convex() {
    let scene = Scene::new(
        peg(4.0, 20.0, 48),
        common::block_with_hole([25.0, 20.0], 30.0, 9.375, 48),
    );
    let image = SceneImage::open(scene.bytes.bytes()).unwrap();
    assert_ne!(image.shape_of_part(0).record.flags & SHAPE_CONVEX, 0);
    assert_eq!(image.shape_of_part(1).record.flags & SHAPE_CONVEX, 0);
    let found = scene.probe(&mut Prober::new(), DVec3::Z * 40.0, DQuat::IDENTITY);
    assert_eq!(found.nearest.measure, Measure::DeepestPoint);
}

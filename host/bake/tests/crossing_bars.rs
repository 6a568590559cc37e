//! Thin bars laid crosswise do not pass through each other, whatever their width, the angle between them, and the hand's motion.
//!
//! Oracle: the separating axes of two boxes, in double precision.

mod common;

use common::*;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_bake::{BakeOptions, bake};
use mortise_haptics::{Input, Pose, Quat, Settings, State, Twist, Vec3, tick};
use mortise_protocol::image::SceneImage;
use proptest::test_runner::{Config, TestRunner};
use std::ops::ControlFlow;

/// Length of the bars, mm.
const LENGTH: f64 = 200.0;
/// Deepest overlap allowed under 10 N, mm: 10 N on the contact stiffness is 0.05 mm.
const DEEPEST: f64 = 0.05;

/// Gap of two boxes along the best separating axis, mm; minus the least translation that separates them where they overlap.
fn separation(half: DVec3, [a, b]: [DAffine3; 2]) -> f64 {
    let (ra, rb) = (a.matrix3, b.matrix3);
    let apart = b.translation - a.translation;
    let axes = |r: DMat3| [r.x_axis, r.y_axis, r.z_axis];
    let reach = |r: DMat3, n: DVec3| {
        axes(r)
            .iter()
            .zip(half.to_array())
            .map(|(x, h)| x.dot(n).abs() * h)
            .sum::<f64>()
    };
    let crossed = axes(ra).into_iter().flat_map(|x| axes(rb).map(|y| x.cross(y)));
    let all = axes(ra).into_iter().chain(axes(rb)).chain(crossed);
    all.filter_map(|n| (n.length() > 1e-6).then(|| n.normalize()))
        .map(|n| apart.dot(n).abs() - reach(ra, n) - reach(rb, n))
        .fold(f64::NEG_INFINITY, f64::max)
}

/// A hand's motion over the crossing.
#[derive(Clone, Copy, Debug)]
struct Motion {
    width: f64,
    /// Angle between the bars, and tilts of the upper one, rad.
    angle: f64,
    tilt: [f64; 2],
    /// Place of the crossing along each bar, mm.
    places: [f64; 2],
    /// Speed at which the hand comes down, m/s.
    speed: f64,
    /// Amplitudes of the hand's slide, mm, and roll, rad, after the landing.
    slide: [f64; 2],
    roll: f64,
}

/// Deepest overlap while the hand presses with 10 N, slides and rolls; and whether the upper bar ended on its side.
fn play(motion: &Motion) -> (f64, bool) {
    let half = DVec3::new(LENGTH, motion.width, motion.width) / 2.0;
    let bar = block(half);
    let turn = DQuat::from_rotation_z(motion.angle)
        * DQuat::from_rotation_y(motion.tilt[0])
        * DQuat::from_rotation_x(motion.tilt[1]);
    let start = DVec3::new(motion.places[0], 0.0, 0.0) - turn * DVec3::X * motion.places[1];
    let high = half.y * 3.0 + motion.places[1].abs() * motion.tilt[0].abs() + 1.0;
    let upper = DAffine3::from_rotation_translation(turn, start + DVec3::Z * high);
    let model = model(vec![
        ("lower", bar.clone(), DAffine3::IDENTITY),
        ("upper", bar, upper),
    ]);
    let baked = bake(&model, &BakeOptions::default(), &|_| ControlFlow::Continue(())).expect("bars bake");
    let words: Vec<u32> = baked
        .image
        .chunks(4)
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    let scene = SceneImage::open(bytemuck::cast_slice(&words)).expect("a scene");
    let settings = Settings::default();
    let mut state = State::new();
    state.load_scene(&scene);
    let at = |p: DVec3| (p / 1000.0).as_vec3();
    let place = |p: DVec3, q: DQuat| {
        Pose::new(
            Vec3::from_array(at(p).to_array()),
            Quat::from_array(q.as_quat().to_array()),
        )
    };
    let mut handle = place(upper.translation, turn);
    state.grab(&scene, 1, &handle).expect("it may be grabbed");
    let stretch = 10.0 / f64::from(settings.coupling.k_t_n_per_m) * 1000.0;
    let low = start.z + 0.5 * motion.width - half.y * 2.0 - stretch;
    let mut deepest = 0.0f64;
    for t in 0..3000 {
        let time = f64::from(t) * 1e-3;
        let z = (upper.translation.z - motion.speed * 1000.0 * time).max(low);
        let phase = (time - 0.5).max(0.0) * 6.0;
        let slide = DVec3::new(motion.slide[0], motion.slide[1], 0.0) * phase.sin();
        let rolled = turn * DQuat::from_rotation_x(motion.roll * (1.3 * phase).sin());
        let next = place(DVec3::new(start.x, start.y, z) + slide, rolled);
        let turned = next.orientation * handle.orientation.conjugate();
        let twist = Twist {
            linear: (next.position - handle.position) * 1000.0,
            angular: turned.to_scaled_axis() * 1000.0,
        };
        handle = next;
        let input = Input {
            handle,
            handle_twist: twist,
            enabled: true,
        };
        let out = tick(&mut state, &scene, &settings, &input);
        let (p, q) = (out.object.position, out.object.orientation);
        let object = DAffine3::from_rotation_translation(
            DQuat::from_array(q.to_array().map(f64::from)).normalize(),
            DVec3::from_array(p.to_array().map(f64::from)) * 1000.0,
        );
        let gap = separation(half, [DAffine3::IDENTITY, object]);
        deepest = deepest.min(gap);
    }
    let (object, _) = state.object().expect("in hand");
    (-deepest, object.position.z > 0.0)
}

#[test]
fn crossing_bars_stay_apart() {
    let mut runner = TestRunner::new(Config {
        cases: 24,
        ..Config::default()
    });
    let strategy = (
        proptest::sample::select(vec![1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 20.0]),
        0.35f64..2.79,
        [-0.03f64..0.03, -0.7f64..0.7],
        [-60.0f64..60.0, -60.0f64..60.0],
        0.02f64..0.3,
        [-3.0f64..3.0, -3.0f64..3.0],
        0.0f64..0.4,
    );
    let worst = std::cell::Cell::new(0.0f64);
    runner
        .run(&strategy, |(width, angle, tilt, places, speed, slide, roll)| {
            let motion = Motion {
                width,
                angle,
                tilt,
                places,
                speed,
                slide,
                roll,
            };
            let (depth, above) = play(&motion);
            worst.set(worst.get().max(depth));
            println!("{width} mm: {depth:.4} mm {above} {motion:?}");
            proptest::prop_assert!(above, "passed through");
            proptest::prop_assert!(depth <= DEEPEST, "{} mm deep", depth);
            Ok(())
        })
        .expect("bars stay apart");
    println!("deepest {:.4} mm", worst.get());
}

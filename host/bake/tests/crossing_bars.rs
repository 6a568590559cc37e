//! Thin bars laid crosswise do not pass through each other, whatever their width, the angle between them, and the hand's motion.
//!
//! Oracle: the separating axes of two boxes, in double precision.

use crate::common::*;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_bake::{BakeOptions, bake};
use mortise_haptics::{Input, Pose, Quat, Settings, State, Twist, Vec3, tick};
use mortise_protocol::image::SceneImage;
use proptest::test_runner::{Config, TestRunner};
use std::ops::ControlFlow;

/// Length of the bars, mm.
const LENGTH: f64 = 200.0;
/// Force of the hand, N.
const PRESS_N: f64 = 9.5;
/// Deepest overlap allowed under it, mm: on one contact of 200 kN/m it is 0.0475 mm at rest, and a tenth more as the bar lands.
const DEEPEST: f64 = 0.053;
/// Further overlap as the hand lands, mm per m/s: a tenth of what 0.1 kg would sink into one undamped contact.
const LANDING: f64 = 0.07;

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
    all.filter(|n| n.length() > 1e-6)
        .map(DVec3::normalize)
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

/// Height of the second bar's axis over the first's along their common perpendicular, mm, of either sign; `None` where the axes cross beyond an end.
fn side([a, b]: [DAffine3; 2]) -> Option<f64> {
    let (d, e) = (a.matrix3.x_axis, b.matrix3.x_axis);
    let n = d.cross(e);
    let apart = b.translation - a.translation;
    let t = apart.cross(e).dot(n) / n.length_squared();
    let s = apart.cross(d).dot(n) / n.length_squared();
    (t.abs().max(s.abs()) < LENGTH / 2.0).then(|| apart.dot(n.normalize()))
}

/// Deepest overlap while the hand presses, slides and rolls; and whether one bar passed through the other.
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
    let stretch = PRESS_N / f64::from(settings.coupling.k_t_n_per_m) * 1000.0;
    let low = start.z + 0.5 * motion.width - half.y * 2.0 - stretch;
    let (mut deepest, mut passed, mut before) = (0.0f64, false, None);
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
        let pair = [DAffine3::IDENTITY, object];
        deepest = deepest.min(separation(half, pair));
        let now = side(pair);
        passed |= before.zip(now).is_some_and(|(a, b): (f64, f64)| a * b < 0.0);
        before = now;
    }
    (-deepest, passed)
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
            let (depth, passed) = play(&motion);
            worst.set(worst.get().max(depth));
            proptest::prop_assert!(!passed, "passed through");
            proptest::prop_assert!(depth <= DEEPEST + LANDING * speed, "{} mm deep", depth);
            Ok(())
        })
        .expect("bars stay apart");
    println!("deepest of all: {:.4} mm", worst.get());
}

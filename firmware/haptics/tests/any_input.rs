//! Any input: never a force above its limit, never a non-finite number, never a panic.

use crate::support;
use std::sync::LazyLock;

use crate::support::image::Image;
use mortise_haptics::{Flags, Input, Integrator, Pose, Quat, Settings, State, Twist, Vec3, Wrench, tick};
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;

/// Diametral clearances of [`scene_of`], m.
const CLEARANCES: [f64; 3] = [20e-6, 0.1e-3, 1e-3];

/// Scene of the `i`th clearance, created once.
fn scene_of(i: usize) -> &'static Image {
    static SCENES: [LazyLock<Image>; 3] = [
        LazyLock::new(|| support::hole_and_peg(CLEARANCES[0], 2e-3)),
        LazyLock::new(|| support::hole_and_peg(CLEARANCES[1], 2e-3)),
        LazyLock::new(|| support::hole_and_peg(CLEARANCES[2], 2e-3)),
    ];
    &SCENES[i]
}

static SCENE: LazyLock<Image> = LazyLock::new(|| support::hole_and_peg(0.1e-3, 5e-3));
static VOXELS: LazyLock<Image> = LazyLock::new(|| support::hole_and_peg_in_voxels(0.1e-3, 5e-3));

/// Mostly ordinary numbers, sometimes absurd ones.
fn number(scale: f32) -> impl Strategy<Value = f32> {
    prop_oneof![
        12 => -scale..scale,
        1 => prop_oneof![
            Just(f32::NAN), Just(f32::INFINITY), Just(f32::NEG_INFINITY), Just(f32::MAX), Just(f32::MIN_POSITIVE),
            Just(-0.0f32), Just(1e-42f32), Just(1e20f32), Just(-99.9f32),
        ],
    ]
}

fn vector(scale: f32) -> impl Strategy<Value = Vec3> {
    [number(scale), number(scale), number(scale)].prop_map(Vec3::from_array)
}

fn rotation() -> impl Strategy<Value = Quat> {
    prop_oneof![
        6 => [-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0, 0.01f32..1.0]
            .prop_map(|a| Quat::from_array(a).normalize()),
        6 => [-0.05f32..0.05, -0.05f32..0.05, -0.05f32..0.05, 0.99f32..1.0]
            .prop_map(|a| Quat::from_array(a).normalize()),
        1 => [number(1.0), number(1.0), number(1.0), number(1.0)].prop_map(Quat::from_array),
    ]
}

fn input() -> impl Strategy<Value = Input> {
    (
        vector(0.03),
        rotation(),
        vector(2.0),
        vector(20.0),
        prop::bool::weighted(0.9),
    )
        .prop_map(|(position, orientation, linear, angular, enabled)| Input {
            handle: Pose::new(position, orientation),
            handle_twist: Twist { linear, angular },
            enabled,
        })
}

fn settings() -> impl Strategy<Value = Settings> {
    (
        prop_oneof![Just(20e3f32), Just(200e3), Just(2e6), Just(10e6)],
        0.0f32..20e3,
        0.0f32..200.0,
        0.0f32..15.0,
        0.0f32..1.0,
        100.0f32..1e5,
        16u32..3000,
        prop_oneof![Just(Integrator::Implicit), Just(Integrator::Explicit)],
    )
        .prop_map(|(k, k_t, b_t, force, torque, slew, budget, integrator)| {
            let mut s = Settings {
                integrator,
                ..Settings::default()
            };
            s.contact.stiffness_n_per_m = k;
            s.coupling.k_t_n_per_m = k_t;
            s.coupling.b_t = b_t;
            s.limits.force_n = force;
            s.limits.torque_nm = torque;
            s.limits.force_slew_n_per_s = slew;
            s.contact.point_budget = budget;
            assert_eq!(s.validate(), Ok(()));
            s
        })
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..ProptestConfig::default()
    })]

    #[test]
    fn stays_within_limits(
        settings in settings(),
        inputs in prop::collection::vec(input(), 1..60),
        voxels in prop::bool::weighted(0.3),
    ) {
        let scene = if voxels { VOXELS.open() } else { SCENE.open() };
        let mut state = State::new();
        state.load_scene(&scene);
        prop_assert_eq!(state.grab(&scene, 1, &Pose::IDENTITY), Ok(()));
        let mut before = Wrench::ZERO;
        for input in &inputs {
            let out = tick(&mut state, &scene, &settings, input);
            prop_assert!(out.handle.is_finite());
            prop_assert!(out.handle.force.length() <= settings.limits.force_n);
            prop_assert!(out.handle.torque.length() <= settings.limits.torque_nm);
            let slew = settings.limits.force_slew_n_per_s * settings.period_s;
            let cut_off = !input.enabled || out.work.flags.intersects(Flags::BAD_INPUT);
            // Falling to zero is allowed at once; the tolerance is the rounding of a sum of forces of 15 N.
            prop_assert!(cut_off || (out.handle.force - before.force).length() <= slew + 4e-6);
            before = out.handle;
            if cut_off {
                prop_assert_eq!(out.handle, Wrench::ZERO);
            }
            prop_assert!(out.contact.is_finite() && out.object.is_finite() && out.object_twist.is_finite());
            prop_assert!((out.object.orientation.length() - 1.0).abs() < 1e-5);
            prop_assert!(out.work.nodes + out.work.points <= settings.contact.point_budget);
            prop_assert!(!out.work.flags.contains(Flags::NON_FINITE));
            prop_assert!(out.pairs.windows(2).all(|p| p[0].depth_m >= p[1].depth_m));
            let (object, twist) = state.object().unwrap();
            prop_assert!(object.is_finite() && twist.is_finite());
        }
    }

    /// Advancement bounds change no result: the same bits with every node queried every tick.
    #[test]
    fn coherence_changes_nothing(
        clearance in 0..CLEARANCES.len(),
        goals in prop::collection::vec(([-6e-3f32..6e-3, -6e-3f32..6e-3, -25e-3f32..10e-3], 0.0f32..0.2, 1u32..80), 1..6),
    ) {
        let scene = scene_of(clearance).open();
        let mut settings = Settings::default();
        settings.contact.point_budget = 20_000;
        let start = state_of(&scene);
        let (mut lazy, mut eager) = (start.clone(), start);
        let mut handle = Pose::IDENTITY;
        let mut saved = 0i64;
        for (goal, angle, ticks) in goals {
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
                prop_assert_eq!(&a.pairs, &b.pairs);
                prop_assert_eq!(a.work.candidates, b.work.candidates);
                saved += cost(&b.work) - cost(&a.work);
            }
        }
        prop_assert!(saved >= 0);
    }
}

fn state_of(scene: &mortise_protocol::image::SceneImage<'_>) -> State {
    let mut state = State::new();
    state.load_scene(scene);
    state.grab(scene, 1, &Pose::IDENTITY).expect("the peg is free");
    state
}

#[test]
fn settings_that_are_not_numbers_push_nothing() {
    let scene = SCENE.open();
    let input = Input {
        handle: Pose::new(Vec3::new(1e-3, 0.0, 0.0), Quat::IDENTITY),
        handle_twist: Twist::ZERO,
        enabled: true,
    };
    let spoil: [fn(&mut Settings); 8] = [
        |s| s.coupling.k_t_n_per_m = f32::NAN,
        |s| s.coupling.force_max_n = f32::NAN,
        |s| s.contact.stiffness_n_per_m = f32::INFINITY,
        |s| s.contact.margin_m = f32::NAN,
        |s| s.object.mass_kg = f32::NAN,
        |s| s.object.gyration_max_m = f32::NAN,
        |s| s.limits.force_n = f32::NAN,
        |s| s.period_s = f32::NAN,
    ];
    for (i, spoil) in spoil.iter().enumerate() {
        let mut state = state_of(&scene);
        let mut settings = Settings::default();
        spoil(&mut settings);
        assert!(settings.validate().is_err(), "{i}");
        for _ in 0..20 {
            let out = tick(&mut state, &scene, &settings, &input);
            assert!(out.handle.is_finite() && out.object.is_finite(), "{i}: {out:?}");
            assert!(out.handle.force.length() <= 12.0, "{i}: {out:?}");
        }
        // With valid settings it continues as before.
        let out = tick(&mut state, &scene, &Settings::default(), &input);
        assert!(
            out.handle.is_finite() && out.handle.force.length() > 0.0,
            "{i}: {out:?}"
        );
    }
}

/// Work in field queries, as the budget weighs it.
fn cost(work: &mortise_haptics::Work) -> i64 {
    i64::from(work.points) + 4 * i64::from(work.nodes)
}

//! Dry friction: the angle at which a part slips, rest below it, energy, and no trace of it when it is off.

use crate::support;
use crate::support::hand::{Hand, run};
use mortise_haptics::{Flags, FrictionSettings, Input, Pose, Quat, Settings, State, Twist, Vec3, tick};

fn rough(kinetic: f32, fixed: f32) -> Settings {
    let mut settings = Settings::default();
    settings.friction = FrictionSettings {
        kinetic,
        fixed,
        ..settings.friction
    };
    settings
}

/// A box on a slab under a force of `force_n` that leans by `angle` from the slab's normal: as on an incline under its weight. How far it went along
/// the slab in a time, m, and whether every step settled.
///
/// The handle is led so that the coupling keeps its stretch, and with it the force.
fn on_an_incline(settings: &Settings, force_n: f32, angle: f32, ticks: u32) -> (f32, bool) {
    let image = support::slab_and_box(0.0, 9);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let (start, _) = {
        state.grab(&scene, 1, &Pose::default()).expect("grabbable");
        state.object().expect("in hand")
    };
    let stretch = force_n / settings.coupling.k_t_n_per_m;
    let (mut travelled, mut settled) = (0.0, true);
    for t in 0..ticks {
        let (pose, twist) = state.object().expect("in hand");
        // The weight first, then the slope, so that the box lies before it can slip.
        let lean = if t < 100 { 0.0 } else { angle };
        let pull = Vec3::new(libm::sinf(lean), 0.0, -libm::cosf(lean)) * stretch;
        let input = Input {
            handle: Pose::new(pose.position - start.position + pull, Quat::IDENTITY),
            handle_twist: Twist {
                linear: twist.linear,
                angular: Vec3::ZERO,
            },
            enabled: true,
        };
        let out = tick(&mut state, &scene, settings, &input);
        settled &= !out.work.flags.contains(Flags::UNSETTLED);
        travelled = out.object.position.x - start.position.x;
        if travelled > 5e-3 {
            break;
        }
    }
    (travelled, settled)
}

/// The steepest angle at which the box still rests: it goes no farther than 5 mm in a time in which a force 0.5 % above friction would move it by
/// 20 mm, ½·0.005·μ·F/m·t²; creeping, at 1 % below, it goes 2 mm.
fn slip_angle(settings: &Settings, force_n: f32) -> f32 {
    let friction_n = settings.friction.fixed * force_n;
    let time_s = libm::sqrtf(2.0 * 20e-3 * settings.object.mass_kg / (0.005 * friction_n));
    let ticks = 100 + (1e3 * time_s) as u32;
    let (mut rests, mut slips) = (0.0f32, 1.2f32);
    for _ in 0..12 {
        let angle = 0.5 * (rests + slips);
        if on_an_incline(settings, force_n, angle, ticks).0 > 5e-3 {
            slips = angle;
        } else {
            rests = angle;
        }
    }
    0.5 * (rests + slips)
}

#[test]
fn slips_at_the_angle_of_friction() {
    for mu in [0.15, 0.3, 0.6, 0.9] {
        for force_n in [1.0, 5.0, 9.0] {
            let angle = slip_angle(&rough(mu, mu), force_n);
            let expected = libm::atanf(mu);
            let off = angle / expected - 1.0;
            assert!(off.abs() < 0.01, "μ {mu}, {force_n} N: {off}");
        }
    }
}

#[test]
fn slips_at_the_static_coefficient_and_slides_at_the_kinetic() {
    let settings = rough(0.2, 0.4);
    let angle = slip_angle(&settings, 5.0);
    // Regularised, friction peaks at a speed of a few ε, where Stribeck's exponential has fallen by (ε/s_S)²: some per cent of the difference.
    assert!(
        angle < libm::atanf(0.4) && angle > 0.95 * libm::atanf(0.4),
        "{angle}"
    );
    // Between both: rests when it was at rest.
    let between = libm::atanf(0.3);
    assert!(on_an_incline(&settings, 5.0, between, 700).0 < 5e-4);
}

#[test]
fn creeps_by_a_fraction_of_the_creep_speed() {
    let settings = rough(0.5, 0.5);
    // At half of the slip angle's tangent: v = ε·t/√(μ² − t²) = 0.58·ε, for 0.6 s.
    let (travelled, settled) = on_an_incline(&settings, 5.0, libm::atanf(0.25), 700);
    assert!(settled);
    let expected = 0.6 * settings.friction.creep_m_per_s * 0.25 / libm::sqrtf(0.5 * 0.5 - 0.25 * 0.25);
    assert!((travelled / expected - 1.0).abs() < 0.1, "{travelled} {expected}");
}

/// A hand presses the box to the slab and drags it about, to and fro and round: friction takes from it and gives nothing.
#[test]
fn makes_no_energy() {
    for (kinetic, fixed) in [(0.0, 0.0), (0.1, 0.1), (0.3, 0.6), (1.0, 2.0)] {
        let settings = rough(kinetic, fixed);
        let image = support::slab_and_box(0.5e-3, 9);
        let scene = image.open();
        let mut state = State::new();
        state.load_scene(&scene);
        let mut hand = Hand::at([0.0, 0.0, 0.0]);
        state.grab(&scene, 1, &hand.pose()).expect("grabbable");
        let (_, seen) = run(&mut state, &scene, &settings, &mut hand, 5000, |t, hand, _| {
            let time = 1e-3 * f64::from(t);
            hand.goal = [
                4e-3 * (9.0 * time).sin(),
                4e-3 * (5.0 * time).cos() * (0.7 * time).sin(),
                -12e-3,
            ];
        });
        assert!(seen.made_j < 1e-3, "{kinetic} {fixed}: {} J", seen.made_j);
        assert!(seen.contacts > 0);
    }
}

//! Explicit integrator: correct where it is stable, bounded where it is not.

use crate::support::image::{Image, Writer};
use crate::support::solids::Block;
use crate::support::{SLAB, UPRIGHT, box_of};
use mortise_haptics::{Input, Integrator, Output, Pose, Quat, Settings, State, Twist, Vec3, tick};
use mortise_protocol::image::SceneImage;

/// From the box's middle to a corner, m.
const CORNER_M: f32 = 15e-3;

/// Slab and box, `height` apart. The slab has no points but its corners, so that only the box's own eight touch.
fn scene(mut w: Writer, height: f64) -> Image {
    let slab = w.shape(&Block { across: 2, ..SLAB });
    let moving = w.shape(&box_of(3));
    w.part(slab, false, [0.0, 0.0, -4e-3], UPRIGHT);
    w.part(moving, true, [0.0, 0.0, (5e-3 + height) as f32], UPRIGHT);
    w.finish()
}

fn slab_and_box(height: f64) -> Image {
    scene(Writer::new(0.5e-3), height)
}

fn settings(stiffness: f32, integrator: Integrator) -> Settings {
    let mut settings = Settings::default();
    settings.contact.stiffness_n_per_m = stiffness;
    settings.integrator = integrator;
    settings
}

fn held<'s>(scene: &SceneImage<'s>) -> State {
    let mut state = State::new();
    state.load_scene(scene);
    state.grab(scene, 1, &Pose::IDENTITY).unwrap();
    state
}

/// Input of a handle at rest, displaced by `to` since the grab.
fn at(to: Vec3) -> Input {
    Input {
        handle: Pose::new(to, Quat::IDENTITY),
        handle_twist: Twist::ZERO,
        enabled: true,
    }
}

fn run(scene: &SceneImage<'_>, settings: &Settings, to: Vec3, ticks: u32) -> Vec<Output> {
    let mut state = held(scene);
    (0..ticks)
        .map(|_| tick(&mut state, scene, settings, &at(to)))
        .collect()
}

/// The eight points of the box's lower face, each of 2 kN/m: h²·k/m is 0.16.
#[test]
fn a_soft_contact_comes_to_rest_where_the_implicit_step_does() {
    let image = slab_and_box(0.2e-3);
    let scene = image.open();
    let down = Vec3::new(0.0, 0.0, -3e-3);
    let [explicit, implicit] = [Integrator::Explicit, Integrator::Implicit]
        .map(|integrator| run(&scene, &settings(2e3, integrator), down, 3000).pop().unwrap());
    // Balance of springs: 1 kN/m over 2.8 mm less the depth against 16 kN/m.
    let depth = 1e3 * 2.8e-3 / (1e3 + 16e3);
    for out in [&explicit, &implicit] {
        let reached = 5e-3 - f64::from(out.object.position.z);
        assert!((reached - depth).abs() < 3e-7, "{reached} {depth}");
        assert!(
            (f64::from(out.contact.force.z) - 16e3 * depth).abs() < 3e-3,
            "{:?}",
            out.contact
        );
        // Positions of 5 mm have a resolution of 0.47 nm: ten steps of it a tick.
        assert!(out.object_twist.linear.length() < 5e-6, "{:?}", out.object_twist);
        assert_eq!(out.work.contacts, 8);
    }
    // The force on the handle is the same.
    assert!((explicit.handle.force - implicit.handle.force).length() < 3e-3);
}

/// Kinetic, coupling and contact energy together never exceed the initial energy by more than the step's own ripple, and reach the minimum.
#[test]
fn a_soft_contact_makes_no_energy() {
    let image = slab_and_box(0.2e-3);
    let scene = image.open();
    let down = Vec3::new(0.0, 0.0, -3e-3);
    let mut settings = settings(2e3, Integrator::Explicit);
    settings.coupling.b_t = 2.0;
    let (k_t, m, k) = (1e3f64, 0.1f64, 16e3f64);
    let energy = |z: f64, v: f64| {
        let (stretch, depth) = (z - (5.2e-3 - 3e-3), (5e-3 - z).max(0.0));
        0.5 * m * v * v + 0.5 * k_t * stretch * stretch + 0.5 * k * depth * depth
    };
    let start = energy(5.2e-3, 0.0);
    let mut most = 0.0f64;
    let mut last = 0.0;
    for out in run(&scene, &settings, down, 4000) {
        last = energy(
            f64::from(out.object.position.z),
            f64::from(out.object_twist.linear.z),
        );
        most = most.max(last);
    }
    // Symplectic Euler keeps E ± h·v·F/2, with h·ω/2 = 0.21 of the largest elastic energy at ω² = 17 kN/m / 0.1 kg.
    assert!(most < 1.21 * start, "{most} {start}");
    let rest = energy(5e-3 - 2.8e-3 / 17.0, 0.0);
    assert!((last - rest).abs() < 1e-3 * start, "{last} {rest}");
}

/// h²·k/m is 80: no explicit step can be stable. It oscillates within every limit; the implicit step comes to rest.
#[test]
fn a_stiff_contact_trembles_within_the_limits() {
    for (name, image) in [
        ("distance field", slab_and_box(0.2e-3)),
        ("occupancy", scene(Writer::voxmaps(0.6e-3), 0.2e-3)),
    ] {
        let scene = image.open();
        let down = Vec3::new(0.0, 0.0, -3e-3);
        // Speed of a corner of the box after two seconds, m/s.
        let late = |integrator| {
            let settings = settings(1e6, integrator);
            let outs = run(&scene, &settings, down, 3000);
            for out in &outs {
                assert!(out.handle.is_finite() && out.object.is_finite() && out.object_twist.is_finite());
                assert!(
                    out.handle.force.length() <= settings.limits.force_n,
                    "{name}: {out:?}"
                );
                assert!(
                    out.handle.torque.length() <= settings.limits.torque_nm,
                    "{name}: {out:?}"
                );
            }
            outs[2000..]
                .iter()
                .map(|out| out.object_twist.linear.length() + CORNER_M * out.object_twist.angular.length())
                .fold(0.0, f32::max)
        };
        let (explicit, implicit) = (late(Integrator::Explicit), late(Integrator::Implicit));
        assert!(explicit > 0.02, "{name}: {explicit}");
        assert!(implicit < 1e-5, "{name}: {implicit}");
    }
}

/// Free flight towards a flat face: within a cell of it half the speed remains after every tick, with no other force acting.
#[test]
fn braking_halves_the_approach_every_tick() {
    let image = slab_and_box(2e-3);
    let scene = image.open();
    let mut settings = settings(2e3, Integrator::Explicit);
    (settings.coupling.k_t_n_per_m, settings.coupling.b_t) = (0.0, 0.0);
    (settings.coupling.k_r, settings.coupling.b_r) = (0.0, 0.0);
    let mut state = held(&scene);
    let speed = Vec3::new(0.03, 0.0, -0.1);
    let mut before: Option<Output> = None;
    let mut braked = 0;
    for _ in 0..40 {
        let input = Input {
            handle_twist: Twist {
                linear: speed,
                angular: Vec3::ZERO,
            },
            ..at(Vec3::ZERO)
        };
        let out = tick(&mut state, &scene, &settings, &input);
        if let Some(before) = &before {
            let height = before.object.position.z - 5e-3;
            let ratio = out.object_twist.linear.z / before.object_twist.linear.z;
            if height > 0.501e-3 {
                assert_eq!(ratio, 1.0, "{height}");
            } else if height < 0.499e-3 && height > 0.0 {
                assert!((ratio - 0.5).abs() < 1e-4, "{height}: {ratio}");
                braked += 1;
            }
            // There is no braking along the flat face.
            assert!((out.object_twist.linear.x - 0.03).abs() < 1e-6);
        }
        before = Some(out);
    }
    assert!(braked > 5, "{braked}");
    // From a tenth of a metre a second: the remainder of 0.1 mm.
    assert!(before.unwrap().object.position.z > 5e-3);
}

#[test]
fn no_point_moves_more_than_half_a_cell_a_tick() {
    let image = slab_and_box(30e-3);
    let scene = image.open();
    let settings = settings(2e3, Integrator::Explicit);
    let mut state = held(&scene);
    let mut farthest = 0.0f32;
    let mut before = state.object().unwrap().0.position;
    for t in 1..60 {
        let input = Input {
            handle_twist: Twist {
                linear: Vec3::X,
                angular: Vec3::ZERO,
            },
            ..at(Vec3::new(1e-3 * t as f32, 0.0, 0.0))
        };
        let out = tick(&mut state, &scene, &settings, &input);
        farthest = farthest.max((out.object.position - before).length());
        before = out.object.position;
    }
    assert!(farthest <= 0.25e-3 * 1.0001 && farthest > 0.249e-3, "{farthest}");
}

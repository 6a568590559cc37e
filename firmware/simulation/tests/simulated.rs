//! The simulated mechanism against closed forms, and under any script.

use crate::support::next;
use glam::{Quat, Vec3};
use mortise_firmware::board::{Drive, Mechanism, Simulation};
use mortise_haptics::Wrench;
use mortise_protocol::message::{HandScript, Keyframe, WirePose};
use mortise_simulation::simulated::*;
use proptest::prelude::*;

fn script(position: Vec3, orientation: Quat, push: Vec3) -> HandScript {
    HandScript {
        stiffness: 400.0,
        damping: 10.0,
        angular_stiffness: 1.0,
        angular_damping: 0.01,
        tremor: 0.0,
        tremor_hz: 0.0,
        keyframes: heapless::Vec::from_slice(&[Keyframe {
            tick: 0,
            pose: WirePose {
                position: position.to_array(),
                orientation: orientation.to_array(),
            },
            push: push.to_array(),
        }])
        .unwrap(),
    }
}

fn force(x: f32) -> Drive {
    Drive::Wrench(Wrench {
        force: Vec3::new(x, 0.0, 0.0),
        torque: Vec3::ZERO,
    })
}

#[test]
fn a_constant_force_ends_in_the_speed_that_friction_allows() {
    let mut rig = Simulated::new();
    rig.drive(force(0.51));
    let mut sensed = next(&mut rig);
    for _ in 0..2000 {
        sensed = next(&mut rig);
    }
    // (0.51 − f_c)/c = 0.5 m/s after 13 time constants of m/c = 0.15 s, which leave 2·10⁻⁶; the encoder's estimate swings by a count
    // a tick through the filter, 1.25 mm/s.
    let expected = (0.51 - COULOMB) / VISCOUS;
    assert!(
        (sensed.twist.linear.x - expected).abs() < 1.3e-3,
        "{}",
        sensed.twist.linear.x
    );
    let travelled = rig.true_pose().position.x;
    // x = v·(t − m/c); at most one step of backward Euler late.
    let exact = expected * (2.001 - MASS / VISCOUS);
    assert!(
        (travelled - exact).abs() < 0.5 * 0.001,
        "{travelled} instead of {exact}"
    );
}

#[test]
fn friction_holds_what_is_below_it() {
    let mut rig = Simulated::new();
    rig.drive(force(0.99 * COULOMB));
    for _ in 0..1000 {
        next(&mut rig);
    }
    assert_eq!(rig.true_pose().position, Vec3::ZERO);
}

#[test]
fn motors_saturate_and_off_is_off() {
    let mut rig = Simulated::new();
    rig.drive(Drive::Wrench(Wrench {
        force: Vec3::new(100.0, -100.0, 1.0),
        torque: Vec3::new(0.1, -9.0, 9.0),
    }));
    assert_eq!(rig.motors().force, Vec3::new(MOTOR_FORCE, -MOTOR_FORCE, 1.0));
    assert_eq!(rig.motors().torque, Vec3::new(0.1, -MOTOR_TORQUE, MOTOR_TORQUE));
    rig.drive(Drive::Off);
    assert_eq!(rig.motors(), Wrench::ZERO);
}

#[test]
fn the_hand_brings_the_handle_where_it_wants_it() {
    let mut rig = Simulated::new();
    let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.2);
    let goal = Vec3::new(0.02, -0.03, 0.01);
    rig.set_hand(Some(&script(goal, turn, Vec3::new(0.0, 0.0, 2.0))));
    let mut sensed = next(&mut rig);
    for _ in 0..3000 {
        sensed = next(&mut rig);
    }
    // Push over stiffness moves the rest position; friction may hold within f_c/k; the encoder rounds.
    let rest = goal + Vec3::new(0.0, 0.0, 2.0 / 400.0);
    let slack = COULOMB / 400.0 + RESOLUTION;
    assert!(
        (sensed.handle.position - rest).length() < slack,
        "{}",
        sensed.handle.position
    );
    let apart = (sensed.handle.orientation * turn.conjugate()).xyz().length() * 2.0;
    assert!(
        apart < ANGULAR_COULOMB / 1.0 + 2.0 * ANGULAR_RESOLUTION,
        "{apart}"
    );
    let hand = rig.hand().unwrap();
    assert!(
        hand.force.length() <= COULOMB * 1.001,
        "in balance with friction alone: {}",
        hand.force
    );
}

#[test]
fn encoders_round_to_their_resolution_and_never_drift() {
    let mut rig = Simulated::new();
    let mut swinging = script(Vec3::ZERO, Quat::IDENTITY, Vec3::ZERO);
    swinging.keyframes.clear();
    for i in 0..12u32 {
        let turn = Quat::from_scaled_axis(
            Vec3::new(1.3, 0.4 * i as f32 - 2.0, -0.7) * if i % 2 == 0 { 1.0 } else { -0.8 },
        );
        let frame = Keyframe {
            tick: 250 * i,
            pose: WirePose {
                position: [0.01 * (i % 3) as f32, 0.02 * (i % 2) as f32, 0.0],
                orientation: turn.to_array(),
            },
            push: [0.0; 3],
        };
        swinging.keyframes.push(frame).unwrap();
    }
    rig.set_hand(Some(&swinging));
    for tick in 0..3200 {
        let before = rig.true_pose().orientation;
        let sensed = next(&mut rig);
        let truth = rig.true_pose();
        let moved = (truth.orientation * before.conjugate()).xyz().length() * 2.0;
        let error = (sensed.handle.position - truth.position).abs().max_element();
        // Half a count, and the rounding of positions below 0.1 m.
        assert!(error < 0.5 * RESOLUTION + 1e-8, "tick {tick}: {error}");
        let turn = (truth.orientation * sensed.handle.orientation.conjugate()).xyz() * 2.0;
        let error = turn.abs().max_element();
        // Half a count about each counted axis; counting uses 2·sin(φ/2) for the rotation φ of a tick, and corrects the error in the next;
        // quaternions round to 6·10⁻⁸ a component.
        let chord = (moved + ANGULAR_RESOLUTION).powi(3) / 24.0;
        assert!(
            error < 0.5 * ANGULAR_RESOLUTION + 1.1 * chord + 1e-6,
            "tick {tick}: {error}, turned {moved}"
        );
        assert_eq!(sensed.encoder_jump, None, "tick {tick}");
    }
}

#[test]
fn a_glitch_is_reported_as_a_jump_once() {
    let mut rig = Simulated::new();
    next(&mut rig);
    rig.wiring.glitch[0] = 100_000;
    assert_eq!(next(&mut rig).encoder_jump, Some(0));
    assert_eq!(next(&mut rig).encoder_jump, None);
    rig.wiring.not_a_number = true;
    assert!(!next(&mut rig).handle.is_finite());
}

proptest! {
    /// Every script and wrench yields finite numbers, and a released handle comes to rest.
    #[test]
    fn stays_finite_and_comes_to_rest(
        stiffness in 0.0f32..1e6, damping in 0.0f32..1e6, angular_stiffness in 0.0f32..1e6, angular_damping in 0.0f32..1e6,
        tremor in 0.0f32..0.1, tremor_hz in 0.0f32..500.0,
        position in prop::array::uniform3(-10.0f32..10.0), push in prop::array::uniform3(-1e3f32..1e3),
        wrench in prop::array::uniform6(-1e30f32..1e30), angle in -3.1f32..3.1,
    ) {
        let mut rig = Simulated::new();
        let turn = Quat::from_axis_angle(Vec3::new(0.0, 0.6, 0.8), angle);
        let mut script = script(Vec3::from_array(position), turn, Vec3::from_array(push));
        (script.stiffness, script.damping) = (stiffness, damping);
        (script.angular_stiffness, script.angular_damping) = (angular_stiffness, angular_damping);
        (script.tremor, script.tremor_hz) = (tremor, tremor_hz);
        rig.set_hand(Some(&script));
        rig.drive(Drive::Wrench(Wrench {
            force: Vec3::from_slice(&wrench[..3]),
            torque: Vec3::from_slice(&wrench[3..]),
        }));
        for _ in 0..300 {
            let sensed = next(&mut rig);
            prop_assert!(sensed.handle.is_finite() && sensed.twist.is_finite());
            let norm = rig.true_pose().orientation.length();
            prop_assert!((norm - 1.0).abs() < 1e-5, "{norm}");
        }
        rig.drive(Drive::Off);
        rig.set_hand(None);
        let mut last = f32::INFINITY;
        for _ in 0..300 {
            let before = rig.true_pose().position;
            next(&mut rig);
            let speed = (rig.true_pose().position - before).length();
            // Rounding of a position p to 24 bits, in each of four substeps and twice in the difference.
            let rounding = 6.0 * 6e-8 * before.length();
            prop_assert!(speed <= last + rounding, "{speed} after {last}");
            last = speed;
        }
    }
}

//! Described mechanisms with the operator model: readings are true, they stay finite and passive, stop at their ranges, and exert the commanded
//! force.

use crate::rigs::{arm, paddle, pantograph};
use crate::support::next;
use glam::Vec3;
use mortise_firmware::board::{Drive, Mechanism, Simulation, TICK_S};
use mortise_haptics::Wrench;
use mortise_protocol::message::{HandScript, Keyframe, WirePose};
use mortise_protocol::rig::Rig;
use mortise_simulation::described::Described;
use proptest::prelude::*;

fn any_rig() -> impl Strategy<Value = Rig> {
    prop_oneof![Just(arm()), Just(pantograph()), Just(paddle())]
}

fn script(stiffness: f32, poses: &[(u32, Vec3, Vec3)]) -> HandScript {
    HandScript {
        stiffness,
        damping: 0.01 * stiffness,
        angular_stiffness: 1.0,
        angular_damping: 0.01,
        tremor: 0.0,
        tremor_hz: 0.0,
        keyframes: (poses.iter())
            .map(|&(tick, place, turn)| Keyframe {
                tick,
                pose: WirePose {
                    position: place.to_array(),
                    orientation: glam::Quat::from_scaled_axis(turn).to_array(),
                },
                push: [0.0; 3],
            })
            .collect(),
    }
}

fn push(force: Vec3) -> Drive {
    Drive::Wrench(Wrench {
        force,
        torque: Vec3::ZERO,
    })
}

fn vector(size: f32) -> impl Strategy<Value = Vec3> {
    (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// For any hand stiffness and any force: finite readings near the true pose, and no joint beyond its range.
    #[test]
    fn stays_finite_and_senses_what_is_there(
        rig in any_rig(),
        stiffness in prop_oneof![10.0f32..2_000.0, Just(1e6f32)],
        places in prop::collection::vec((vector(0.3), vector(2.0)), 1..6),
        force in vector(30.0),
    ) {
        let mut mechanism = Described::new(&rig).unwrap();
        let poses: Vec<_> = places.iter().enumerate().map(|(i, &(place, turn))| (40 * i as u32, place, turn)).collect();
        mechanism.set_hand(Some(&script(stiffness, &poses)));
        for tick in 0..300u32 {
            mechanism.drive(if tick % 50 < 25 { push(force) } else { Drive::Off });
            let sensed = next(&mut mechanism);
            prop_assert!(sensed.handle.is_finite() && sensed.twist.is_finite());
            for (current, joint) in mechanism.currents().iter().zip(&rig.joints) {
                // One rounding of the common factor.
                prop_assert!(current.abs() <= joint.current_limit * 1.000_001);
            }
            if sensed.encoder_jump.is_some() {
                // A hand of 10⁶ N/m may be faster than the joints are allowed to be.
                return Ok(());
            }
            // Half a count at each joint, through levers of at most 0.45 m for the arm; a pantograph's lever grows to (2/STOP)·0.09 m at its stop.
            let bound = if rig.kinematics.joints() == 2 { 6.0 } else { 0.45 };
            let count = rig.joints.iter().map(|joint| joint.radians_per_count().abs()).fold(0.0, f32::max);
            let error = (sensed.handle.position - mechanism.true_pose().position).length();
            prop_assert!(error <= 0.5 * 3.0 * count * bound + 1e-5, "{error}");
        }
    }

    /// Without motors and hand kinetic energy only falls; and it comes to rest, because there is friction.
    #[test]
    fn left_alone_it_loses_energy_and_rests(rig in any_rig(), away in vector(0.05)) {
        let mut mechanism = Described::new(&rig).unwrap();
        let home = mechanism.true_pose().position;
        mechanism.set_hand(Some(&script(300.0, &[(0, home, Vec3::ZERO), (60, home + away, Vec3::ZERO)])));
        for _ in 0..40 {
            next(&mut mechanism);
        }
        mechanism.set_hand(None);
        next(&mut mechanism);
        let mut last = mechanism.kinetic_energy();
        for _ in 0..4_000 {
            next(&mut mechanism);
            let now = mechanism.kinetic_energy();
            // The rounding of two small sums.
            prop_assert!(now <= last * 1.00001 + 1e-9, "{last} J, then {now} J");
            last = now;
        }
        prop_assert!(last < 1e-7, "{last} J left");
    }

    /// Motors against a hand that holds still: in balance the hand carries the force, less what friction holds.
    #[test]
    fn the_hand_feels_the_force(rig in any_rig(), force in vector(1.5)) {
        let mut mechanism = Described::new(&rig).unwrap();
        let home = mechanism.true_pose().position;
        mechanism.set_hand(Some(&script(1_000.0, &[(0, home, Vec3::ZERO)])));
        for _ in 0..1_500 {
            mechanism.drive(push(force));
            next(&mut mechanism);
        }
        let model = mortise_mechanism::kinematics::Model::new(&rig).unwrap();
        let mut angles = [0.0; 3];
        for (angle, joint) in angles.iter_mut().zip(&rig.joints) { *angle = joint.home; }
        let posture = model.posture(angles, [0.0; 3]).unwrap();
        let felt = mechanism.hand().unwrap().force;
        // In joint space: Jᵀ(F + F_hand) within friction, plus the rotation of J over 1.5 mm of yielding (relative 3 %).
        for (joint, rest) in posture.torques(force + felt).iter().enumerate().take(rig.joints.len()) {
            let slack = rig.joints[joint].coulomb + 0.05 * force.length() * 0.25;
            prop_assert!(rest.abs() <= slack * 1.05 + 1e-4, "joint {joint}: {rest} N·m");
        }
    }
}

#[test]
fn a_stop_gives_nothing_back() {
    let rig = paddle();
    let mut mechanism = Described::new(&rig).unwrap();
    let far = Vec3::new(0.2, -0.1, 0.0);
    mechanism.set_hand(Some(&script(200.0, &[(0, far, Vec3::ZERO)])));
    for _ in 0..2_000 {
        next(&mut mechanism);
    }
    let end = mechanism.true_pose().position;
    let (sin, cos) = libm::sincosf(rig.joints[0].range[0]);
    let stop = 0.066 * Vec3::new(cos, sin, 0.0) - Vec3::new(0.0, 0.066, 0.0);
    assert!((end - stop).length() < 1e-6, "{end} {stop}");
    assert!(mechanism.kinetic_energy() < 1e-12);
}

#[test]
fn a_wrist_follows_the_hand_and_is_sensed() {
    let mut mechanism = Described::new(&arm()).unwrap();
    let home = mechanism.true_pose();
    let turn = glam::Quat::from_scaled_axis(Vec3::new(0.3, -0.2, 0.4));
    let commanded = turn * home.orientation;
    let mut hand = script(500.0, &[(0, home.position, Vec3::ZERO)]);
    hand.keyframes[0].pose.orientation = commanded.to_array();
    mechanism.set_hand(Some(&hand));
    let mut sensed = next(&mut mechanism);
    for _ in 0..2_000 {
        sensed = next(&mut mechanism);
    }
    let away = (commanded * sensed.handle.orientation.conjugate())
        .to_scaled_axis()
        .length();
    // No Coulomb friction at the wrist: the remainder is half a count of each encoder, and the arm's own error, held by its friction.
    assert!(away < 0.01, "{away} rad");
    assert!(sensed.twist.angular.length() < 0.01 / TICK_S);
}

#[test]
fn homing_sets_the_reference_and_reset_starts_anew() {
    let mut mechanism = Described::new(&pantograph()).unwrap();
    let start = next(&mut mechanism).handle;
    mechanism.wiring.glitch[1] = 50_000;
    let jumped = next(&mut mechanism);
    assert_eq!((jumped.encoder_jump, jumped.referenced), (Some(1), false));
    mechanism.home();
    let again = next(&mut mechanism);
    assert_eq!((again.encoder_jump, again.referenced), (None, true));
    assert_eq!(again.handle, start);
    mechanism.set_hand(Some(&script(
        500.0,
        &[(0, Vec3::new(0.01, 0.0, 0.0), Vec3::ZERO)],
    )));
    for _ in 0..100 {
        next(&mut mechanism);
    }
    assert_eq!(mechanism.reset(), Some(start));
    assert_eq!(next(&mut mechanism).handle, start);
}

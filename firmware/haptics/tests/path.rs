//! Targets of kind `Path`: they hold a part of any shape on its way, with its orientation, leave it free along the way, and end where the way ends.

use crate::support;
use core::f64::consts::TAU;

use crate::support::hand::{Hand, run};
use crate::support::{BLOCK_HALF, CAP_N, PEG_HALF, along, straight};
use mortise_haptics::{Pose, Quat, Settings, State, Vec3};
use mortise_protocol::message::{Path, PathTurn};

/// The peg 40 mm above the block: only guidance acts.
const ABOVE: f64 = BLOCK_HALF + PEG_HALF + 40e-3;
/// Pitch of the screw, m.
const PITCH_M: f32 = 4e-3;

/// Holds the peg under one target for two seconds, with the hand's motion given by `lead`; hands every pose to `look`, with the tick.
fn hold(
    path: Path,
    lead: impl Fn(u32, &mut Hand),
    mut look: impl FnMut(u32, &Pose, &mortise_haptics::Output),
) {
    let image = support::hole_and_peg(1e-3, -40e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0, 0.0, ABOVE]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    state.set_target(&along(1, 10_000, path)).unwrap();
    for t in 0..2000 {
        lead(t, &mut hand);
        let (out, seen) = run(
            &mut state,
            &scene,
            &Settings::default(),
            &mut hand,
            1,
            |_, _, _| {},
        );
        assert!(seen.flags.is_empty(), "tick {t}: {:?}", seen.flags);
        let (pose, _) = state.object().unwrap();
        look(t, &pose, &out);
    }
}

/// Angle of a rotation about the z axis and of the tilt from it, rad.
fn turn_and_tilt(q: Quat) -> (f32, f32) {
    let q = if q.w < 0.0 { -q } else { q };
    (2.0 * q.z.atan2(q.w), 2.0 * (q.x * q.x + q.y * q.y).sqrt())
}

/// A hand 1 mm and 3° off on every axis, with a tremor of 0.2 mm, that goes down by 20 mm.
fn shaky(t: u32, hand: &mut Hand) {
    let time = f64::from(t) * 1e-3;
    let ease = (time / 0.3).min(1.0);
    let tremor = 0.2e-3 * (TAU * 10.0 * time).sin();
    let tilt = Quat::from_scaled_axis(Vec3::new(0.6, 0.8, 1.0) * 3f32.to_radians());
    hand.orientation = Quat::IDENTITY.lerp(tilt, ease as f32).normalize();
    let down = 20e-3 * ((time - 0.3) / 1.5).clamp(0.0, 1.0);
    hand.goal = [ease * 1e-3 + tremor, -ease * 1e-3, ABOVE - down];
}

#[test]
fn a_shaky_hand_is_held_on_the_way_and_moves_freely_along_it() {
    let (mut off_m, mut tilted, mut lag_m) = (0.0f32, 0.0f32, 0.0f64);
    hold(straight(), shaky, |t, pose, _| {
        if t > 500 {
            let (turn, tilt) = turn_and_tilt(pose.orientation);
            off_m = off_m.max(pose.position.truncate().length());
            tilted = tilted.max(tilt).max(turn.abs());
            let time = f64::from(t) * 1e-3;
            let goal = ABOVE - 20e-3 * ((time - 0.3) / 1.5).clamp(0.0, 1.0);
            lag_m = lag_m.max((f64::from(pose.position.z) - goal).abs());
        }
    });
    println!(
        "{:.2} um, {:.3} mrad, {:.3} mm behind",
        1e6 * off_m,
        1e3 * tilted,
        1e3 * lag_m
    );
    assert!(off_m <= 5e-6 && tilted <= 0.5e-3, "{off_m} m, {tilted} rad");
    // The hand's own arm: 13 mm/s against 5 N s/m and 400 N/m.
    assert!(lag_m < 0.5e-3, "{lag_m}");
}

/// The end 5 mm below. The hand arrives at 20 mm/s, pushes by 1 N beyond it, then by more than the cap.
#[test]
fn the_end_holds_up_to_the_cap_and_a_stronger_hand_gets_past() {
    let end = ABOVE - 5e-3;
    let image = support::hole_and_peg(1e-3, -40e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0, 0.0, ABOVE]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    let mut target = along(
        1,
        60_000,
        Path {
            ends: true,
            ..straight()
        },
    );
    target.fixed.point = [0.0, 0.0, end as f32];
    state.set_target(&target).unwrap();
    let settings = Settings::default();
    hand.spring_n_per_m = 0.0;
    let mut step_n = 0.0f32;
    let mut last: Option<Vec3> = None;
    let mut at = Vec::new();
    for t in 0..5000u32 {
        // Down to the end by 0.1 N at 20 mm/s, 1 N there, then a ramp of 2 N/s.
        hand.push[2] = match t {
            0..600 => -0.1,
            600..1050 => -0.1 - 2e-3 * f64::from(t - 600),
            1050..2000 => -1.0,
            _ => -1.0 - 2e-3 * f64::from(t - 2000),
        };
        let (out, _) = run(&mut state, &scene, &settings, &mut hand, 1, |_, _, _| {});
        if let Some(last) = last {
            step_n = step_n.max((out.handle.force - last).length());
        }
        last = Some(out.handle.force);
        let (pose, _) = state.object().unwrap();
        at.push((-hand.push[2], f64::from(pose.position.z) - end));
        if at[t as usize].1 < -3e-3 {
            break;
        }
    }
    let rested = at[1999].1;
    println!("rests {:.2} um from the end, steps of {step_n} N", 1e6 * rested);
    assert!(rested.abs() < 3e-6, "{rested}");
    let held = at.iter().take_while(|(_, z)| *z > -20e-6).last().unwrap().0;
    println!("held until {held} N, {} ticks", at.len());
    assert!((held - f64::from(CAP_N)).abs() < 0.15, "{held}");
    assert!(at.len() < 5000, "never got past the end");
    assert!(step_n < 0.05, "{step_n}");
}

#[test]
fn a_free_turn_follows_the_hand_and_a_given_one_does_not() {
    for (turn, follows) in [(PathTurn::Free, true), (PathTurn::Geared(0.0), false)] {
        let path = Path { turn, ..straight() };
        let lead = |t: u32, hand: &mut Hand| {
            hand.orientation = Quat::from_rotation_z(0.08 * (t as f32 * 1e-3).min(1.0));
        };
        let mut turned = 0.0;
        hold(path, lead, |_, pose, _| {
            turned = turn_and_tilt(pose.orientation).0
        });
        let expected = if follows { 0.08 } else { 0.0 };
        assert!((turned - expected).abs() < 5e-4, "{turn:?}: {turned} rad");
    }
}

/// A hand that turns a right-hand screw by a quarter and more carries the part along, and it stays on the thread.
#[test]
fn a_screw_advances_as_it_turns() {
    let rate = TAU as f32 / PITCH_M;
    for (sign, quarter) in [(1.0, -1.0f32), (-1.0, 1.0)] {
        // The axis points down: a right-hand thread advances down under a turn that is clockwise from above.
        let path = Path {
            turn: PathTurn::Geared(sign * rate),
            ..straight()
        };
        let turn_at = |t: u32| quarter * 1.5 * ((t as f32 - 300.0) / 1500.0).clamp(0.0, 1.0);
        let lead = |t: u32, hand: &mut Hand| {
            hand.orientation = Quat::from_rotation_z(turn_at(t));
            // A hand that leaves the height to the thread.
            hand.goal[2] = hand.position[2];
        };
        let mut target = along(1, 10_000, path);
        target.fixed.point = [0.0, 0.0, ABOVE as f32];
        let (mut off_rad, mut fallen_m) = (0.0f32, 0.0f64);
        let image = support::hole_and_peg(1e-3, -40e-3);
        let scene = image.open();
        let mut state = State::new();
        state.load_scene(&scene);
        let mut hand = Hand::at([0.0, 0.0, ABOVE]);
        state.grab(&scene, 1, &hand.pose()).unwrap();
        state.set_target(&target).unwrap();
        for t in 0..2000 {
            lead(t, &mut hand);
            run(
                &mut state,
                &scene,
                &Settings::default(),
                &mut hand,
                1,
                |_, _, _| {},
            );
            let (pose, _) = state.object().unwrap();
            fallen_m = ABOVE - f64::from(pose.position.z);
            let (turn, tilt) = turn_and_tilt(pose.orientation);
            if t > 300 {
                let on_thread = sign * rate * fallen_m as f32;
                off_rad = off_rad.max((-turn - on_thread).abs()).max(tilt);
            }
        }
        println!(
            "{:.3} mm down, {:.3} mrad off the thread",
            1e3 * fallen_m,
            1e3 * off_rad
        );
        let expected = 1.5 / TAU * f64::from(PITCH_M);
        assert!((fallen_m - expected).abs() < 0.02 * expected, "{fallen_m}");
        assert!(off_rad < 2e-3, "{off_rad}");
    }
}

//! Constraint targets: they hold the axis, yield to a stronger hand, and cause no step in force.

use crate::support;
use crate::support::hand::{Hand, Seen, run};
use crate::support::{BLOCK_HALF, CAP_N, PEG_HALF, along, axis_on_axis, straight};
use mortise_haptics::{Flags, GuidanceMethod, Output, Quat, Settings, State, TargetError, Vec3, Wrench};
use mortise_protocol::limits::MAX_TARGETS;
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Feature, Path, PathTurn};

const PEG: u16 = 1;

fn scene(clearance: f64, engaged: f64) -> support::image::Image {
    support::hole_and_peg(clearance, engaged)
}

/// Handle position of the peg that is `engaged` in its hole, m.
fn start(engaged: f64) -> [f64; 3] {
    [0.0, 0.0, BLOCK_HALF + PEG_HALF - engaged]
}

/// Largest change between two ticks.
#[derive(Debug, Default)]
struct Steps {
    last: Option<Wrench>,
    force_n: f32,
    torque_nm: f32,
}

impl Steps {
    fn add(&mut self, out: &Output) {
        if let Some(last) = self.last {
            self.force_n = self.force_n.max((out.handle.force - last.force).length());
            self.torque_nm = self.torque_nm.max((out.handle.torque - last.torque).length());
        }
        self.last = Some(out.handle);
    }
}

/// Guided insertion: the hand 1 mm and 2° off, 10 Hz tremor of 0.2 mm.
fn insert(clearance: f64, settings: &Settings) -> (f64, f64, Seen) {
    let image = scene(clearance, 1e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let at = start(1e-3);
    let mut hand = Hand::at(at);
    state.grab(&scene, PEG, &hand.pose()).unwrap();
    let tilt = Quat::from_axis_angle(Vec3::new(0.6, 0.8, 0.0), 2f32.to_radians());
    let mut sequence = 0;
    let mut off_axis = 0.0f64;
    let mut targets = Vec::new();
    for t in 0..3000u32 {
        if t.is_multiple_of(50) {
            sequence += 1;
            targets.push((t, axis_on_axis(sequence, 200)));
        }
    }
    let mut next = 0;
    let mut all = Seen::default();
    for t in 0..3000u32 {
        if next < targets.len() && targets[next].0 == t {
            state.set_target(&targets[next].1).unwrap();
            next += 1;
        }
        let (_, seen) = run(&mut state, &scene, settings, &mut hand, 1, |_, hand, _| {
            let time = f64::from(t) * 1e-3;
            let ease = (time / 0.3).min(1.0);
            let tremor = 0.2e-3 * (core::f64::consts::TAU * 10.0 * time).sin();
            hand.orientation = Quat::IDENTITY.lerp(tilt, ease as f32).normalize();
            let down = 20e-3 * ((time - 0.3) / 2.0).clamp(0.0, 1.0);
            hand.goal = [at[0] + ease * 1e-3 + tremor, at[1], at[2] - down];
        });
        all.deepest_m = all.deepest_m.max(seen.deepest_m);
        all.peak_force_n = all.peak_force_n.max(seen.peak_force_n);
        all.unsettled += seen.unsettled;
        all.solves = all.solves.max(seen.solves);
        all.candidates = all.candidates.max(seen.candidates);
        all.flags.insert(seen.flags);
        if t > 500 {
            let (pose, _) = state.object().unwrap();
            off_axis = off_axis.max(f64::from(pose.position.truncate().length()));
        }
    }
    let (pose, _) = state.object().unwrap();
    let tip = pose.position + pose.orientation * Vec3::new(0.0, 0.0, -PEG_HALF as f32);
    (BLOCK_HALF - f64::from(tip.z), off_axis, all)
}

#[test]
fn goes_in_at_every_fit_and_stays_on_the_axis() {
    for clearance in [1e-3, 0.1e-3, 20e-6, 6e-6, 0.0] {
        let (depth, off_axis, seen) = insert(clearance, &Settings::default());
        println!(
            "{:.0} um: {:.2} mm in, {:.2} um off, {seen:?}",
            1e6 * clearance,
            1e3 * depth,
            1e6 * off_axis
        );
        assert!(depth > 20e-3, "{clearance}: {depth}");
        assert!(off_axis < 5e-6, "{clearance}: {off_axis}");
    }
}

/// The thesis' spring is softer than the hand's coupling: k_T/(k_T + k_A) of the hand's offset remain.
#[test]
fn the_soft_spring_of_the_thesis_stays_off() {
    let mut settings = Settings::default();
    settings.guidance.method = GuidanceMethod::Thesis;
    let (_, off_axis, seen) = insert(2.5e-3, &settings);
    println!("thesis: {:.1} um off, {seen:?}", 1e6 * off_axis);
    assert!(off_axis > 0.1e-3);
}

#[test]
fn engages_and_expires_without_a_step() {
    let image = scene(1e-3, 10e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at(start(10e-3));
    state.grab(&scene, PEG, &hand.pose()).unwrap();
    hand.goal[0] = 1e-3;
    let settings = Settings::default();
    // Against the wall, at rest.
    let still = |_: u32, _: &mut Hand, _: Option<&Output>| {};
    run(&mut state, &scene, &settings, &mut hand, 1000, still);
    let mut steps = Steps::default();
    let mut active = Vec::new();
    state.set_target(&axis_on_axis(1, 500)).unwrap();
    for t in 0..1500 {
        let (out, _) = run(&mut state, &scene, &settings, &mut hand, 1, still);
        let before = (steps.force_n, steps.torque_nm);
        steps.add(&out);
        if before != (steps.force_n, steps.torque_nm) {
            println!("tick {t}: {} N, {} N m", steps.force_n, steps.torque_nm);
        }
        active.push((out.guidance.active, out.guidance.engagement));
        if t == 490 {
            let (pose, _) = state.object().unwrap();
            assert!(pose.position.x.abs() < 2e-6, "{}", pose.position.x);
        }
    }
    println!("{steps:?}");
    assert_eq!(active[250], (1, 1.0));
    assert_eq!(active[499].0, 0);
    assert_eq!(active[750], (0, 0.0));
    assert!(steps.force_n < 0.05 && steps.torque_nm < 2e-3, "{steps:?}");
    // Back at the wall.
    let (pose, _) = state.object().unwrap();
    // Within the depth of the contact and the error of interpolation at 0.5 mm cells on this radius in two directions, 7 µm.
    assert!((pose.position.x - 0.5e-3).abs() < 15e-6, "{}", pose.position.x);
}

#[test]
fn a_stronger_hand_gets_away_without_a_jump() {
    // Above the block only guidance acts.
    let image = scene(1e-3, -5e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at(start(-5e-3));
    state.grab(&scene, PEG, &hand.pose()).unwrap();
    let settings = Settings::default();
    state.set_target(&axis_on_axis(1, 10_000)).unwrap();
    let still = |_: u32, _: &mut Hand, _: Option<&Output>| {};
    run(&mut state, &scene, &settings, &mut hand, 200, still);
    hand.spring_n_per_m = 0.0;
    let mut held_until = 0.0;
    let mut steps = Steps::default();
    let mut away = None;
    for t in 0..2000 {
        // A ramp of 2 N/s.
        hand.push[0] = 2e-3 * f64::from(t);
        let (out, _) = run(&mut state, &scene, &settings, &mut hand, 1, still);
        steps.add(&out);
        let (pose, _) = state.object().unwrap();
        if pose.position.x < 20e-6 {
            held_until = hand.push[0];
        } else if pose.position.x > 5e-3 {
            away = Some(t);
            break;
        }
    }
    println!("held until {held_until} N, 5 mm away at {away:?}, {steps:?}");
    assert!((held_until - f64::from(CAP_N)).abs() < 0.1, "{held_until}");
    // From 3 N on, 2 N/s, 0.15 kg with 5 N s/m.
    let left = away.expect("away") - (held_until / 2e-3) as i32;
    assert!(left < 200, "{left} ticks");
    assert!(steps.force_n < 0.05, "{steps:?}");
}

/// A box pressed flat on a slab while this many targets hold it upright. Returns its largest depth and the smallest number of points queried in a
/// tick once it lies.
fn pressed_under(targets: usize) -> (f32, u32) {
    let image = support::slab_and_box(0.05e-3, 9);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0, 0.0, 5.05e-3]);
    hand.push = [0.0, 0.0, -9.0];
    state.grab(&scene, 1, &hand.pose()).unwrap();
    for id in 0..targets as u16 {
        let upright = ConstraintTarget {
            id,
            faces: heapless::Vec::new(),
            ..axis_on_axis(1, 60_000)
        };
        state.set_target(&upright).unwrap();
    }
    let mut fewest = u32::MAX;
    let settings = Settings::default();
    let (out, seen) = run(&mut state, &scene, &settings, &mut hand, 2000, |t, _, out| {
        if let Some(out) = out.filter(|_| t > 500) {
            fewest = fewest.min(out.work.points);
        }
    });
    assert_eq!(usize::from(out.guidance.active), targets);
    (seen.deepest_m, fewest)
}

/// Targets do not use up the budget that contact needs.
#[test]
fn contact_is_rendered_however_many_targets_are_active() {
    let (alone, _) = pressed_under(0);
    for targets in [1, 2, 4, MAX_TARGETS] {
        let (deepest, fewest) = pressed_under(targets);
        println!(
            "{targets} targets: {fewest} points, {:.2} um deep ({:.2})",
            deepest * 1e6,
            alone * 1e6
        );
        assert!(fewest > 0, "{targets} targets");
        assert!(
            deepest < 1.1 * alone,
            "{targets} targets: {deepest} m, {alone} m without"
        );
    }
}

#[test]
fn stale_damaged_and_too_many_targets_change_nothing() {
    let image = scene(1e-3, -5e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    state.grab(&scene, PEG, &Hand::at(start(-5e-3)).pose()).unwrap();
    let count = |state: &mut State| {
        let mut hand = Hand::at(start(-5e-3));
        let still = |_: u32, _: &mut Hand, _: Option<&Output>| {};
        let (out, _) = run(state, &scene, &Settings::default(), &mut hand, 1, still);
        assert!(!out.work.flags.contains(Flags::NON_FINITE));
        out.guidance.active
    };
    assert_eq!(state.set_target(&axis_on_axis(5, 100)), Ok(()));
    // An older target would make it expire at once.
    assert_eq!(state.set_target(&axis_on_axis(4, 1)), Ok(()));
    assert_eq!(state.set_target(&axis_on_axis(5, 1)), Ok(()));
    assert_eq!(count(&mut state), 1);
    // Across the wrap it is newer.
    state
        .set_target(&axis_on_axis(5u16.wrapping_add(30_000), 100))
        .unwrap();
    state
        .set_target(&axis_on_axis(5u16.wrapping_add(60_000), 100))
        .unwrap();
    assert_eq!(count(&mut state), 1);
    let bad = [
        ConstraintTarget {
            stiffness: f32::NAN,
            ..axis_on_axis(9, 10)
        },
        ConstraintTarget {
            force_cap: -1.0,
            ..axis_on_axis(9, 10)
        },
        ConstraintTarget {
            moving: Feature {
                point: [f32::INFINITY; 3],
                direction: [0.0, 0.0, 1.0],
            },
            ..axis_on_axis(9, 10)
        },
        ConstraintTarget {
            fixed: Feature {
                point: [0.0; 3],
                direction: [0.0, 0.0, 0.5],
            },
            ..axis_on_axis(9, 10)
        },
        axis_on_axis(9, 0),
        // A path without its orientation, an orientation without a path, and paths of numbers out of range.
        ConstraintTarget {
            kind: ConstraintKind::Path,
            ..axis_on_axis(9, 10)
        },
        ConstraintTarget {
            kind: ConstraintKind::Concentric,
            ..along(9, 10, straight())
        },
        along(
            9,
            10,
            Path {
                orientation: [0.0, 0.0, 0.0, 1.1],
                ..straight()
            },
        ),
        along(
            9,
            10,
            Path {
                turn: PathTurn::Geared(f32::NAN),
                ..straight()
            },
        ),
        along(
            9,
            10,
            Path {
                turn: PathTurn::Geared(1.1e4),
                ..straight()
            },
        ),
    ];
    for target in bad {
        assert_eq!(
            state.set_target(&target),
            Err(TargetError::BadNumber),
            "{target:?}"
        );
    }
    for part in [PEG, 9] {
        let target = ConstraintTarget {
            static_part: part,
            ..axis_on_axis(9, 10)
        };
        assert_eq!(state.set_target(&target), Err(TargetError::NoSuchPart));
    }
    for id in 100.. {
        let target = ConstraintTarget {
            id,
            ..axis_on_axis(1, 100)
        };
        if state.set_target(&target) == Err(TargetError::Full) {
            assert_eq!(usize::from(id), 99 + MAX_TARGETS);
            break;
        }
    }
    state.clear_target(7);
    state.clear_target(12345);
    assert_eq!(usize::from(count(&mut state)), MAX_TARGETS - 1);
    state.release();
    assert_eq!(count(&mut state), 0);
}

//! Work of a tick, counted; and the same scenes at length for an instruction counter.
//!
//! `valgrind --tool=callgrind --toggle-collect='*tick*'` on this test's release binary with one test chosen gives instructions a tick.

use crate::support;
use crate::support::hand::{Hand, Seen, run};
use mortise_haptics::{Flags, Settings, State};

const TICKS: u32 = 2000;

fn inside(clearance: f64, push: [f64; 3], sway: f64) -> Seen {
    let image = support::hole_and_peg(clearance, 25e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0; 3]);
    hand.push = push;
    state.grab(&scene, 1, &hand.pose()).unwrap();
    // The first tick queries everything; the measurement is of a session.
    let quiet = |_: u32, _: &mut Hand, _: Option<&_>| {};
    let (_, first) = run(&mut state, &scene, &Settings::default(), &mut hand, 1, quiet);
    let (_, seen) = run(
        &mut state,
        &scene,
        &Settings::default(),
        &mut hand,
        TICKS,
        |t, hand, _| {
            hand.goal[2] = sway * (0.02 * f64::from(t)).sin();
        },
    );
    println!(
        "first {} look-ups; then at most {} nodes + {} points, {} candidates, {} solves",
        first.nodes + first.points,
        seen.nodes,
        seen.points,
        seen.candidates,
        seen.solves
    );
    seen
}

#[test]
fn centred_in_a_loose_hole() {
    let seen = inside(1e-3, [0.0; 3], 1e-3);
    // The gap of 0.5 mm is used up by 20 mm/s in 11 to 22 ticks, each node at its own tick.
    assert!(seen.nodes + seen.points < 500, "{seen:?}");
    assert_eq!(seen.contacts, 0);
}

#[test]
fn pressed_to_the_wall_of_a_close_hole() {
    let seen = inside(20e-6, [5.0, 0.0, 0.0], 1e-3);
    // 514 points in each direction, all within the margin; the budget decimates them.
    assert!(seen.nodes < 150 && seen.points < 1100, "{seen:?}");
    assert!(seen.contacts > 0);
}

#[test]
fn free_above() {
    let image = support::slab_and_box(20e-3, 9);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0; 3]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    let (_, seen) = run(
        &mut state,
        &scene,
        &Settings::default(),
        &mut hand,
        TICKS,
        |t, hand, _| {
            hand.goal[0] = 10e-3 * (0.005 * f64::from(t)).sin();
        },
    );
    println!("at most {} nodes + {} points", seen.nodes, seen.points);
    assert!(seen.nodes < 20, "{seen:?}");
    assert_eq!(seen.points, 0);
}

/// Points decimated while the part was shaken are queried again once it rests.
#[test]
fn recovers_after_an_overload() {
    let image = support::hole_and_peg(0.2e-3, 25e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut settings = Settings::default();
    settings.contact.point_budget = 1000;
    let mut hand = Hand::at([0.0; 3]);
    hand.push = [5.0, 0.0, 0.0];
    state.grab(&scene, 1, &hand.pose()).unwrap();
    let degraded = |seen: &Seen| seen.flags.contains(Flags::BUDGET);
    let rest = |_: u32, hand: &mut Hand, _: Option<&_>| hand.goal[2] = 0.0;
    let shake = |t: u32, hand: &mut Hand, _: Option<&_>| hand.goal[2] = 20e-3 * (0.2 * f64::from(t)).sin();
    // The first pass over everything takes many ticks, and decimates nothing permanently.
    run(&mut state, &scene, &settings, &mut hand, 300, rest);
    let (_, resting) = run(&mut state, &scene, &settings, &mut hand, 300, rest);
    assert!(!degraded(&resting), "{resting:?}");
    let (_, shaken) = run(&mut state, &scene, &settings, &mut hand, 300, shake);
    assert!(degraded(&shaken), "{shaken:?}");
    run(&mut state, &scene, &settings, &mut hand, 2500, rest);
    let (_, after) = run(&mut state, &scene, &settings, &mut hand, 300, rest);
    assert!(!degraded(&after), "{after:?}");
    assert_eq!(after.contacts, resting.contacts);
}

//! Insertion of a peg into its hole by a hand that is not quite aligned.

use crate::support;
use crate::support::hand::{Hand, Seen, run};
use mortise_haptics::{Flags, Quat, Settings, State};

/// Tilt of the peg in the hand, degrees.
const TILT_DEG: f32 = 0.5;
/// Initial distance of the hand from the axis, m.
const OFFSET_M: f64 = 0.2e-3;
/// Travel of the hand from 1 mm engaged, m: through the block and out below it.
const TRAVEL_M: f64 = 20e-3;

/// Inserts the peg of a clearance. Returns its depth below the block's top, and the outcome.
fn insert(clearance: f64, settings: &Settings) -> (f64, Seen) {
    let image = support::hole_and_peg(clearance, 1e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let start = [0.0, 0.0, support::BLOCK_HALF + support::PEG_HALF - 1e-3];
    let mut hand = Hand::at(start);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    let tilt = Quat::from_axis_angle(glam::Vec3::new(0.6, 0.8, 0.0), TILT_DEG.to_radians());
    let (_, seen) = run(&mut state, &scene, settings, &mut hand, 3000, |t, hand, _| {
        let time = f64::from(t) * 1e-3;
        let ease = (time / 0.3).min(1.0);
        // 10 Hz tremor of 0.1 mm.
        let tremor = 0.1e-3 * (core::f64::consts::TAU * 10.0 * time).sin();
        hand.orientation = Quat::IDENTITY.lerp(tilt, ease as f32);
        let down = TRAVEL_M * ((time - 0.3) / 2.0).clamp(0.0, 1.0);
        hand.goal = [start[0] + ease * OFFSET_M + tremor, start[1], start[2] - down];
    });
    let (pose, _) = state.object().unwrap();
    let tip = f64::from(
        (pose.position + pose.orientation * glam::Vec3::new(0.0, 0.0, -support::PEG_HALF as f32)).z,
    );
    (support::BLOCK_HALF - tip, seen)
}

fn goes_in(clearance: f64, settings: &Settings) {
    let (depth, seen) = insert(clearance, settings);
    println!(
        "clearance {:.0} um: {:.2} mm in, {seen:?}",
        1e6 * clearance,
        1e3 * depth
    );
    // The hand pulls 400 N/m: with less than 0.4 N of axial resistance it ends within 1 mm of its goal.
    assert!(depth > TRAVEL_M, "{depth}");
    assert!(seen.deepest_m < 50e-6);
    assert!(seen.peak_force_n < 3.0);
    // Over no interval did the device deliver more energy than was stored.
    assert!(seen.made_j < 1e-6, "{seen:?}");
}

#[test]
fn with_one_millimetre() {
    goes_in(1e-3, &Settings::default());
}

#[test]
fn with_a_tenth() {
    goes_in(0.1e-3, &Settings::default());
}

#[test]
fn with_twenty_micrometres() {
    goes_in(20e-6, &Settings::default());
}

#[test]
fn soft_and_stiff_contact_alike() {
    for stiffness in [20e3, 200e3, 2e6] {
        let mut settings = Settings::default();
        settings.contact.stiffness_n_per_m = stiffness;
        println!("{stiffness:e} N/m a point");
        goes_in(0.1e-3, &settings);
    }
}

/// A third of the field queries needed: contacts in leaves not reached are carried over.
#[test]
fn on_a_starved_budget() {
    let mut settings = Settings::default();
    settings.contact.point_budget = 200;
    let (depth, seen) = insert(20e-6, &settings);
    println!("{:.2} mm in, {seen:?}", 1e3 * depth);
    assert!(seen.flags.contains(Flags::BUDGET));
    assert!(depth > TRAVEL_M, "{depth}");
    assert!(seen.deepest_m < 50e-6);
    assert!(seen.peak_force_n < 3.0);
}

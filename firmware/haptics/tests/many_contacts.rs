//! Thousands of points in contact at once.

use crate::support;
use crate::support::hand::{Hand, run};
use mortise_haptics::{Flags, Settings, State};

/// A face with 2,025 points pressed flat, at rest within `unrest_n` (N, and 100 N s/m times the handle's speed) after a second. Returns the deepest
/// penetration, the force on the handle, and the outcome.
fn press(settings: &Settings, unrest_n: f32) -> (f32, f32, support::hand::Seen) {
    let image = support::slab_and_box(0.05e-3, 45);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0, 0.0, 5.05e-3]);
    hand.spring_n_per_m = 0.0;
    state.grab(&scene, 1, &hand.pose()).unwrap();
    hand.push = [0.0, 0.0, -9.0];
    let (mut late, mut spin) = (0.0f32, 0.0f32);
    // Net work of contacts on the object, J, and its largest value.
    let (mut net, mut generated) = (0.0f64, 0.0f64);
    let (out, seen) = run(&mut state, &scene, settings, &mut hand, 2000, |t, hand, out| {
        let Some(out) = out else { return };
        let twist = out.object_twist;
        let power = out.contact.force.dot(twist.linear) + out.contact.torque.dot(twist.angular);
        net += f64::from(power * settings.period_s);
        generated = generated.max(net);
        if t > 1000 {
            spin = spin.max(twist.angular.length());
            late = late.max((out.handle.force.z - 9.0).abs());
            late = late.max(100.0 * hand.velocity[2].abs() as f32);
        }
    });
    println!(
        "{seen:?}, last {:?}, unrest {late}, spin {spin}, generated {generated} J",
        out.work
    );
    assert!(late < unrest_n, "{late}");
    // A tilt that alternates from tick to tick does not appear in the force. At the corners, 25 mm off, a millimetre a second is a micrometre a tick.
    assert!(spin < 0.04, "{spin} rad/s");
    // A tenth of the millijoule that any closed loop may generate: the energy of contacts that come and go with points not reached in a tick.
    assert!(generated < 0.1e-3, "{generated} J");
    (seen.deepest_m, out.handle.force.z, seen)
}

#[test]
fn all_points_queried_some_contacts_kept() {
    let mut settings = Settings::default();
    settings.contact.point_budget = 20_000;
    let (deepest, felt, seen) = press(&settings, 9e-3);
    assert!((felt - 9.0).abs() < 0.01);
    assert!(deepest < 20e-6);
    assert!(seen.flags.contains(Flags::CONTACTS));
}

#[test]
fn a_million_newton_per_metre_in_all() {
    let mut settings = Settings::default();
    settings.contact.point_budget = 20_000;
    settings.contact.total_stiffness_n_per_m = 1e6;
    let (deepest, felt, _) = press(&settings, 9e-3);
    assert!((felt - 9.0).abs() < 0.01);
    // 9 N on 1 MN/m is 9 µm; as much again on impact.
    assert!(deepest < 20e-6);
}

// Two thirds of the points a tick, the contacts of the others carried over.
#[test]
fn on_the_usual_budget() {
    let (deepest, felt, seen) = press(&Settings::default(), 9e-3);
    assert!((felt - 9.0).abs() < 0.01);
    assert!(deepest < 20e-6);
    assert!(seen.flags.contains(Flags::BUDGET));
}

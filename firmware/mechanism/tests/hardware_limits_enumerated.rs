//! The wrench passed to the motors, over a grid of every class of number: 0 with both signs, ordinary, at a limit, the smallest and the largest
//! finite ones, infinite, NaN. All 18.9 million combinations of force, speed, torque, angular speed and place; bounds are checked in double
//! precision.

use glam::Vec3;
use mortise_haptics::{Twist, Wrench};
use mortise_mechanism::hardware_limits::{HardwareLimits, restrain};

const FORCE: f32 = 8.0;
const TORQUE: f32 = 0.3;
const POWER: f32 = 5.0;
const RADIUS: f32 = 0.5;

/// Components of forces and speeds.
const KINDS: [f32; 8] = [
    0.0,
    -0.0,
    0.25,
    -30.0,
    f32::MIN_POSITIVE,
    f32::MAX,
    f32::INFINITY,
    f32::NAN,
];
const HANDLES: [Vec3; 6] = [
    Vec3::ZERO,
    Vec3::new(0.0, RADIUS, 0.0),
    Vec3::new(0.4, -0.4, 0.0),
    Vec3::new(0.0, 0.0, 1e20),
    Vec3::new(f32::MAX, f32::MAX, 0.0),
    Vec3::new(f32::NAN, 0.0, 0.0),
];

fn grid() -> impl Iterator<Item = Vec3> {
    KINDS.into_iter().flat_map(|x| {
        KINDS
            .into_iter()
            .flat_map(move |y| KINDS.map(|z| Vec3::new(x, y, z)))
    })
}

/// Torques and angular speeds, in pairs.
fn turns() -> impl Iterator<Item = (Vec3, Vec3)> {
    let torques = [
        Vec3::ZERO,
        Vec3::new(0.1, -0.2, 0.05),
        Vec3::new(f32::MAX, -9.0, 0.0),
    ];
    let speeds = [
        Vec3::ZERO,
        Vec3::new(-3.0, 40.0, 0.0),
        Vec3::new(f32::NEG_INFINITY, 1.0, 0.0),
        Vec3::splat(f32::MAX),
    ];
    torques
        .into_iter()
        .flat_map(move |torque| speeds.map(|speed| (torque, speed)))
}

/// Checks one combination.
fn check(wrench: Wrench, handle: Vec3, twist: &Twist) {
    let bounds = HardwareLimits {
        force_n: FORCE,
        torque_nm: TORQUE,
        ..HardwareLimits::LARGEST
    }
    .with(POWER, RADIUS);
    let out = restrain(wrench, handle, twist, &bounds);
    let context = || format!("{wrench:?} at {handle}, {twist:?}: {out:?}");
    assert!(out.is_finite(), "{}", context());
    // Scaling to a length rounds three times, and the length once more: 4·2⁻²⁴ of itself.
    let (force, torque) = (out.force.as_dvec3(), out.torque.as_dvec3());
    assert!(
        force.length() <= f64::from(FORCE) * (1.0 + 2.4e-7),
        "{}",
        context()
    );
    assert!(
        torque.length() <= f64::from(TORQUE) * (1.0 + 2.4e-7),
        "{}",
        context()
    );
    let (linear, angular) = (twist.linear.as_dvec3(), twist.angular.as_dvec3());
    if linear.is_finite() && angular.is_finite() {
        // Six products and five sums in single precision, each off by 2⁻²⁴ of the largest product.
        let largest = (force.abs() * linear.abs())
            .max_element()
            .max((torque.abs() * angular.abs()).max_element());
        let power = force.dot(linear) + torque.dot(angular);
        assert!(
            power <= f64::from(POWER) + 12.0 * 6e-8 * largest.max(f64::from(POWER)),
            "{power} W: {}",
            context()
        );
    }
    if handle.is_finite() && handle.as_dvec3().length() > f64::from(RADIUS) * (1.0 + 1e-6) {
        let outwards = force.dot(handle.as_dvec3().normalize());
        // The projection leaves a rounding of the force and of the direction.
        assert!(
            outwards <= 8.0 * 6e-8 * force.length().max(f64::from(FORCE)),
            "{outwards} N outwards: {}",
            context()
        );
    }
}

#[test]
fn no_kind_of_number_gets_a_wrench_past_a_bound() {
    let mut combinations = 0_u64;
    for (torque, angular) in turns() {
        for handle in HANDLES {
            for force in grid() {
                for linear in grid() {
                    check(Wrench { force, torque }, handle, &Twist { linear, angular });
                    combinations += 1;
                }
            }
        }
    }
    assert_eq!(combinations, 3 * 4 * 6 * 512 * 512);
}

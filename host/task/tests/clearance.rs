//! Clearances and sweeps against closed forms: a peg of 17.75 mm in a hole of 18.75 mm, moved sideways, tilted and turned.

use crate::support;
use std::sync::OnceLock;

use glam::{DAffine3, DQuat, DVec3};
use mortise_task::{Assembly, Motion, Moved, SEARCH_STEP_MM};
use proptest::prelude::*;

/// The assembly, and the peg's motion from beside the block, on the hole's axis, to the middle of the hole.
fn pair() -> &'static (Assembly, DAffine3) {
    static PAIR: OnceLock<(Assembly, DAffine3)> = OnceLock::new();
    PAIR.get_or_init(|| {
        let assembly = support::own("app/samples/pair_d18.75_clear1.00.step");
        let middle = |part| {
            let (low, high) = assembly.bounds(part, DAffine3::IDENTITY);
            (low + high) / 2.0
        };
        let by = DAffine3::from_translation((middle(0) - middle(1)) * DVec3::Z);
        (assembly, by)
    })
}

/// The lock of the shared parts, its key second.
fn lock() -> Option<&'static Assembly> {
    static LOCK: OnceLock<Option<Assembly>> = OnceLock::new();
    let load = || {
        Some(support::load(
            &support::shared("lock")?,
            "10_extraction/lock_maze.step",
        ))
    };
    LOCK.get_or_init(load).as_ref()
}

fn gap(shift: DVec3, exact: bool) -> f64 {
    let (assembly, inside) = pair();
    let by = DAffine3::from_translation(shift) * *inside;
    assembly
        .clearance(&Moved { parts: &[1], by }, &[0], f64::INFINITY, exact)
        .unwrap()
        .gap
        .distance_mm
}

#[test]
fn the_centred_peg_has_half_the_clearance() {
    assert!(
        (gap(DVec3::ZERO, true) - 0.5).abs() < 1e-6,
        "{}",
        gap(DVec3::ZERO, true)
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Sideways by d the least distance is 0.5 − d, also where that is an overlap: within 0.1 µm after the descent, and the samples alone find no less.
    #[test]
    fn sideways_the_distance_is_that_of_circles(angle in 0.0..std::f64::consts::TAU, d in 0.0..0.9f64) {
        let shift = DVec3::new(angle.cos(), angle.sin(), 0.0) * d;
        let (sampled, exact) = (gap(shift, false), gap(shift, true));
        prop_assert!((exact - (0.5 - d)).abs() < 1e-4, "{exact} {}", 0.5 - d);
        prop_assert!(sampled >= exact - 1e-9 && sampled - exact < 0.02, "{sampled} {exact}");
    }

    /// A slide sideways ends where the peg touches, allowance included, and a turn about the axis does not end.
    #[test]
    fn a_slide_ends_at_the_wall(angle in 0.0..std::f64::consts::TAU, length in 1.0..30.0f64) {
        let (assembly, inside) = pair();
        let group = Moved { parts: &[1], by: *inside };
        let along = DVec3::new(angle.cos(), angle.sin(), 0.0) * length;
        let (share, met) = assembly.touch_share(&group, &[0], &Motion::slide(along), SEARCH_STEP_MM);
        prop_assert_eq!(met, Some([1, 0]));
        // The samples see the wall up to their chord error late.
        let touch = share * length;
        prop_assert!(touch >= 0.5 - 1e-6 && touch < 0.5 + assembly.allowed_mm(0, 1) + 0.02, "{touch}");
        let turn = Motion::turn(DVec3::ZERO, DVec3::Z, 6.0);
        prop_assert_eq!(assembly.free_share(&group, &[0], &turn, SEARCH_STEP_MM), (1.0, None));
    }

    /// A slide along the axis, where samples of the bore and of the peg follow each other, ends where poses on it begin to overlap.
    #[test]
    fn a_slide_along_the_axis_ends_where_its_poses_overlap(
        angle in 0.0..std::f64::consts::TAU, aside in 0.0..0.9f64, start in -60.0..60.0f64, length in 1.0..90.0f64, back: bool
    ) {
        let (assembly, inside) = pair();
        let aside = DVec3::new(angle.cos(), angle.sin(), 0.0) * aside;
        let group = Moved { parts: &[1], by: DAffine3::from_translation(aside + start * DVec3::Z) * *inside };
        let length = if back { -length } else { length };
        let motion = Motion::slide(length * DVec3::Z);
        let step_mm = 0.25;
        let (share, met) = assembly.free_share(&group, &[0], &motion, step_mm);
        let clear = |t: f64| assembly.clear(&Moved { parts: &[1], by: motion.at(t) * group.by }, &[0]);
        let step = step_mm / length.abs();
        // Where it ends is found to a step.
        for i in 0..32 {
            let t = (share - step) * f64::from(i) / 31.0;
            prop_assert!(share <= step || clear(t), "{t} of {share}");
        }
        prop_assert_eq!(met.is_none(), share == 1.0);
        prop_assert!(met.is_none() || (0..=8).any(|i| !clear((share + step * f64::from(i) / 8.0).min(1.0))), "{share}");
    }

    /// A key between wards and in their keyholes, whose faces lie about one axis: turns and slides end where poses on them begin to overlap.
    #[test]
    fn a_key_turns_until_its_poses_overlap(
        chamber in 0..4usize, angle in -3.2..3.2f64, within in 0.0..1.0f64, in_ward: bool, slides: bool, by in prop_oneof![-6.0..-0.1f64, 0.1..6.0f64]
    ) {
        let Some(assembly) = lock() else { return Ok(()) };
        const WARDS: [f64; 4] = [75.0, -40.0, 140.0, 20.0];
        const PITCH_MM: f64 = 7.3;
        let (angle, height) = if in_ward { (WARDS[chamber].to_radians(), within) } else { (angle, 0.0) };
        let start = DAffine3::from_rotation_translation(DQuat::from_rotation_z(angle), PITCH_MM * (chamber as f64 + height) * DVec3::Z);
        let group = Moved { parts: &[1], by: start };
        let (motion, length) = if slides {
            (Motion::slide(by * DVec3::Z), by.abs())
        } else {
            // The bit ends 12.2 mm from the axis.
            (Motion::turn(DVec3::ZERO, DVec3::Z, by), 12.2 * by.abs())
        };
        let step_mm = 0.25;
        let (share, met) = assembly.free_share(&group, &[0], &motion, step_mm);
        let clear = |t: f64| assembly.clear(&Moved { parts: &[1], by: motion.at(t) * group.by }, &[0]);
        let step = step_mm / length;
        for i in 0..32 {
            let t = (share - step) * f64::from(i) / 31.0;
            prop_assert!(share <= step || clear(t), "{t} of {share}");
        }
        prop_assert_eq!(met.is_none(), share == 1.0);
        prop_assert!(met.is_none() || (0..=8).any(|i| !clear((share + step * f64::from(i) / 8.0).min(1.0))), "{share}");
        prop_assert_eq!(assembly.free_share_by_cores(&group, &[0], &motion, step_mm), (share, met));
    }

    /// By all cores a motion ends where it ends by one, to the bit.
    #[test]
    fn all_cores_find_what_one_finds(
        slide in prop::array::uniform3(-30.0..30.0f64), tilt in -0.3..0.3f64, shift in prop::array::uniform3(-1.0..1.0f64)
    ) {
        let (assembly, inside) = pair();
        let group = Moved { parts: &[1], by: DAffine3::from_translation(DVec3::from(shift)) * *inside };
        let motion = Motion { slide: DVec3::from(slide), point: DVec3::ZERO, axis: DVec3::X, angle: tilt };
        for step_mm in [0.05, SEARCH_STEP_MM, 2.0] {
            let one = assembly.free_share(&group, &[0], &motion, step_mm);
            prop_assert_eq!(assembly.free_share_by_cores(&group, &[0], &motion, step_mm), one);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Over a motion the least distance is no more than that of any pose on it.
    #[test]
    fn the_least_over_a_motion_is_the_least_of_its_poses(x in -0.4..0.4f64, y in -0.4..0.4f64, z in -30.0..30.0f64, tilt in -0.01..0.01f64) {
        let (assembly, inside) = pair();
        let group = Moved { parts: &[1], by: *inside };
        let (low, high) = assembly.bounds(1, *inside);
        let motion = Motion { slide: DVec3::new(x, y, z), point: (low + high) / 2.0, axis: DVec3::X, angle: tilt };
        let (_, least) = assembly.least_over(&group, &[0], &motion, 0.05, f64::INFINITY).unwrap();
        for i in 0..=10 {
            let by = motion.at(f64::from(i) / 10.0) * *inside;
            let there = assembly.clearance(&Moved { parts: &[1], by }, &[0], f64::INFINITY, false).unwrap().gap.distance_mm;
            prop_assert!(least.gap.distance_mm <= there + 0.05, "{} {there}", least.gap.distance_mm);
        }
    }
}

//! Ways out and sequences on the shared extraction tasks: found, free by the exact distance at every waypoint, and in an order that meets every constraint.

use crate::support;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use glam::{DAffine3, DQuat, DVec3};
use mortise_task::removal::{Budget, Path, Removal, remove};
use mortise_task::report::{self, Sense};
use mortise_task::{Assembly, Deadline, Moved, sequence};
use serde_json::Value;

/// Removes part 1 from part 0 and checks the way by its waypoints, the form in which it is published.
fn out(assembly: &Assembly, time_s: u64) -> Option<Path> {
    out_with(assembly, time_s, 0)
}

/// As [`out`], with the random numbers of `seed`.
fn out_with(assembly: &Assembly, time_s: u64, seed: u64) -> Option<Path> {
    let budget = Budget {
        seed,
        ..Budget::lasting(Duration::from_secs(time_s))
    };
    let Removal::Out(path) = remove(assembly, &[1], &[0], &[], &budget) else {
        return None;
    };
    for w in report::waypoints(&path, DAffine3::IDENTITY) {
        let [a, x, y, z] = w.q;
        let by = DAffine3::from_rotation_translation(DQuat::from_xyzw(x, y, z, a), DVec3::from_array(w.t));
        let gap = assembly
            .clearance(&Moved { parts: &[1], by }, &[0], 1e3, true)
            .map_or(1e3, |c| c.gap.distance_mm);
        assert!(gap > -0.01, "overlap of {gap} mm at {w:?}");
    }
    let (low, high) = assembly.bounds(1, path.poses().pop().unwrap());
    let (l, h) = assembly.bounds(0, DAffine3::IDENTITY);
    assert!((low - h).max(l - high).max_element() > 0.0, "still inside");
    Some(path)
}

#[test]
fn straight_and_turned_ways_out_are_found() {
    let Some(folder) = support::shared("straight_and_turned_ways_out_are_found") else {
        return;
    };
    // Behind each ward of the maze the key turns again, where it could not within the ward.
    for (name, legs) in [
        ("ubolt_plate", 1),
        ("cross_pin", 3),
        ("keyhole_loose_30um", 2),
        ("lock_maze", 8),
    ] {
        let assembly = support::load(&folder.join("10_extraction"), &format!("{name}.step"));
        let path = out(&assembly, 240).unwrap_or_else(|| panic!("{name} stays in"));
        assert_eq!(path.legs.len(), legs, "{name}: {path:?}");
    }
}

/// Ways that bend, or lead through a place that one slide or turn does not reach, by walks; with other random numbers, too.
#[test]
fn bent_ways_out_are_found() {
    let Some(folder) = support::shared("bent_ways_out_are_found") else {
        return;
    };
    for name in ["gear_housing", "ring_hook"] {
        let assembly = support::load(&folder.join("10_extraction"), &format!("{name}.step"));
        for seed in 0..3 {
            out_with(&assembly, 240, seed).unwrap_or_else(|| panic!("{name} stays in with seed {seed}"));
        }
    }
}

/// The ball is 30 µm larger than the hole: 15 µm on each side. The balls of the bar are 0.5 mm larger than the ring, and the rings' bars 6 mm thick. What is
/// proved is no more than that, and little less.
#[test]
fn interlocked_pairs_stay_together_and_state_by_how_much() {
    let Some(folder) = support::shared("interlocked_pairs_stay_together_and_state_by_how_much") else {
        return;
    };
    for (name, held_um, least_um) in [
        ("keyhole_locked_30um", 15.0, 14.5),
        ("ring_on_dumbbell", 500.0, 490.0),
        ("linked_rings", 6000.0, 2900.0),
    ] {
        let assembly = support::load(&folder.join("10_extraction"), &format!("{name}.step"));
        let budget = Budget::lasting(Duration::from_secs(240));
        let Removal::Blocked(blocked) = remove(&assembly, &[1], &[0], &[], &budget) else {
            panic!("{name} is not proved");
        };
        assert_eq!(blocked.pair, [1, 0]);
        assert!(blocked.proof.is_some(), "{name}");
        let found = blocked.overlap_mm.map(|mm| mm * 1e3);
        assert!(
            found.is_some_and(|um| (least_um..=held_um).contains(&um)),
            "{name}: {found:?}"
        );
    }
}

/// The rod of a pneumatic cylinder, with heads of ⌀ 10 × 5 mm behind necks of ⌀ 6 mm: no ball in a head is larger than a neck, a disc is. It needs no more overlap than a
/// head is larger than its neck.
#[test]
fn a_rod_with_flat_heads_stays_in_its_cylinder() {
    let Some(folder) = support::shared("a_rod_with_flat_heads_stays_in_its_cylinder") else {
        return;
    };
    let file = folder.join("real/o2ac_fixture_diagonal.step");
    if !file.is_file() {
        println!("skipped: no real/o2ac_fixture_diagonal.step among the shared parts");
        return;
    }
    let assembly = support::load(&folder, "real/o2ac_fixture_diagonal.step");
    let find = |name: &str| {
        let all = 0..assembly.count();
        all.into_iter()
            .find(|&part| assembly.name(part).contains(name))
            .expect("a part of the cylinder")
    };
    let (rod, body) = (find("ROD_11"), find("BODY_2"));
    for (moving, fixed) in [(rod, body), (body, rod)] {
        let budget = Budget::lasting(Duration::from_secs(240));
        let Removal::Blocked(blocked) = remove(&assembly, &[moving], &[fixed], &[], &budget) else {
            panic!("{} is not proved", assembly.name(moving));
        };
        assert!(
            matches!(blocked.proof, Some(mortise_task::Proof::Ends { .. })),
            "{blocked:?}"
        );
        let found = blocked.overlap_mm.expect("an overlap");
        assert!((1.0..=2.0).contains(&found), "{found}");
    }
}

#[test]
fn without_time_nothing_is_claimed() {
    let assembly = support::own("mating/tests/data/two_pin_exact.step");
    let budget = Budget {
        until: Duration::ZERO.into(),
        legs: 12,
        seed: 0,
    };
    assert!(matches!(
        remove(&assembly, &[1], &[0], &[], &budget),
        Removal::TimedOut(_)
    ));
    let found = sequence::disassemble(&assembly, &[0, 1], Duration::ZERO);
    assert!(found.timed_out && found.steps.is_empty());
    // The same where the caller no longer wants it.
    let stopped = Deadline::from(Duration::from_secs(60)).or_stopped(Arc::new(AtomicBool::new(true)));
    let found = sequence::disassemble(&assembly, &[0, 1], stopped);
    assert!(found.timed_out && found.steps.is_empty());
    assert_eq!(
        report::sequence(&assembly, &found, Sense::Assembly).verdict,
        "timed_out"
    );
}

/// The step after which two parts are together in a plan of steps (group, onto).
fn together(plan: &[(Vec<&str>, Vec<&str>)], a: &str, b: &str) -> usize {
    let meets = |(group, onto): &(Vec<&str>, Vec<&str>)| {
        (group.contains(&a) && onto.contains(&b)) || (group.contains(&b) && onto.contains(&a))
    };
    plan.iter().position(meets).unwrap()
}

fn meets(plan: &[(Vec<&str>, Vec<&str>)], constraint: &Value) -> bool {
    if let Some(any) = constraint["any"].as_array() {
        return any.iter().any(|c| meets(plan, c));
    }
    let step = |key: &str| {
        together(
            plan,
            constraint[key][0].as_str().unwrap(),
            constraint[key][1].as_str().unwrap(),
        )
    };
    step("first") <= step("then")
}

#[test]
fn the_box_goes_together_in_its_order() {
    let Some(folder) = support::shared("the_box_goes_together_in_its_order") else {
        return;
    };
    let folder = folder.join("10_extraction");
    let assembly = support::load(&folder, "box_with_board.step");
    let all: Vec<usize> = (0..assembly.count()).collect();
    let found = sequence::disassemble(&assembly, &all, Duration::from_secs(240));
    assert!(found.complete(), "{found:?}");
    let report = report::sequence(&assembly, &found, Sense::Assembly);
    assert_eq!((report.verdict, report.steps.len()), ("assembles", 6));
    assert!(
        report
            .steps
            .iter()
            .all(|s| s.overlap_um.is_some_and(|um| um < 2.0)),
        "{report:?}"
    );
    let plan: Vec<_> = report
        .steps
        .iter()
        .map(|s| (s.moving.clone(), s.onto.clone()))
        .collect();
    let order: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("box_with_board.order.json")).unwrap())
            .unwrap();
    for constraint in order["constraints"].as_array().unwrap() {
        assert!(meets(&plan, constraint), "{constraint}");
    }
}

//! Steps of a sequence as a hand does them: a part, or a group that one of its parts leads.

use crate::support;
use std::time::Duration;

use glam::{DQuat, DVec3};
use mortise_task::Motion;
use mortise_task::insertion::insertions;
use mortise_task::removal::Path;
use mortise_task::sequence::{Sequence, Step};

fn step(group: &[usize], onto: &[usize]) -> Step {
    Step {
        group: group.to_vec(),
        onto: onto.to_vec(),
        path: Path {
            legs: vec![
                Motion::turn(DVec3::new(1.0, 2.0, 0.0), DVec3::Z, 0.5),
                Motion::slide(DVec3::X * 30.0),
            ],
        },
        least: None,
        measured: false,
        falls: Vec::new(),
    }
}

fn found(steps: Vec<Step>) -> Sequence {
    Sequence {
        steps,
        stuck: Vec::new(),
        timed_out: false,
        time: Duration::ZERO,
    }
}

/// Seen from the group that a step moves, the single part that stays moves: relative to each other both are where the step has them.
#[test]
fn a_single_part_moves_wherever_there_is_one() {
    let assembly = support::own("lab/data/fixture_row.step");
    let found = found(vec![
        step(&[1], &[0]),
        step(&[0, 2], &[1]),
        step(&[0, 2], &[1, 3]),
    ]);
    let all = insertions(&assembly, &found);
    // Assembly is the reverse of disassembly.
    let [group, turned, straight] = &all[..] else {
        panic!("{all:?}")
    };
    let volume = |part: usize| assembly.model.shapes[assembly.model.parts[part].shape].volume_mm3;
    assert!(volume(group.part) >= volume(group.with[0]));
    let mut moving = [group.part, group.with[0]];
    moving.sort_unstable();
    assert_eq!((moving, group.onto.as_slice()), ([0, 2], &[1, 3][..]));
    assert!(turned.with.is_empty() && straight.with.is_empty());
    assert_eq!((turned.part, turned.onto.as_slice()), (1, &[0, 2][..]));
    assert_eq!((straight.part, straight.onto.as_slice()), (1, &[0][..]));
    let place = assembly.placement(1);
    for (a, b) in turned.way.iter().zip(&straight.way) {
        // The group moved by D, or the part by D⁻¹.
        let by = (*b * place.inverse()).inverse();
        assert!((*a * place.inverse()).abs_diff_eq(by, 1e-9));
    }
    for way in [&turned.way, &straight.way] {
        assert!(way.last().unwrap().abs_diff_eq(place, 1e-9));
        for pair in way.windows(2) {
            let turn = DQuat::from_mat3(&pair[0].matrix3).angle_between(DQuat::from_mat3(&pair[1].matrix3));
            assert!(turn < 0.0176, "{turn}");
        }
    }
}

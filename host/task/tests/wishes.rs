//! Held parts stay, and what is said to fall does fall.

use crate::support;
use std::time::Duration;

use glam::{DAffine3, DVec3};
use mortise_task::graph::graph;
use mortise_task::sequence::{Sequence, disassemble_as};
use mortise_task::{Assembly, Motion, Moved, Wishes};

const TIME: Duration = Duration::from_secs(60);
const OWN: &str = "lab/data/fixture_row.step";

fn taken_apart(assembly: &Assembly, wishes: &Wishes) -> Sequence {
    let all: Vec<usize> = (0..assembly.count()).collect();
    let found = disassemble_as(assembly, &all, wishes, TIME);
    assert!(found.complete(), "{wishes:?}: {:?}", found.stuck);
    found
}

#[test]
fn held_parts_do_not_move() {
    let assembly = support::own(OWN);
    for held in 0..assembly.count() {
        let wishes = Wishes {
            held: vec![held],
            down: None,
        };
        let found = taken_apart(&assembly, &wishes);
        assert_eq!(found.steps.len(), assembly.count() - 1);
        for step in &found.steps {
            assert!(!step.group.contains(&held) && step.measured, "{step:?}");
        }
    }
}

/// Either of two parts with a way of several legs can be the one that is held.
#[test]
fn the_other_part_leaves_on_several_legs() {
    let Some(folder) = support::shared("the_other_part_leaves_on_several_legs") else {
        return;
    };
    let assembly = support::load(&folder.join("10_extraction"), "cross_pin.step");
    for held in [0, 1] {
        let wishes = Wishes {
            held: vec![held],
            down: None,
        };
        let found = taken_apart(&assembly, &wishes);
        assert_eq!(found.steps[0].group, [1 - held]);
        assert!(found.steps[0].path.legs.len() > 1);
    }
}

#[test]
fn two_held_parts_are_not_taken_apart() {
    let assembly = support::own(OWN);
    let wishes = Wishes {
        held: vec![0, 1],
        down: None,
    };
    let found = taken_apart(&assembly, &wishes);
    assert_eq!(found.steps.len(), assembly.count() - 2);
    let moved = |part: usize| found.steps.iter().any(|step| step.group.contains(&part));
    assert!(!moved(0) && !moved(1));
}

/// What falls, moved down as one, meets nothing that stays; and every part that stays is held, stands lowest, is gripped, or meets another one that stays.
fn falls_as_stated(assembly: &Assembly, wishes: &Wishes) -> usize {
    let down = wishes.down.expect("gravity");
    let edges = graph(assembly);
    let grips = |a: usize, b: usize| {
        (edges.edge_weights())
            .filter(|edge| edge.parts == [a.min(b), a.max(b)])
            .any(|edge| edge.kinds.iter().any(|kind| kind.kind().grips))
    };
    let meets = |parts: &[usize], others: &[usize]| {
        let moved = Moved {
            parts,
            by: DAffine3::IDENTITY,
        };
        let fall = Motion::slide(down * 0.5);
        assembly.free_share(&moved, others, &fall, 0.02).0 < 1.0
    };
    let lowest = |part: usize| {
        let shape = &assembly.model.shapes[assembly.model.parts[part].shape];
        let heights =
            (shape.mesh.vertices.iter()).map(|p| assembly.placement(part).transform_point3(*p).dot(down));
        heights.fold(f64::NEG_INFINITY, f64::max)
    };
    let found = taken_apart(assembly, wishes);
    let mut falls = 0;
    for step in &found.steps {
        falls += step.falls.len();
        let stays: Vec<usize> = (step.onto.iter().copied())
            .filter(|part| !step.falls.contains(part))
            .collect();
        if !step.falls.is_empty() {
            assert!(!meets(&step.falls, &stays), "{wishes:?}: {step:?}");
        }
        for &part in &step.falls {
            assert!(
                !stays.iter().any(|&other| grips(part, other)),
                "{wishes:?}: {step:?}"
            );
        }
        let is_fixed = step.onto.iter().any(|part| wishes.held.contains(part));
        let floor = step
            .onto
            .iter()
            .map(|&part| lowest(part))
            .fold(f64::NEG_INFINITY, f64::max);
        for &part in &stays {
            let others: Vec<usize> = stays.iter().copied().filter(|other| *other != part).collect();
            let stands = if is_fixed {
                wishes.held.contains(&part)
            } else {
                // Boxes of tilted parts are larger than the parts.
                lowest(part) >= floor - 5.0
            };
            let is_gripped = others.iter().any(|&other| grips(part, other));
            assert!(
                stands || is_gripped || meets(&[part], &others),
                "{wishes:?}, part {part}: {step:?}"
            );
        }
    }
    falls
}

#[test]
fn what_is_said_to_fall_falls() {
    let assembly = support::own(OWN);
    let mut falls = 0;
    for down in [
        DVec3::NEG_Z,
        DVec3::Z,
        DVec3::X,
        DVec3::NEG_Y,
        DVec3::new(0.48, 0.6, -0.64),
    ] {
        for held in [vec![], vec![0]] {
            let down = Some(down);
            falls += falls_as_stated(&assembly, &Wishes { held, down });
        }
    }
    assert!(falls > 0, "nothing ever falls");
}

#[test]
fn the_board_falls_out_of_a_box_that_is_upside_down() {
    let Some(folder) = support::shared("the_board_falls_out_of_a_box_that_is_upside_down") else {
        return;
    };
    let assembly = support::load(&folder.join("10_extraction"), "box_with_board.step");
    let board = assembly.part("board").unwrap();
    for (down, falls) in [(DVec3::NEG_Z, vec![]), (DVec3::Z, vec![board])] {
        let wishes = Wishes {
            held: vec![assembly.part("box").unwrap()],
            down: Some(down),
        };
        falls_as_stated(&assembly, &wishes);
        let found = taken_apart(&assembly, &wishes);
        // The step before the last: the lid on the box with the board.
        let lid = &found.steps[found.steps.len() - 2];
        assert_eq!(lid.group, [assembly.part("lid").unwrap()]);
        assert_eq!(lid.falls, falls);
    }
}

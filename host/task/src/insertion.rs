//! Steps of a sequence as a hand does them: a part, or a group held by one of its parts, brought from outside into its place.

use glam::DAffine3;

use crate::assembly::Assembly;
use crate::report::waypoints;
use crate::sequence::{Sequence, Step};

/// A part or group that is put onto others.
#[derive(Clone, Debug, PartialEq)]
pub struct Insertion {
    /// The part that a hand holds: of a group the largest.
    pub part: usize,
    /// Parts that move with it as one.
    pub with: Vec<usize>,
    /// Parts that are in place meanwhile; those of other subassemblies are not there.
    pub onto: Vec<usize>,
    /// Poses of the part's shape in the assembly's frame, mm, from outside into its place. Between two of them the origin moves linearly and the turn is at
    /// constant rate; by less than a degree wherever it turns.
    pub way: Vec<DAffine3>,
}

/// The steps of a sequence in the order of assembly. A step in which several parts are put onto a single one is done the other way round, the single part
/// moving.
pub fn insertions(assembly: &Assembly, found: &Sequence) -> Vec<Insertion> {
    (found.steps.iter().rev())
        .map(|step| insertion(assembly, step))
        .collect()
}

fn insertion(assembly: &Assembly, step: &Step) -> Insertion {
    let (start, inward) = step.path.reversed();
    // Of the step's group, from its place.
    let moved = waypoints(&inward, start).into_iter();
    let moved = moved.map(|waypoint| waypoint.pose());
    let volume = |part: usize| assembly.body(part).surface().shape().volume_mm3.abs();
    let (group, onto, moved): (_, _, Vec<DAffine3>) = match (&step.group[..], &step.onto[..]) {
        (group, [part]) if group.len() > 1 => (
            vec![*part],
            group.to_vec(),
            moved.map(|by| by.inverse()).collect(),
        ),
        (group, onto) => (group.to_vec(), onto.to_vec(), moved.collect()),
    };
    let largest = (group.iter().copied()).max_by(|a, b| volume(*a).total_cmp(&volume(*b)));
    let part = largest.unwrap_or_default();
    Insertion {
        part,
        with: group.into_iter().filter(|other| *other != part).collect(),
        onto,
        way: (moved.into_iter())
            .map(|by| by * assembly.placement(part))
            .collect(),
    }
}

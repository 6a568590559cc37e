//! Steps of a sequence that a hand can do: one part at a time, brought from outside into its place.

use glam::DAffine3;

use crate::assembly::Assembly;
use crate::report::waypoints;
use crate::sequence::{Sequence, Step};

/// One part that is put onto others.
#[derive(Clone, Debug, PartialEq)]
pub struct Insertion {
    /// The part that moves.
    pub part: usize,
    /// Parts that are in place meanwhile; those of other subassemblies are not there.
    pub onto: Vec<usize>,
    /// Poses of its shape in the assembly's frame, mm, from outside into its place. Between two of them the origin moves linearly and the turn is at
    /// constant rate; by less than a degree wherever it turns.
    pub way: Vec<DAffine3>,
}

/// The steps of a sequence in the order of assembly. A step in which several parts are put onto a single one is done the other way round, the single part
/// moving; one that brings two groups together is `Err`, because a hand holds one part.
pub fn insertions<'a>(assembly: &Assembly, found: &'a Sequence) -> Vec<Result<Insertion, &'a Step>> {
    (found.steps.iter().rev())
        .map(|step| insertion(assembly, step).ok_or(step))
        .collect()
}

fn insertion(assembly: &Assembly, step: &Step) -> Option<Insertion> {
    let (start, inward) = step.path.reversed();
    // Of the step's group, from its place.
    let moved = waypoints(&inward, start)
        .into_iter()
        .map(|waypoint| waypoint.pose());
    let way = |part: usize, moved: &mut dyn Iterator<Item = DAffine3>| {
        moved.map(|by| by * assembly.placement(part)).collect()
    };
    match (step.group.as_slice(), step.onto.as_slice()) {
        (&[part], onto) => Some(Insertion {
            part,
            onto: onto.to_vec(),
            way: way(part, &mut { moved }),
        }),
        (group, &[part]) => Some(Insertion {
            part,
            onto: group.to_vec(),
            way: way(part, &mut moved.map(|by| by.inverse())),
        }),
        _ => None,
    }
}

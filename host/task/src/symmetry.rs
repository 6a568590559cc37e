//! Turns that change nothing, so that a search need not make them.

use crate::assembly::{Assembly, Moved};
use crate::line::Line;
use crate::motion::Motion;

/// Turns, radians, after which a part that is made of surfaces of revolution about an axis still lies in itself, and by how much a sample may leave it, mm.
const TURNS: [f64; 3] = [0.7, 1.9, 2.9];
const ITSELF_MM: f64 = 2e-3;

/// Whether a turn of a moved group about `axis` changes nothing: each of its parts is made of surfaces of revolution about it.
pub(crate) fn turns_into_itself(assembly: &Assembly, group: &Moved<'_>, axis: &Line) -> bool {
    group.parts.iter().all(|&part| {
        let placed = assembly.placed(part, group.by);
        TURNS.iter().all(|&angle| {
            let turn = Motion::turn(axis.point, axis.direction, angle);
            let turned = placed.pose.inverse() * turn.at(1.0) * placed.pose;
            let mut samples = placed.body.samples().iter();
            samples.all(|s| {
                !placed
                    .body
                    .exceeds(turned.transform_point3(s.position), ITSELF_MM)
            })
        })
    })
}

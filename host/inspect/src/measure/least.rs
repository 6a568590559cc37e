//! The least distance of two placed entities.
//!
//! Each end is projected on the other's entity, in turn, which never lengthens the distance (alternating projections; Cheney & Goldstein 1959). Between
//! surfaces that are nearly parallel each turn moves little: the move is repeated, twice as long each time, while that shortens the distance.
//! At rest each end is the other's nearest point, so the distance is exact to the second order of what is left to move.
//!
//! Cost: one projection a start, about 600 for two faces, and at most some hundreds for each of the [`DESCENTS`] best: milliseconds.

use glam::{DAffine3, DVec3};

use super::entity::{Entity, Kind};
use super::line::{Straight, nearest_of};

/// An entity at a pose.
#[derive(Clone, Copy)]
pub struct Placed<'a> {
    /// The entity.
    pub entity: &'a Entity,
    /// Frame of its shape to world: a rigid motion.
    pub pose: DAffine3,
}

/// A least distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Least {
    /// Distance, mm: 0 where the two meet.
    pub distance_mm: f64,
    /// Where: on the first and on the second, world, mm.
    pub ends: [DVec3; 2],
}

/// Starts from which a search goes on to rest.
const DESCENTS: usize = 5;
/// Most turns of a descent.
const TURNS: usize = 300;
/// Shortening by a turn below which a descent rests, mm.
const REST_MM: f64 = 1e-12;
/// Most doublings of a move.
const DOUBLINGS: usize = 40;

impl Placed<'_> {
    fn nearest(&self, p: DVec3) -> DVec3 {
        let local = self.pose.inverse().transform_point3(p);
        self.pose.transform_point3(self.entity.nearest(local))
    }

    fn starts(&self) -> impl Iterator<Item = DVec3> {
        let starts = self.entity.starts();
        starts.into_iter().map(|p| self.pose.transform_point3(p))
    }

    /// The entity as a straight piece or a point, if it is one.
    fn straight(&self) -> Option<Straight> {
        match &self.entity.kind {
            Kind::Line { straight, .. } => Some(straight.placed(&self.pose)),
            Kind::Axis { line, .. } => Some(Straight::whole(line.placed(&self.pose))),
            _ => None,
        }
    }
}

/// Least distance of `a` and `b`. Where several places are equally near, one of them.
pub fn least(a: Placed<'_>, b: Placed<'_>) -> Least {
    if let (Some(s), Some(t)) = (a.straight(), b.straight()) {
        return of(nearest_of(s, t));
    }
    // A point rests at once.
    if let Kind::Point(p) = a.entity.kind {
        let p = a.pose.transform_point3(p);
        return of([p, b.nearest(p)]);
    }
    if let Kind::Point(q) = b.entity.kind {
        let q = b.pose.transform_point3(q);
        return of([a.nearest(q), q]);
    }
    let found = best_starts(&a, &b);
    let rested = found.into_iter().map(|start| descend(&a, &b, start));
    rested
        .min_by(|s, t| s.distance_mm.total_cmp(&t.distance_mm))
        .unwrap_or_else(|| of([a.pose.translation; 2]))
}

fn of(ends: [DVec3; 2]) -> Least {
    Least {
        distance_mm: ends[0].distance(ends[1]),
        ends,
    }
}

/// The nearest pairs of ends, apart from each other by a share of the size of all. One end of each is only near its entity.
fn best_starts(a: &Placed<'_>, b: &Placed<'_>) -> Vec<Least> {
    let forth = a.starts().map(|p| of([p, b.nearest(p)]));
    let back = b.starts().map(|q| of([a.nearest(q), q]));
    let mut all: Vec<Least> = forth.chain(back).collect();
    all.sort_by(|s, t| s.distance_mm.total_cmp(&t.distance_mm));
    let size = all
        .iter()
        .map(|s| s.ends[0].distance(all[0].ends[0]))
        .fold(0.0, f64::max);
    let mut chosen: Vec<Least> = Vec::new();
    for start in all {
        let apart = |c: &Least| c.ends[0].distance(start.ends[0]) >= 0.1 * size;
        if chosen.len() < DESCENTS && chosen.iter().all(apart) {
            chosen.push(start);
        }
    }
    chosen
}

/// Goes from the first of a pair of ends to a pair at rest.
fn descend(a: &Placed<'_>, b: &Placed<'_>, start: Least) -> Least {
    let step = |p: DVec3| {
        let q = b.nearest(p);
        of([a.nearest(q), q])
    };
    let mut at = step(a.nearest(start.ends[0]));
    for _ in 0..TURNS {
        let next = step(at.ends[0]);
        let before = at.distance_mm;
        let way = next.ends[0] - at.ends[0];
        if next.distance_mm < at.distance_mm {
            at = next;
        }
        let mut stride = way;
        for _ in 0..DOUBLINGS {
            let onward = step(a.nearest(at.ends[0] + stride));
            if onward.distance_mm >= at.distance_mm {
                break;
            }
            at = onward;
            stride *= 2.0;
        }
        if before - at.distance_mm <= REST_MM {
            break;
        }
    }
    at
}

//! The least distance of two placed entities.
//!
//! Each end is projected on the other's entity, in turn, which never lengthens the distance (alternating projections; Cheney & Goldstein 1959). Between
//! surfaces that are nearly parallel each turn moves little: the move is repeated, twice as long each time, while that shortens the distance.
//! Where the walls of a tight fit run side by side a turn moves less than its rounding, far from the narrowest place. So where the turns rest, the
//! distance is sampled around the end, and the least sample or the least point of the parabola through the samples is the next end (Newton's method with
//! differences in a trust region: the spacing of the samples grows while they shorten the distance, else shrinks). At rest each end is the other's
//! nearest point, so the distance is exact to the second order of what is left to move.
//!
//! Cost: one projection a start, about 600 for two faces, and at most two thousand for each of the [`DESCENTS`] best: milliseconds.

use glam::{DAffine3, DMat2, DVec2, DVec3};

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
/// Spacing of the first samples around an end at rest, of the widest and of the last ones, as shares of the size of both entities.
const FIRST_SPACING: f64 = 0.02;
const WIDEST_SPACING: f64 = 0.2;
const LAST_SPACING: f64 = 1e-6;
/// Factors of the spacing where no sample shortens the distance, and where one does.
const FINER: f64 = 0.25;
const WIDER: f64 = 2.0;
/// Most spacings.
const SPACINGS: usize = 60;
/// Longest move of one parabola, in spacings.
const LONGEST_MOVE: f64 = 8.0;

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
    let (found, size) = best_starts(&a, &b);
    let rested = found
        .into_iter()
        .map(|start| settle(&a, &b, descend(&a, &b, start), size));
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

/// The nearest pairs of ends, apart from each other by a share of the size of all, and that size, mm. One end of each is only near its entity.
fn best_starts(a: &Placed<'_>, b: &Placed<'_>) -> (Vec<Least>, f64) {
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
    (chosen, size)
}

/// A pair of ends, the second nearest to `p` and the first nearest to that.
fn turn(a: &Placed<'_>, b: &Placed<'_>, p: DVec3) -> Least {
    let q = b.nearest(p);
    of([a.nearest(q), q])
}

/// Goes from the first of a pair of ends to a pair at rest.
fn descend(a: &Placed<'_>, b: &Placed<'_>, start: Least) -> Least {
    let step = |p: DVec3| turn(a, b, p);
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

/// Goes on from a pair of ends at rest to the least points of parabolas through distances around the first of them.
fn settle(a: &Placed<'_>, b: &Placed<'_>, rested: Least, size: f64) -> Least {
    let mut at = rested;
    let mut spacing = FIRST_SPACING;
    for _ in 0..SPACINGS {
        match nearer(a, b, at, spacing * size) {
            Some(next) => {
                at = next;
                spacing = (WIDER * spacing).min(WIDEST_SPACING);
            }
            None => spacing *= FINER,
        }
        if spacing < LAST_SPACING {
            break;
        }
    }
    at
}

/// A nearer pair of ends by samples at `spacing` around the first end, across the line between the ends; `None` where none shortens the distance by more
/// than [`REST_MM`].
fn nearer(a: &Placed<'_>, b: &Placed<'_>, at: Least, spacing: f64) -> Option<Least> {
    let [p, q] = at.ends;
    let normal = (p - q).try_normalize()?;
    let u = normal.any_orthonormal_vector();
    let axes = [u, normal.cross(u)];
    let moved = |x: f64, y: f64| turn(a, b, a.nearest(p + (x * axes[0] + y * axes[1]) * spacing));
    let around = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 1.0)];
    let samples = around.map(|(x, y)| moved(x, y));
    let [east, west, north, south, corner] = samples.map(|sample| sample.distance_mm);
    let here = at.distance_mm;
    let slope = DVec2::new(east - west, north - south) / 2.0;
    let curvature = DVec2::new(east + west, north + south) - 2.0 * here;
    let twist = corner - here - slope.x - slope.y - (curvature.x + curvature.y) / 2.0;
    let hessian = DMat2::from_cols(DVec2::new(curvature.x, twist), DVec2::new(twist, curvature.y));
    let mut moves = Vec::new();
    if hessian.determinant() > 0.0 && curvature.x > 0.0 {
        moves.push(-(hessian.inverse() * slope));
    }
    // Along a ridge or an end of an entity each axis by itself.
    for (axis, bend) in [(DVec2::X, curvature.x), (DVec2::Y, curvature.y)] {
        if bend > 0.0 {
            moves.push(-axis * slope.dot(axis) / bend);
        }
    }
    let tried = (moves.into_iter().filter(|v| v.is_finite()))
        .map(|v| v.clamp_length_max(LONGEST_MOVE))
        .map(|v| moved(v.x, v.y));
    (tried.chain(samples))
        .min_by(|s, t| s.distance_mm.total_cmp(&t.distance_mm))
        .filter(|best| here - best.distance_mm > REST_MM)
}

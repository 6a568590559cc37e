//! Contact exclusions: leaves whose points a target keeps apart from everything they could meet, and which the search skips.
//!
//! A fully engaged target keeps the part on its axis. Its mating faces, whose gaps have an allowance there (see `constraints::targets`), cannot
//! touch: coaxial cylinders of radii R and r are R − r apart, less the part's offset from the axis. As long as
//!
//! e + θ·l + 2·Δ + slack ≤ (R − r) + allowance
//!
//! no point of one face can become a contact with the other. e and θ are the remaining offset and angle; l is the lever arm from the axis' point to
//! the part's farthest point; Δ is the motion of a tick, the larger of the last one and the one without contacts. The target then forms a *contact
//! exclusion*: the search skips leaves of the sphere tree whose points can meet only the other face, until the object has travelled to where that may
//! end. The rendered force is the same to the bit with and without; an exclusion forms and ends without a step because it changes only the work.
//!
//! Whether a leaf's points can meet another face is queried from the field, as seldom as nodes are: for all points at once by the faces of the bricks
//! around them, or for each point by the cells next to it. The reads count in the budget at their cost, and a tick starts no further exclusion query
//! once they have taken a twelfth of its budget; leaves without an answer are searched as usual.
//!
//! R − r is taken from the scene's own exact surfaces, not from the target: faces that do not match the target are searched as usual. So are conical
//! and flat faces, which have a stop of their own along the axis, and all other faces of both parts: a bolt's head still lands.

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::{EDGE_ERROR_CELLS, PointRecord};

use crate::collision::cost::{EXCLUSION, EXCLUSION_READS, LOOKUP};
use crate::collision::directed_pair::DirectedPair;
use crate::collision::rules::{FacePairRules, MAX_EXCLUDED, holds};
use crate::collision::search::Traversal;

/// Distance around a leaf's points within which cells must name the mating face only, in cells: half a brick, or else the next cell.
const FAR_CELLS: f32 = 4.0;
const NEXT_CELLS: f32 = 1.0;
/// Smallest clear distance worth storing, cells.
const MIN_CLEAR_CELLS: f32 = 0.5;
/// Reads per exclusion query at most: the reads for 8 points that each lie in a corner of bricks which hold other faces too.
const MAX_READS: u32 = 1000;

/// A tick starts no further exclusion query once they have taken one part in this many of its budget, in field queries of [`LOOKUP`] each.
const EXCLUSION_SHARE: u32 = 12;

impl<R: FacePairRules> Traversal<'_, '_, '_, R> {
    /// Distance that the object may travel before a point of the leaf at `points` could touch anything but the faces that exclusions keep it from, m.
    /// `None` when that is unknown, too short to store, or this tick has made enough exclusion queries.
    pub(crate) fn excluded(&mut self, pair: &DirectedPair<'_>, points: &[PointRecord]) -> Option<f32> {
        let common = mates(pair, points)?;
        if !self.may_query_exclusion() {
            return None;
        }
        let cell = pair.field.record().cell;
        let mut left = MAX_READS;
        let mut only = |[low, high]: [Vec3; 2], reach: f32, mates: &[u16]| {
            let (low, high) = ((low - reach).to_array(), (high + reach).to_array());
            (pair.field).only(low, high, &mut left, |surface| {
                mates.contains(&pair.surfaces.face_of(surface))
            })
        };
        // All points at once by their bricks, or else each point by the cells around it.
        if !common.is_empty() && only(bounds(pair, points)?, FAR_CELLS, &common) {
            self.count_exclusion(0, MAX_READS - left, 0);
            return Some(FAR_CELLS * cell);
        }
        let (mut clear, mut looked_up) = (NEXT_CELLS, 0);
        let (mut mates, mut last) = (common, None);
        for point in points {
            if last.replace(own(point)) != Some(own(point)) {
                mates = mates_of(pair, point);
            }
            if !mates.is_empty() && only(pair.in_cells(point), NEXT_CELLS, &mates) {
                continue;
            }
            // Not on a mating face, or near another face: use the distance to the field's shape.
            looked_up += 1;
            let reach = pair.span(point).map_or(0.0, |span| span.reach());
            let far = (pair.distance(point.position) - reach) / cell - EDGE_ERROR_CELLS;
            if far < clear {
                clear = far;
            }
            if clear < MIN_CLEAR_CELLS {
                break;
            }
        }
        self.count_exclusion(points.len() as u32, MAX_READS - left, looked_up);
        (clear >= MIN_CLEAR_CELLS).then_some(clear * cell)
    }

    /// Whether this tick may make another exclusion query. A leaf without one is searched, with the same force, and queried again before long.
    fn may_query_exclusion(&self) -> bool {
        self.exclusion_work < LOOKUP * self.search.budget / EXCLUSION_SHARE
    }

    /// Charges an exclusion query: points evaluated one by one, reads, and field queries of points at two [`LOOKUP`]s each.
    fn count_exclusion(&mut self, one_by_one: u32, reads: u32, looked_up: u32) {
        let spent = EXCLUSION + LOOKUP * (one_by_one + 2 * looked_up) + LOOKUP * reads / EXCLUSION_READS;
        self.exclusion_work += spent;
        self.spent += spent;
    }
}

/// Faces that a point lies on.
fn own(point: &PointRecord) -> [u16; 2] {
    [point.face, point.edge_face]
}

/// Faces of the field's shape that exclusions keep the point from.
fn mates_of(pair: &DirectedPair<'_>, point: &PointRecord) -> Vec<u16, MAX_EXCLUDED> {
    (pair.excluded.iter())
        .filter(|[tree, _]| holds(own(point), *tree))
        .map(|&[_, field]| field)
        .collect()
}

/// Faces that exclusions keep every one of the points from; `None` where no point is kept from any face.
fn mates(pair: &DirectedPair<'_>, points: &[PointRecord]) -> Option<Vec<u16, MAX_EXCLUDED>> {
    let (mut common, mut any) = (None::<Vec<u16, MAX_EXCLUDED>>, false);
    let mut last = None;
    for point in points {
        // Consecutive points mostly lie on the same faces.
        if last.replace(own(point)) == Some(own(point)) {
            continue;
        }
        let mates = mates_of(pair, point);
        any |= !mates.is_empty();
        match &mut common {
            Some(common) => common.retain(|face| mates.contains(face)),
            None => common = Some(mates),
        }
    }
    common.filter(|_| any)
}

/// Bounding box of the points, in cells of the field.
fn bounds(pair: &DirectedPair<'_>, points: &[PointRecord]) -> Option<[Vec3; 2]> {
    let all = points.iter().map(|point| pair.in_cells(point));
    all.reduce(|[low, high], [from, to]| [low.min(from), high.max(to)])
}

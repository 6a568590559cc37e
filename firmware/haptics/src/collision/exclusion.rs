//! Exclusions: what a target keeps apart needs no looking at.
//!
//! A target that is fully engaged keeps the part on its axis, and its mating faces, which make room for each other there ([`crate::guidance`]),
//! cannot touch: coaxial cylinders of radii R and r are R − r apart, less what the part is off the axis. As long as
//!
//! e + θ·l + 2·Δ + slack ≤ (R − r) + room
//!
//! (e, θ: offset and angle left; l: lever from the axis' point to the part's farthest; Δ: what the motion so far, or that without contacts, adds in a
//! tick) no point of one face can become a contact with the other. Then the target is a *exclusion*, and leaves of the sphere tree whose points meet
//! nothing but the other face are passed over until the object has travelled to where that may end. What is felt is the same to the bit
//! with and without: a exclusion forms and ends without a step because it changes the work and nothing else.
//!
//! Whether a leaf's points meet nothing else is asked of the field, as seldom as the field is asked about nodes: of all of them at once by what the
//! bricks about them have to do with, or of each by the cells next to it. What is read is counted in the budget for what it takes, and a tick begins
//! no more once it has spent a twelfth of its budget so: leaves not asked about are looked at as ever.
//!
//! R − r is taken from the scene's own exact surfaces, not from the target: faces that are not what the target says stay in the work. So do
//! conical and flat ones, which have a stop of their own along the axis, and all others of both parts: a bolt's head still lands.

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::{EDGE_ERROR_CELLS, PointRecord};

use crate::collision::cost::{EXCLUSION, EXCLUSION_READS, LOOKUP};
use crate::collision::directed_pair::DirectedPair;
use crate::collision::rules::{MAX_EXCLUDED, holds};
use crate::collision::search::Traversal;

/// Around a leaf's points, cells that must hold the mating face and no other: half a brick, or else the next.
const FAR_CELLS: f32 = 4.0;
const NEXT_CELLS: f32 = 1.0;
/// A way shorter than this is not worth remembering.
const LEAST_CLEAR_CELLS: f32 = 0.5;
/// Read for one answer, at most: what 8 points take that each lie in a corner of bricks which hold other faces too.
const MOST_READS: u32 = 1000;

/// A tick asks about no further leaf once asking has counted one part in so many of its budget of look-ups, each [`LOOKUP`].
const EXCLUSION_SHARE: u32 = 12;

impl Traversal<'_, '_, '_> {
    /// How far the object may travel before a point of the leaf at `points` could touch anything but what exclusions keep it from, m; none when that is
    /// not known, or hardly any way, or enough leaves were asked about in this tick.
    pub(crate) fn excluded(&mut self, pair: &DirectedPair<'_>, points: &[PointRecord]) -> Option<f32> {
        let common = mates(pair, points)?;
        if !self.may_query_exclusion() {
            return None;
        }
        let cell = pair.field.record().cell;
        let mut left = MOST_READS;
        let mut only = |[low, high]: [Vec3; 2], reach: f32, mates: &[u16]| {
            let (low, high) = ((low - reach).to_array(), (high + reach).to_array());
            (pair.field).only(low, high, &mut left, |face| mates.contains(&face))
        };
        // All of them at once by what bricks say, or else each by the cells about it.
        if !common.is_empty() && only(bounds(pair, points)?, FAR_CELLS, &common) {
            self.count_exclusion(0, MOST_READS - left, 0);
            return Some(FAR_CELLS * cell);
        }
        let (mut clear, mut looked_up) = (NEXT_CELLS, 0);
        let (mut mates, mut last) = (common, None);
        for point in points {
            if last.replace(own(point)) != Some(own(point)) {
                mates = mates_of(pair, point);
            }
            let at = Vec3::from_array(pair.in_cells(point));
            if !mates.is_empty() && only([at; 2], NEXT_CELLS, &mates) {
                continue;
            }
            // Not a mating face's, or near another: as far as it is from everything.
            looked_up += 1;
            let far = pair.distance(point.position) / cell - EDGE_ERROR_CELLS;
            if far < clear {
                clear = far;
            }
            if clear < LEAST_CLEAR_CELLS {
                break;
            }
        }
        self.count_exclusion(points.len() as u32, MOST_READS - left, looked_up);
        (clear >= LEAST_CLEAR_CELLS).then_some(clear * cell)
    }

    /// Whether this tick may still ask what exclusions keep apart. A leaf not asked about is looked at, which is felt the same, and asked about again
    /// before long.
    fn may_query_exclusion(&self) -> bool {
        self.exclusion_work < LOOKUP * self.search.budget / EXCLUSION_SHARE
    }

    /// The surroundings of a leaf were looked at: so many points by themselves, so much read, and so many points looked up, at two look-ups each.
    fn count_exclusion(&mut self, one_by_one: u32, reads: u32, looked_up: u32) {
        let spent = EXCLUSION + LOOKUP * (one_by_one + 2 * looked_up) + LOOKUP * reads / EXCLUSION_READS;
        self.exclusion_work += spent;
        self.spent += spent;
    }
}

/// The faces that a point lies on.
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

/// Those that exclusions keep every one of the points from; `None` where they keep none of them from any.
fn mates(pair: &DirectedPair<'_>, points: &[PointRecord]) -> Option<Vec<u16, MAX_EXCLUDED>> {
    let (mut common, mut any) = (None::<Vec<u16, MAX_EXCLUDED>>, false);
    let mut last = None;
    for point in points {
        // Points that follow each other mostly have the same faces.
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

/// Least and largest of the points' coordinates, in cells of the field.
fn bounds(pair: &DirectedPair<'_>, points: &[PointRecord]) -> Option<[Vec3; 2]> {
    let mut all = points.iter().map(|point| Vec3::from_array(pair.in_cells(point)));
    let first = all.next()?;
    Some(all.fold([first; 2], |[low, high], at| [low.min(at), high.max(at)]))
}

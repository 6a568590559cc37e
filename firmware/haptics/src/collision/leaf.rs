//! The points of one leaf: which are looked at, and what is noted of them.

use mortise_protocol::image::PointRecord;

use crate::collision::coherence::Due;
use crate::collision::cost::{AT_WALL, FIND_WALL, LOOKUP, NOTED};
use crate::collision::directed_pair::Job;
use crate::collision::exact_surface::on_face;
use crate::collision::face_cache::Wall;
use crate::collision::node_cursor::Leaf;
use crate::collision::node_key::{ALL, Key, Points};
use crate::collision::search::Walk;

/// Leaves of which it is found out in one tick how far the points are that thinning leaves out.
const LEFT_OUT_LEAVES: u32 = 8;
/// It is asked for as far as the points go in so many ticks like the last one,
const FREE_TICKS: f32 = 64.0;
/// and this far, m,
const FREE_M: f32 = 50e-6;
/// but no farther than this many cells: the band in which cells name faces is not much wider.
const FREE_CELLS: f32 = 0.5;
/// and not at all where so few ticks would use that up.
const LEAST_TICKS: f32 = 8.0;
/// In one tick it is asked of so many leaves at most.
const WALLS: u32 = 2;
/// See [`Job::wall`].
const FREE_READS: u32 = 200;

impl Walk<'_, '_, '_> {
    /// All points of a leaf, as far as the budget goes, and when it is due again.
    pub fn points(&mut self, job: &Job<'_>, leaf: Leaf, points: &[PointRecord]) -> Due {
        let most = (self.left() as usize).min(points.len());
        let mut seen = Seen::new(self.search.near());
        match self.coherence.wall(job.keys.of(leaf.node), all_of(points)) {
            Wall::Face(face) if most == points.len() && most <= Points::BITS as usize => {
                seen.price = AT_WALL;
                for point in points {
                    seen.add(self.at_wall(job, leaf, point, face));
                }
            }
            _ => {
                for point in points.iter().take(most) {
                    seen.add(self.point(job, leaf, point));
                }
            }
        }
        self.seen(job, leaf, points, seen)
    }

    /// The same when points are left out: only those of the `mask` are offered as contacts.
    ///
    /// The others are looked at in some leaves a tick, so that more and more of what is left out is known to be far.
    #[inline(never)]
    pub fn thinned(&mut self, job: &Job<'_>, leaf: Leaf, points: &[PointRecord], mask: Points) -> Due {
        if self.left_out == LEFT_OUT_LEAVES || job.field.is_occupancy() {
            self.some(job, leaf, points, mask & all_of(points));
            return Due::NOW;
        }
        self.left_out += 1;
        let most = (self.left() as usize).min(points.len());
        let mut seen = Seen::new(self.search.near());
        for point in points.iter().take(most) {
            seen.add(job.distance(point.position));
        }
        self.some(job, leaf, points, seen.near & mask);
        let before = self.spent;
        let due = self.seen(job, leaf, points, seen);
        // Not what there would be twice as much of with twice the points.
        self.aside += self.spent - before;
        due
    }

    /// Notes what was `seen` of a leaf, and tells when it is due again.
    #[inline(always)]
    fn seen(&mut self, job: &Job<'_>, leaf: Leaf, points: &[PointRecord], seen: Seen) -> Due {
        self.work.points += seen.points;
        self.spent += (seen.price + NOTED) * seen.points;
        // What was not looked at could be anywhere.
        if (seen.points as usize) < points.len() {
            return Due::NOW;
        }
        let key = job.keys.of(leaf.node);
        if seen.near == 0 {
            return self.coherence.set_far(key, seen.beyond);
        }
        if seen.points <= Points::BITS {
            self.coherence.set_points(key, seen.near, seen.beyond);
        }
        Due::NOW
    }

    /// Those points of a leaf, which were near before.
    #[inline(always)]
    pub fn some(&mut self, job: &Job<'_>, leaf: Leaf, points: &[PointRecord], which: Points) {
        let looked_at = which.count_ones();
        self.work.points += looked_at;
        let key = job.keys.of(leaf.node);
        match self.coherence.wall(key, which) {
            Wall::Face(face) => {
                self.spent += AT_WALL * looked_at;
                for point in these(points, which) {
                    let _ = self.at_wall(job, leaf, point, face);
                }
                return;
            }
            Wall::Several => {}
            Wall::Unknown => self.find_wall(job, key, points, which),
        }
        self.spent += LOOKUP * looked_at;
        for point in these(points, which) {
            let _ = self.point(job, leaf, point);
        }
    }

    /// As [`Walk::point`] for one that has to do with this face alone.
    #[inline(always)]
    fn at_wall(&mut self, job: &Job<'_>, leaf: Leaf, point: &PointRecord, face: u16) -> f32 {
        let in_field = job.to_field.apply(point.position);
        match on_face(job.faces, face, in_field) {
            Some(found) => {
                if found.distance < self.search.margin {
                    self.near(job, leaf, point, &found);
                }
                found.distance
            }
            None => self.point(job, leaf, point),
        }
    }

    /// Notes what those points of a leaf have to do with.
    #[inline(never)]
    fn find_wall(&mut self, job: &Job<'_>, key: Key, points: &[PointRecord], which: Points) {
        let most = FREE_CELLS * job.field.record().cell;
        let way = self.search.way;
        if self.asked_walls == WALLS || job.field.is_occupancy() || most < LEAST_TICKS * way {
            return;
        }
        self.asked_walls += 1;
        self.spent += FIND_WALL;
        let ahead = FREE_TICKS * way + FREE_M;
        let free = if ahead < most { ahead } else { most };
        let wall = job.wall(these(points, which), free, FREE_READS);
        self.coherence.set_wall(key, which, wall, free);
    }
}

/// All of a leaf's points that can be told apart.
#[inline(always)]
fn all_of(points: &[PointRecord]) -> Points {
    ALL.checked_shr(Points::BITS.saturating_sub(points.len() as u32))
        .unwrap_or(0)
}

/// Those of a leaf's points.
#[inline(always)]
fn these(points: &[PointRecord], mut which: Points) -> impl Iterator<Item = &PointRecord> {
    core::iter::from_fn(move || {
        let point = points.get(which.trailing_zeros() as usize);
        which &= which.wrapping_sub(1);
        point
    })
}

/// What points of a leaf told.
struct Seen {
    /// How many.
    points: u32,
    /// What counts as near, m.
    limit: f32,
    /// Eighths of a look-up that each took.
    price: u32,
    /// Those that are near.
    near: Points,
    /// Smallest gap of the others, m.
    beyond: f32,
}

impl Seen {
    fn new(limit: f32) -> Self {
        Self {
            points: 0,
            limit,
            price: LOOKUP,
            near: 0,
            beyond: f32::INFINITY,
        }
    }

    /// The next point has this gap.
    #[inline(always)]
    fn add(&mut self, gap: f32) {
        if gap > self.limit {
            if gap < self.beyond {
                self.beyond = gap;
            }
        } else {
            self.near |= 1 << (self.points % Points::BITS);
        }
        self.points += 1;
    }
}

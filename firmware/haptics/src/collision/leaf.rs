//! The points of one leaf: which are looked at, and what is noted of them.

use mortise_protocol::image::PointRecord;

use crate::collision::coherence::Bound;
use crate::collision::cost::{CACHED_POINT, FIND_FACE, LOOKUP, NOTED};
use crate::collision::directed_pair::DirectedPair;
use crate::collision::exact_surface::on_face;
use crate::collision::face_cache::CachedFace;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::node_key::{ALL, Key, Points};
use crate::collision::search::Traversal;

/// Leaves of which it is found out in one tick how far the points are that decimation leaves out.
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
const MAX_FINDS: u32 = 2;
/// See [`DirectedPair::wall`].
const FREE_READS: u32 = 200;

impl Traversal<'_, '_, '_> {
    /// All points of a leaf, as far as the budget goes, and when it is due again.
    pub fn points(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, points: &[PointRecord]) -> Bound {
        let most = (self.left() as usize).min(points.len());
        let mut seen = Seen::new(self.search.near());
        match self
            .coherence
            .cached_face(pair.keys.of(leaf.node), all_of(points))
        {
            CachedFace::Face(face) if most == points.len() && most <= Points::BITS as usize => {
                seen.price = CACHED_POINT;
                for point in points {
                    seen.add(self.on_cached_face(pair, leaf, point, face));
                }
            }
            _ => {
                for point in points.iter().take(most) {
                    seen.add(self.point(pair, leaf, point));
                }
            }
        }
        self.seen(pair, leaf, points, seen)
    }

    /// The same when points are left out: only those of the `mask` are offered as contacts.
    ///
    /// The others are looked at in some leaves a tick, so that more and more of what is left out is known to be far.
    #[inline(never)]
    pub fn decimated(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        points: &[PointRecord],
        mask: Points,
    ) -> Bound {
        if self.left_out == LEFT_OUT_LEAVES || pair.field.is_occupancy() {
            self.some(pair, leaf, points, mask & all_of(points));
            return Bound::NOW;
        }
        self.left_out += 1;
        let most = (self.left() as usize).min(points.len());
        let mut seen = Seen::new(self.search.near());
        for point in points.iter().take(most) {
            seen.add(pair.distance(point.position));
        }
        self.some(pair, leaf, points, seen.near & mask);
        let before = self.spent;
        let due = self.seen(pair, leaf, points, seen);
        // Not what there would be twice as much of with twice the points.
        self.aside += self.spent - before;
        due
    }

    /// Notes what was `seen` of a leaf, and tells when it is due again.
    #[inline(always)]
    fn seen(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        points: &[PointRecord],
        seen: Seen,
    ) -> Bound {
        self.work.points += seen.points;
        self.spent += (seen.price + NOTED) * seen.points;
        // What was not looked at could be anywhere.
        if (seen.points as usize) < points.len() {
            return Bound::NOW;
        }
        let key = pair.keys.of(leaf.node);
        if seen.near == 0 {
            return self.coherence.set_far(key, seen.beyond);
        }
        if seen.points <= Points::BITS {
            self.coherence.set_points(key, seen.near, seen.beyond);
        }
        Bound::NOW
    }

    /// Those points of a leaf, which were near before.
    #[inline(always)]
    pub fn some(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, points: &[PointRecord], which: Points) {
        let looked_at = which.count_ones();
        self.work.points += looked_at;
        let key = pair.keys.of(leaf.node);
        match self.coherence.cached_face(key, which) {
            CachedFace::Face(face) => {
                self.spent += CACHED_POINT * looked_at;
                for point in these(points, which) {
                    let _ = self.on_cached_face(pair, leaf, point, face);
                }
                return;
            }
            CachedFace::Several => {}
            CachedFace::Unknown => self.find_face(pair, key, points, which),
        }
        self.spent += LOOKUP * looked_at;
        for point in these(points, which) {
            let _ = self.point(pair, leaf, point);
        }
    }

    /// As [`Traversal::point`] for one that has to do with this face alone.
    #[inline(always)]
    fn on_cached_face(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        point: &PointRecord,
        face: u16,
    ) -> f32 {
        let in_field = pair.to_field.apply(point.position);
        match on_face(pair.faces, face, in_field) {
            Some(found) => {
                if found.distance < self.search.margin {
                    self.near(pair, leaf, point, &found);
                }
                found.distance
            }
            None => self.point(pair, leaf, point),
        }
    }

    /// Notes what those points of a leaf have to do with.
    #[inline(never)]
    fn find_face(&mut self, pair: &DirectedPair<'_>, key: Key, points: &[PointRecord], which: Points) {
        let most = FREE_CELLS * pair.field.record().cell;
        let way = self.search.way;
        if self.faces_sought == MAX_FINDS || pair.field.is_occupancy() || most < LEAST_TICKS * way {
            return;
        }
        self.faces_sought += 1;
        self.spent += FIND_FACE;
        let ahead = FREE_TICKS * way + FREE_M;
        let free = if ahead < most { ahead } else { most };
        let face = pair.only_face_near(these(points, which), free, FREE_READS);
        self.coherence.cache_face(key, which, face, free);
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

//! The points of one leaf: which are looked at, and what is noted of them.

use mortise_protocol::image::PointRecord;

use crate::coherence::{ALL, Due, Keys, Points};
use crate::job::Job;
use crate::proximity::{LOOKUP, Leaf, Walk};

/// Thinning up to which some point of every leaf is looked at: most leaves have 8 points or a few more.
const LEAF_THINNING: u8 = 3;
/// Which points of a leaf are looked at, by thinning.
const THINNED: [Points; LEAF_THINNING as usize + 1] = [ALL, 0x5555, 0x1111, 0x0101];
/// Leaves of which it is found out in one tick how far the points are that thinning leaves out.
const LEFT_OUT_LEAVES: u32 = 16;
/// A look-up whose gap is noted, besides.
const NOTED: u32 = 2;

impl Walk<'_, '_, '_> {
    /// All points of a leaf, as far as the budget goes, and when it is due again.
    pub fn points(&mut self, job: &Job<'_>, leaf: Leaf, points: &[PointRecord]) -> Due {
        let most = (self.left() as usize).min(points.len());
        let mut seen = Seen::new(self.search.near());
        for point in points.iter().take(most) {
            seen.add(self.point(job, leaf, point));
        }
        self.seen(job, leaf, points, seen)
    }

    /// The same when points are left out: only those of the `mask` are offered as contacts.
    ///
    /// The others are looked at in some leaves a tick, so that more and more of what is left out is known to be far.
    #[inline(never)]
    pub fn thinned(&mut self, job: &Job<'_>, leaf: Leaf, points: &[PointRecord], mask: Points) -> Due {
        if self.left_out == LEFT_OUT_LEAVES || job.field.is_occupancy() {
            let all = ALL.checked_shr(Points::BITS.saturating_sub(points.len() as u32));
            self.some(job, leaf, points, mask & all.unwrap_or(0));
            return Due::NOW;
        }
        self.left_out += 1;
        let most = (self.left() as usize).min(points.len());
        let mut seen = Seen::new(self.search.near());
        for point in points.iter().take(most) {
            seen.add(job.distance(point.position));
        }
        self.some(job, leaf, points, seen.near & mask);
        self.seen(job, leaf, points, seen)
    }

    /// Notes what was `seen` of a leaf, and tells when it is due again.
    #[inline(always)]
    fn seen(&mut self, job: &Job<'_>, leaf: Leaf, points: &[PointRecord], seen: Seen) -> Due {
        self.work.points += seen.points;
        self.spent += (LOOKUP + NOTED) * seen.points;
        // What was not looked at could be anywhere.
        if (seen.points as usize) < points.len() {
            return Due::NOW;
        }
        let key = Keys::new(leaf.job, job.nodes.len()).of(leaf.node);
        if seen.near == 0 {
            return self.coherence.set_far(key, seen.beyond);
        }
        if seen.points <= Points::BITS {
            self.coherence.set_points(key, seen.near, seen.beyond);
        }
        Due::NOW
    }

    /// Those points of a leaf.
    #[inline(always)]
    pub fn some(&mut self, job: &Job<'_>, leaf: Leaf, points: &[PointRecord], mut which: Points) {
        let looked_at = which.count_ones();
        self.work.points += looked_at;
        self.spent += LOOKUP * looked_at;
        while which != 0 {
            if let Some(point) = points.get(which.trailing_zeros() as usize) {
                let _ = self.point(job, leaf, point);
            }
            which &= which - 1;
        }
    }
}

/// Which points of a leaf are looked at. When one of each leaf is too many, whole leaves are left out, evenly too.
#[inline]
pub(crate) fn mask(thinning: u8, first_point: u32) -> Points {
    let leaves = (1u32 << thinning.saturating_sub(LEAF_THINNING)) - 1;
    if (first_point >> LEAF_THINNING) & leaves != 0 {
        0
    } else {
        THINNED[usize::from(thinning.min(LEAF_THINNING))]
    }
}

/// What points of a leaf told.
struct Seen {
    /// How many.
    points: u32,
    /// What counts as near, m.
    limit: f32,
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

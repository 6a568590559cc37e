//! Evaluation of one leaf: the choice of points to query, and the advancement bound stored for the rest.

use mortise_protocol::image::{NO_SPAN, PointRecord};

use crate::collision::coherence::Bound;
use crate::collision::cost::{CACHED_POINT, FIND_FACE, LOOKUP, NOTED, SURFACE};
use crate::collision::directed_pair::DirectedPair;
use crate::collision::exact_surface::on_surface_of;
use crate::collision::face_cache::CachedFace;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::node_key::{ALL, Key, Points};
use crate::collision::rules::FacePairRules;
use crate::collision::search::Traversal;
use crate::math::scalar::smaller;

/// Leaves per tick whose decimated points are queried for their distance.
const MAX_DECIMATED_QUERIES: u32 = 8;
/// A cached face must hold for the motion of this many ticks like the last one,
const CLEARANCE_TICKS: f32 = 64.0;
/// plus this distance, m,
const CLEARANCE_M: f32 = 50e-6;
/// but for no more than this many cells: the band in which cells name faces is not much wider.
const MAX_CLEARANCE_CELLS: f32 = 0.5;
/// A face is not searched for where fewer ticks than this would use up that clearance.
const MIN_CLEARANCE_TICKS: f32 = 8.0;
/// Face searches per tick.
const MAX_FACE_SEARCHES: u32 = 2;
/// Limit on reads of the field per face search; see [`DirectedPair::only_face_near`].
const FACE_SEARCH_READS: u32 = 200;

impl<R: FacePairRules> Traversal<'_, '_, '_, R> {
    /// Queries all points of a leaf as far as the budget allows. Returns the leaf's advancement bound.
    pub fn points(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, points: &[PointRecord]) -> Bound {
        let count = (self.left() as usize).min(points.len());
        let mut scan = LeafScan::new(self.search.near());
        let key = pair.keys.of(leaf.node);
        match self.coherence.cached_face(key, all_of(points)) {
            CachedFace::Face(face) if count == points.len() && count <= Points::BITS as usize => {
                scan.price = CACHED_POINT;
                for point in points {
                    scan.add(self.on_cached_face(pair, leaf, point, face));
                }
                scan.beyond = smaller(scan.beyond, self.coherence.cached_face_rest(key));
            }
            _ => {
                for point in points.iter().take(count) {
                    scan.add(self.point(pair, leaf, point));
                }
            }
        }
        self.record_scan(pair, leaf, points, scan)
    }

    /// As [`Self::points`] under decimation: only points in the `mask` are offered as contacts.
    ///
    /// In up to [`MAX_DECIMATED_QUERIES`] leaves per tick the distances of all points are measured, so that more and more decimated points are known
    /// to be far.
    #[inline(never)]
    pub fn decimated(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        points: &[PointRecord],
        mask: Points,
    ) -> Bound {
        if self.decimated_queries == MAX_DECIMATED_QUERIES || pair.field.is_occupancy() {
            self.selected_points(pair, leaf, points, mask & all_of(points));
            return Bound::NOW;
        }
        self.decimated_queries += 1;
        let count = (self.left() as usize).min(points.len());
        let mut scan = LeafScan::new(self.search.near());
        for point in points.iter().take(count) {
            let reach = pair.span(point).map_or(0.0, |span| span.reach());
            scan.add(pair.distance(point.position) - reach);
        }
        let surfaces = self.charge_surfaces(pair);
        self.selected_points(pair, leaf, points, scan.near & mask);
        let before = self.spent;
        let bound = self.record_scan(pair, leaf, points, scan);
        // This work would not double with twice the points.
        self.decimation_work += surfaces + self.spent - before;
        bound
    }

    /// Charges the surfaces of a pair that were evaluated since this was last done; returns how much.
    pub fn charge_surfaces(&mut self, pair: &DirectedPair<'_>) -> u32 {
        let cost = SURFACE * pair.surfaces_read();
        self.spent += cost;
        cost
    }

    /// Stores what the `scan` of a leaf found, and returns the leaf's advancement bound.
    #[inline(always)]
    fn record_scan(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        points: &[PointRecord],
        scan: LeafScan,
    ) -> Bound {
        self.work.points += scan.points;
        self.spent += (scan.price + NOTED) * scan.points;
        // Points that were not queried have no bound.
        if (scan.points as usize) < points.len() {
            return Bound::NOW;
        }
        let key = pair.keys.of(leaf.node);
        if scan.near == 0 {
            return self.coherence.set_far(key, scan.beyond);
        }
        if scan.points <= Points::BITS {
            self.coherence.set_points(key, scan.near, scan.beyond);
        }
        Bound::NOW
    }

    /// Queries the selected points of a leaf: those that were near before.
    #[inline(always)]
    pub fn selected_points(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        points: &[PointRecord],
        selection: Points,
    ) {
        let count = selection.count_ones();
        self.work.points += count;
        let key = pair.keys.of(leaf.node);
        match self.coherence.cached_face(key, selection) {
            CachedFace::Face(face) => {
                self.spent += CACHED_POINT * count;
                for point in selected(points, selection) {
                    let _ = self.on_cached_face(pair, leaf, point, face);
                }
                return;
            }
            CachedFace::Several => {}
            CachedFace::Unknown => self.find_face(pair, key, points, selection),
        }
        self.spent += LOOKUP * count;
        for point in selected(points, selection) {
            let _ = self.point(pair, leaf, point);
        }
    }

    /// As [`Traversal::point`], for a point near which this face is the only one.
    #[inline(always)]
    fn on_cached_face(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        point: &PointRecord,
        face: u16,
    ) -> f32 {
        if point.span != NO_SPAN {
            return self.span(pair, leaf, point, Some(face));
        }
        let in_field = pair.to_field.apply(point.position);
        match on_surface_of(pair.surfaces, face, in_field) {
            Some(found) => {
                if found.distance < self.search.margin {
                    self.near(pair, leaf, point, &found);
                }
                found.distance
            }
            None => self.point(pair, leaf, point),
        }
    }

    /// Searches for the one face near the selected points of a leaf, and caches the result.
    #[inline(never)]
    fn find_face(&mut self, pair: &DirectedPair<'_>, key: Key, points: &[PointRecord], selection: Points) {
        let max_clearance = MAX_CLEARANCE_CELLS * pair.field.record().cell;
        let travel = self.search.way;
        if self.face_searches == MAX_FACE_SEARCHES
            || pair.field.is_occupancy()
            || max_clearance < MIN_CLEARANCE_TICKS * travel
        {
            return;
        }
        self.face_searches += 1;
        self.spent += FIND_FACE;
        let wanted = CLEARANCE_TICKS * travel + CLEARANCE_M;
        let clearance = if wanted < max_clearance {
            wanted
        } else {
            max_clearance
        };
        let face = pair.only_face_near(selected(points, selection), clearance, FACE_SEARCH_READS);
        self.coherence.cache_face(key, selection, face, clearance);
    }
}

/// Selection of all points of a leaf, up to the number of bits.
#[inline(always)]
fn all_of(points: &[PointRecord]) -> Points {
    ALL.checked_shr(Points::BITS.saturating_sub(points.len() as u32))
        .unwrap_or(0)
}

/// The selected points of a leaf.
#[inline(always)]
fn selected(points: &[PointRecord], mut selection: Points) -> impl Iterator<Item = &PointRecord> {
    core::iter::from_fn(move || {
        let point = points.get(selection.trailing_zeros() as usize);
        selection &= selection.wrapping_sub(1);
        point
    })
}

/// Distances found for the points of a leaf.
struct LeafScan {
    /// Number of points queried.
    points: u32,
    /// Largest gap that counts as near, m.
    limit: f32,
    /// Cost of each query, eighths of a field query.
    price: u32,
    /// Selection of near points.
    near: Points,
    /// Smallest gap of the other points, m.
    beyond: f32,
}

impl LeafScan {
    fn new(limit: f32) -> Self {
        Self {
            points: 0,
            limit,
            price: LOOKUP,
            near: 0,
            beyond: f32::INFINITY,
        }
    }

    /// Adds the gap of the next point, m.
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

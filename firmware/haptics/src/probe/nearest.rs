//! Smallest gap or largest depth of two parts: branch and bound over the trees and fields of the contact search.
//!
//! A sphere whose lower bound exceeds the smallest gap found so far is skipped. One traversal in each direction takes all points whose distance a
//! field query places nearer than that, by the exact surfaces of their cells, and offers overlapping points as contacts. Until it has found a point in
//! the band, leaves beyond the band are deferred, for their bounds are loose and seldom needed afterwards. A last traversal in each direction takes the
//! deferred leaves. When the band held no point, it first descends by the nearer child, for an initial gap to compare with.
//!
//! The result is that of the samples: [`super::clearance`] proves the gap of the surfaces.

use glam::Vec3;
use mortise_protocol::image::{
    Cell, EDGE_ERROR_CELLS, NO_FACE, NO_SPAN, Nearby, NodeRecord, Place, PointRecord, Shape,
};

use crate::collision::directed_pair::DirectedPair;
use crate::collision::exact_surface::{OnFace, agreeing, beside_edge, exact, on_surface_of};
use crate::collision::rules::FacePairRules;
use crate::collision::search::Traversal;
use crate::collision::span::{Course, Effort, deepest};
use crate::collision::span_search::near_at;
use crate::io::Work;
use crate::math::scalar::larger;

/// The search along a span ends at the rounding of positions.
const ALONG_SPAN: Effort = Effort {
    steps: 12,
    least_gain_m: 0.01e-6,
};
/// Diagonal of a cell, cells: interpolation this far below the band's end uses no clamped sample.
const DIAGONAL_CELLS: f32 = 1.733;

/// What a distance of overlapping parts is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Depth of the deepest point of one part in the other.
    DeepestPoint,
    /// Smallest translation that separates the parts: both are convex.
    Translation,
}

/// The smallest gap between two parts, or the largest depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Signed distance, m: positive for a gap, negative for a depth. Of the analytic surfaces where an error is stated, else of samples in the field or
    /// the voxmap's tangent planes.
    pub distance_m: f32,
    /// Smallest distance by the field itself among the points queried, m: the distance that the tick uses. Infinite when no point lay where the field
    /// stores distances.
    pub field_distance_m: f32,
    /// Error bound of `distance_m`, m; infinite where only `in_band` is known.
    pub error_m: f32,
    /// Whether the distance is proven to be the exact surfaces', within a micrometre.
    pub exact: bool,
    /// What a negative distance is.
    pub measure: Measure,
    /// Whether the point lies where the field stores distances, or past a tangent plane. When neither this nor `exact`, the distance is only a bound:
    /// the gap or depth is at least this large.
    pub in_band: bool,
    /// Lever arm from the moving part's centre of mass to the point, axes of the fixed part, m.
    pub arm: Vec3,
    /// Face of the moving part, [`mortise_protocol::image::NO_FACE`] when unknown.
    pub moving_face: u16,
    /// Face of the fixed part, [`mortise_protocol::image::NO_FACE`] when unknown.
    pub fixed_face: u16,
}

impl Nearest {
    /// Before anything is queried.
    pub(crate) const UNKNOWN: Self = Self {
        distance_m: f32::INFINITY,
        field_distance_m: f32::INFINITY,
        error_m: f32::INFINITY,
        exact: false,
        measure: Measure::DeepestPoint,
        in_band: false,
        arm: Vec3::ZERO,
        moving_face: NO_FACE,
        fixed_face: NO_FACE,
    };
}

/// Result so far, over both directions.
pub(crate) struct Progress {
    /// The nearest point.
    pub best: Nearest,
    /// Whether its distance is that to exact surfaces, so that the gap is no larger: not interpolated, and not a bound.
    pub settled: bool,
    /// Work done.
    pub work: Work,
}

impl Progress {
    /// Nothing queried yet.
    pub fn new() -> Self {
        Self {
            best: Nearest::UNKNOWN,
            settled: false,
            work: Work::default(),
        }
    }

    /// Distance beyond which a point is neither nearest nor overlapping, m.
    #[inline]
    fn limit(&self) -> f32 {
        if self.best.distance_m > 0.0 {
            self.best.distance_m
        } else {
            0.0
        }
    }
}

/// Search in one direction.
pub(crate) struct NearestSearch<'s, 'i> {
    pair: &'s DirectedPair<'i>,
    /// The shape whose field is queried.
    shape: &'s Shape<'i>,
    /// Largest distance that the field stores, m.
    band: f32,
    /// Largest interpolated distance without clamped samples, m.
    resolved: f32,
    /// Largest overestimate by interpolation, m.
    edge_error: f32,
    /// Leaves beyond the band are deferred before this node.
    deferred_end: u32,
    /// Lower bound of the distances in deferred leaves, m.
    deferred_bound: f32,
}

/// A leaf to be evaluated.
struct PendingLeaf<'i> {
    node: u32,
    points: &'i [PointRecord],
    /// Lower bound of its points' distances, m.
    bound: f32,
    /// Whether its centre lies beyond the band: its points are unlikely to be nearest.
    beyond: bool,
}

/// Result of one field query for a point.
struct PointSample {
    /// Distance to the face where `settled`, else interpolated or a bound, m.
    distance: f32,
    /// Lower bound of the distance, m.
    lower: f32,
    /// Distance that the tick uses, m; infinite where nothing is stored.
    rendered: f32,
    /// Whether the tick may make it push.
    overlaps: bool,
    inside: bool,
    /// Nearest surface, if known.
    surface: u16,
    in_band: bool,
    /// Whether an edge itself is nearest: then the surfaces give only a bound.
    edge_nearest: bool,
    /// Whether `distance` is that to an analytic face.
    settled: bool,
    /// Whether `distance` is that to an edge of analytic faces.
    at_edge: bool,
}

impl PointSample {
    /// A point neither inside nor in the band.
    const NOTHING: Self = Self {
        distance: f32::INFINITY,
        lower: f32::INFINITY,
        rendered: f32::INFINITY,
        overlaps: false,
        inside: false,
        surface: NO_FACE,
        in_band: false,
        edge_nearest: false,
        settled: false,
        at_edge: false,
    };
}

impl<'s, 'i> NearestSearch<'s, 'i> {
    /// Search that has not begun.
    pub fn new(pair: &'s DirectedPair<'i>, shape: &'s Shape<'i>) -> Self {
        let record = shape.field.record();
        Self {
            pair,
            shape,
            band: record.band,
            resolved: record.band - DIAGONAL_CELLS * record.cell,
            edge_error: EDGE_ERROR_CELLS * record.cell,
            deferred_end: 0,
            deferred_bound: f32::INFINITY,
        }
    }

    /// Evaluates all leaves that could hold the nearest point or an overlapping one, and their points. Overlapping points
    /// go to `contacts`. Leaves beyond the band are deferred until a point in the band is found.
    pub fn traverse(
        &mut self,
        progress: &mut Progress,
        contacts: &mut Traversal<'_, '_, '_, impl FacePairRules>,
    ) {
        self.leaves(progress, u32::MAX, |search, progress, leaf| {
            if progress.best.distance_m > search.band {
                search.deferred_end = leaf.node + 1;
                if leaf.beyond {
                    search.deferred_bound = search.deferred_bound.min(leaf.bound);
                    return;
                }
            }
            search.evaluate(&leaf, progress, contacts);
        });
    }

    /// Evaluates the leaves that [`Self::traverse`] deferred.
    pub fn finish(
        &mut self,
        progress: &mut Progress,
        contacts: &mut Traversal<'_, '_, '_, impl FacePairRules>,
    ) {
        let needed = |lower: f32, limit: f32| lower < f32::INFINITY && lower <= limit;
        if needed(self.deferred_bound, progress.limit()) && progress.best.distance_m > self.band {
            self.descend(progress);
        }
        if !needed(self.deferred_bound, progress.limit()) {
            return;
        }
        self.leaves(progress, self.deferred_end, |search, progress, leaf| {
            if !leaf.beyond {
                return;
            }
            search.evaluate(&leaf, progress, contacts);
        });
    }

    /// Takes the points of a leaf, spans at their lowest place, and offers the overlapping ones.
    fn evaluate(
        &self,
        leaf: &PendingLeaf<'i>,
        progress: &mut Progress,
        contacts: &mut Traversal<'_, '_, '_, impl FacePairRules>,
    ) {
        for point in leaf.points {
            let point = &self.lowest(point, progress.limit());
            let sample = self.sample(point);
            if sample.overlaps {
                contacts.one(self.pair, leaf.node, point, self.found(&sample, point));
            }
            self.take(&sample, point, progress);
        }
        progress.work.points += leaf.points.len() as u32;
    }

    /// The point, or the lowest place of its span, if that can be nearer than `limit`, m.
    #[inline]
    fn lowest(&self, point: &PointRecord, limit: f32) -> PointRecord {
        let alone = PointRecord {
            span: NO_SPAN,
            ..*point
        };
        let Some(span) = self.pair.span(point) else {
            return alone;
        };
        let place = |u: f32| PointRecord {
            span: NO_SPAN,
            ..self.pair.moved(point, u)
        };
        // By the distance that is reported, which beside edges is nearer the truth than a rule's bound.
        let at = |u: f32| self.sample(&place(u)).distance;
        let Some(first) = near_at(self.pair, None, span.middle()) else {
            // The middle is outside of all cells, or deep inside.
            return if self.sample(&alone).lower - span.reach() > limit {
                alone
            } else {
                place(deepest((0.0, at(0.0)), at))
            };
        };
        if first.found.distance - span.reach() > limit {
            return alone;
        }
        let near = |p| near_at(self.pair, None, p);
        let (mut u, lowest) = Course::new(self.pair.surfaces, &span, first).lowest(&span, ALONG_SPAN, near);
        if lowest.found.distance < 0.0 {
            u = deepest((u, at(u)), at);
        }
        place(u)
    }

    /// Descends by the nearer child to one leaf, and takes the point of it that seems nearest. Terminates because every step goes forward.
    fn descend(&mut self, progress: &mut Progress) {
        let nodes = self.pair.nodes;
        let mut index = 0;
        while let Some(node) = nodes.get(index) {
            let end = node.skip as usize;
            if end == index + 1 {
                let mut nearest = None;
                for point in node.points(self.pair.points) {
                    progress.work.points += 1;
                    let sample = self.sample(point);
                    if (nearest.as_ref())
                        .is_none_or(|(other, _): &(PointSample, _)| sample.distance < other.distance)
                    {
                        nearest = Some((sample, point));
                    }
                }
                if let Some((sample, point)) = nearest {
                    self.take(&sample, point, progress);
                }
                return;
            }
            let mut child = index + 1;
            let mut nearest = (f32::INFINITY, child);
            while child < end
                && let Some(node) = nodes.get(child)
            {
                let (bound, _) = self.bound(node, progress);
                if bound < nearest.0 {
                    nearest = (bound, child);
                }
                child = node.skip as usize;
            }
            index = nearest.1;
        }
    }

    /// Passes to `visit` every leaf before node `end` that may hold an overlapping point or one nearer than the nearest so far.
    #[inline]
    fn leaves(
        &mut self,
        progress: &mut Progress,
        end: u32,
        mut visit: impl FnMut(&mut Self, &mut Progress, PendingLeaf<'i>),
    ) {
        let nodes = self.pair.nodes.get(..end as usize).unwrap_or(self.pair.nodes);
        let mut index = 0;
        while let Some(node) = nodes.get(index) {
            let (bound, beyond) = self.bound(node, progress);
            if bound > progress.limit() {
                index = node.skip as usize;
                continue;
            }
            if node.skip as usize == index + 1 {
                let points = node.points(self.pair.points);
                visit(
                    self,
                    progress,
                    PendingLeaf {
                        node: index as u32,
                        points,
                        bound,
                        beyond,
                    },
                );
            }
            index += 1;
        }
    }

    /// Lower bound of the signed distance of any point below a node, m; and whether its centre lies beyond the band.
    #[inline(always)]
    fn bound(&self, node: &NodeRecord, progress: &mut Progress) -> (f32, bool) {
        progress.work.nodes += 1;
        let center = self.pair.to_field.apply(node.center);
        let (distance, is_bound) = self.node_distance(center);
        // Inside, a bound says how deep at least, not at most.
        if is_bound && distance < 0.0 {
            return (f32::NEG_INFINITY, false);
        }
        // Inside, a clamped distance and a bound beyond the band say how deep at least, not at most.
        if distance < -self.resolved {
            return (f32::NEG_INFINITY, false);
        }
        // No sample exceeds the band, so this distance is not interpolated.
        let beyond = distance > self.band + self.edge_error;
        let error = if beyond { 0.0 } else { self.edge_error };
        (distance - (node.radius + error), beyond)
    }

    /// Signed distance of a node's centre, m, and whether surfaces at an edge give only a bound of it.
    #[inline(always)]
    fn node_distance(&self, center: Vec3) -> (f32, bool) {
        match self.pair.field.place(center.to_array()) {
            Place::Cell(cell) if !cell.has_samples() => {
                let nearby = self.pair.field.nearby(&cell);
                let by_surfaces = exact(self.shape.surfaces(), nearby, center);
                let is_bound = !matches!(nearby, Nearby::Face(_));
                by_surfaces.map_or((f32::NEG_INFINITY, true), |(distance, _)| (distance, is_bound))
            }
            _ => (self.pair.field.bound(center.to_array()), false),
        }
    }

    #[inline(always)]
    fn in_field(&self, point: &PointRecord) -> Vec3 {
        self.pair.to_field.apply(point.position)
    }

    /// Queries the field at a point.
    #[inline(always)]
    fn sample(&self, point: &PointRecord) -> PointSample {
        let p = self.in_field(point);
        match self.pair.field.place(p.to_array()) {
            Place::Cell(cell) => {
                let nearby = self.pair.field.nearby(&cell);
                let exact = exact(self.shape.surfaces(), nearby, p);
                if let Some((distance, surface)) = exact
                    // A patch is exact within the baker's tolerance only.
                    && usize::from(surface) < self.shape.faces.len()
                    && distance.abs() <= self.resolved
                    && match nearby {
                        Nearby::Convex(_) => distance <= 0.0,
                        Nearby::Reentrant(_) => distance >= 0.0,
                        _ => true,
                    }
                {
                    return PointSample {
                        distance,
                        lower: distance,
                        rendered: distance,
                        overlaps: distance < 0.0,
                        inside: distance < 0.0,
                        surface,
                        in_band: true,
                        edge_nearest: false,
                        settled: true,
                        at_edge: false,
                    };
                }
                self.interpolated(&cell, nearby, exact, p)
            }
            Place::Far { inside, bound } => {
                // Inside a bound says how deep at least, not at most.
                PointSample {
                    distance: if inside { -bound } else { bound },
                    lower: if inside { f32::NEG_INFINITY } else { bound },
                    overlaps: inside,
                    inside,
                    ..PointSample::NOTHING
                }
            }
        }
    }

    /// Distance at `p` where the cell's faces do not settle it; `exact` is what they give.
    fn interpolated(
        &self,
        cell: &Cell<'_>,
        nearby: Nearby,
        exact: Option<(f32, u16)>,
        p: Vec3,
    ) -> PointSample {
        let interpolated = match exact {
            // Without samples surfaces answer, at an edge by a bound.
            Some((distance, _)) if !cell.has_samples() => distance,
            _ => self.pair.field.distance(cell),
        };
        let mut sample = PointSample {
            distance: interpolated,
            lower: interpolated - self.edge_error,
            rendered: interpolated,
            surface: nearby.face(),
            ..PointSample::NOTHING
        };
        if let Some((distance, surface)) = exact {
            sample.rendered = distance;
            sample.edge_nearest = match nearby {
                Nearby::Convex(_) => distance > 0.0,
                Nearby::Reentrant(_) => distance < 0.0,
                _ => false,
            };
            if !sample.edge_nearest {
                (sample.distance, sample.lower, sample.surface) = (distance, distance, surface);
            } else {
                let beside = beside_edge(self.shape.surfaces(), nearby, p);
                sample.at_edge = beside.is_some();
                // The faces' distance is a lower bound of the right sign.
                sample.distance = beside.unwrap_or(distance);
                if distance > 0.0 {
                    sample.lower = larger(sample.lower, distance);
                }
            }
        }
        sample.overlaps = sample.rendered < 0.0;
        sample.inside = sample.distance < 0.0;
        sample.in_band = sample.surface != NO_FACE && sample.distance.abs() <= self.resolved;
        if sample.distance < -self.resolved {
            sample.lower = f32::NEG_INFINITY;
        }
        sample
    }

    /// Surface that pushes a settled point.
    fn found(&self, sample: &PointSample, point: &PointRecord) -> Option<OnFace> {
        if !sample.settled {
            return None;
        }
        let found = on_surface_of(self.shape.surfaces(), sample.surface, self.in_field(point))?;
        Some(OnFace {
            distance: sample.distance,
            ..found
        })
    }

    /// Uses a point by its most accurate distance.
    #[inline(always)]
    fn take(&self, sample: &PointSample, point: &PointRecord, progress: &mut Progress) {
        if sample.rendered < progress.best.field_distance_m {
            progress.best.field_distance_m = sample.rendered;
        }
        if sample.lower > progress.best.distance_m {
            return;
        }
        let at_face = self.at_face(sample, point);
        let distance_m = at_face.unwrap_or(sample.distance);
        if distance_m < progress.best.distance_m {
            progress.settled = at_face.is_some() || sample.at_edge;
            let face = self.shape.surfaces().face_of(sample.surface);
            let (moving_face, fixed_face) = if self.pair.backward {
                (face, point.face)
            } else {
                (point.face, face)
            };
            progress.best = Nearest {
                distance_m,
                field_distance_m: progress.best.field_distance_m,
                error_m: f32::INFINITY,
                exact: false,
                measure: Measure::DeepestPoint,
                in_band: sample.in_band,
                arm: self.pair.to_arm.apply(point.position),
                moving_face,
                fixed_face,
            };
        }
    }

    /// Distance to the nearest face's surface, where that is the distance of the point.
    #[inline(always)]
    fn at_face(&self, sample: &PointSample, point: &PointRecord) -> Option<f32> {
        if sample.settled {
            return Some(sample.distance);
        }
        if sample.in_band && !sample.edge_nearest {
            return agreeing(self.shape, sample.surface, self.in_field(point), sample.distance);
        }
        None
    }
}

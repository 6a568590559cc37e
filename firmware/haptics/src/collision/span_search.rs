//! Search for the place of a span that touches.

use glam::Vec3;
use mortise_protocol::image::{Cell, NO_FACE, Place, PointRecord};

use crate::collision::cost::{CACHED_POINT, LOOKUP, SPAN};
use crate::collision::directed_pair::DirectedPair;
use crate::collision::exact_surface::{OnFace, exact_on_face, on_surface_of};
use crate::collision::node_cursor::NodeCursor;
use crate::collision::rules::FacePairRules;
use crate::collision::search::{APPROACH, LEAST_GRADIENT2, Search, Traversal};
use crate::collision::span::{Course, IN_TICK, Near, Span};
use crate::math::scalar::{inverse_sqrt, smaller};

/// Angle by which the normal of a surface turns along half a span, rad: as far as the span itself turns.
const SPAN_TURN: f32 = 0.4;
/// Places of a span that are looked at where its middle is outside of all cells.
const PLACES: u32 = 5;

impl<R> Search<'_, '_, R>
where
    R: FacePairRules,
{
    /// Whether a place of the span of `point` at least `gap` (m) from a surface of normal `normal` (field frame, at the span's middle) may be a candidate.
    #[inline]
    fn may_touch(&self, pair: &DirectedPair<'_>, point: &PointRecord, gap: f32, normal: Vec3) -> bool {
        let (n, arm) = (pair.to_push * normal, pair.to_arm.apply(point.position));
        let turn = arm.cross(n) * self.inverse_length;
        let approach = self.approach(&[n.x, n.y, n.z, turn.x, turn.y, turn.z]);
        gap < self.slack + approach + APPROACH * SPAN_TURN * (self.margin - self.slack)
    }
}

impl<R: FacePairRules> Traversal<'_, '_, '_, R> {
    /// As [`Traversal::point`], for a span of an edge: its lowest place is offered. `face`: the only one near the span, if known.
    ///
    /// A straight edge is one span however long it is: the search follows the surface below its middle, and another one may be nearer at an end. Hence what is
    /// returned for it is a lower bound all along the span. Spans of curved edges are short, so that their middles are near the same face as their ends.
    #[inline(never)]
    pub fn span(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        point: &PointRecord,
        face: Option<u16>,
    ) -> f32 {
        let Some(span) = pair.span(point) else {
            return self.alone(pair, leaf, point);
        };
        self.spent += SPAN;
        let Some(first) = near_at(pair, face, span.middle()) else {
            return self.apart(pair, leaf, point, &span);
        };
        let course = Course::new(pair.surfaces, &span, first);
        let bound = course.lower_bound(&span, face.is_some());
        let may_touch =
            bound <= self.search.margin && self.search.may_touch(pair, point, bound, first.found.normal);
        let gap = if may_touch {
            self.lowest(pair, leaf, point, (&span, &course), face)
        } else {
            bound
        };
        if face.is_none() && span.is_straight() {
            smaller(gap, first.found.distance - span.reach())
        } else {
            gap
        }
    }

    /// As [`Self::span`], where the middle is outside of all cells: of [`PLACES`] places of the span the nearest is offered.
    #[inline(never)]
    fn apart(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, point: &PointRecord, span: &Span) -> f32 {
        let bound = pair.distance(point.position) - span.reach();
        if bound > self.search.margin {
            return bound;
        }
        let mut nearest = (f32::INFINITY, 0.0);
        for k in 0..PLACES {
            self.spent += LOOKUP;
            let u = (2 * k + 1) as f32 / PLACES as f32 - 1.0;
            let distance = pair.distance(pair.moved(point, u).position);
            if distance < nearest.0 {
                nearest = (distance, u);
            }
        }
        if nearest.0 < self.search.margin {
            let _ = self.alone(pair, leaf, &pair.moved(point, nearest.1));
        }
        nearest.0 - span.longest(1.0 / PLACES as f32)
    }

    /// Offers the lowest place of a span.
    #[inline(never)]
    fn lowest(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        point: &PointRecord,
        (span, course): (&Span, &Course),
        face: Option<u16>,
    ) -> f32 {
        let price = if face.is_some() { CACHED_POINT } else { LOOKUP };
        let (u, lowest) = course.lowest(span, IN_TICK, |p| {
            self.spent += price;
            near_at(pair, face, p)
        });
        let at = pair.moved(point, u);
        if !lowest.alone {
            self.spent += LOOKUP;
            return self.alone(pair, leaf, &at);
        }
        if lowest.found.distance < self.search.margin {
            self.near(pair, leaf, &at, &lowest.found);
        }
        lowest.found.distance
    }

    /// As [`Traversal::place`], out of line.
    #[inline(never)]
    fn alone(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, point: &PointRecord) -> f32 {
        self.place(pair, leaf, point)
    }
}

/// Surface of the field's shape nearest to `p`: the `face`, if that is known to be the only one near; else by the exact surfaces that the cell names, or by
/// the field's gradient where they do not answer. `None` outside of all cells and where there is no direction.
#[inline(always)]
pub(crate) fn near_at(pair: &DirectedPair<'_>, face: Option<u16>, p: Vec3) -> Option<Near> {
    if let Some(face) = face
        && let Some(found) = on_surface_of(pair.surfaces, face, p)
    {
        return Some(Near { found, alone: true });
    }
    let Place::Cell(cell) = pair.field.place(p.to_array()) else {
        return None;
    };
    if let Some(found) = (cell.surface()).and_then(|surface| on_surface_of(pair.surfaces, surface, p)) {
        return Some(Near { found, alone: true });
    }
    near_in(pair, &cell, p)
}

/// As [`near_at`], in a cell that names several faces, or none with a closed form.
#[inline(never)]
fn near_in(pair: &DirectedPair<'_>, cell: &Cell<'_>, p: Vec3) -> Option<Near> {
    if let Some(found) = exact_on_face(pair.surfaces, pair.nearby(cell), p) {
        return Some(Near { found, alone: false });
    }
    let sample = pair.field.sample(cell);
    let gradient = Vec3::from_array(sample.gradient);
    let squared = gradient.length_squared();
    (squared > LEAST_GRADIENT2).then(|| Near {
        found: OnFace {
            distance: pair.field.distance(cell),
            normal: gradient * inverse_sqrt(squared),
            face: pair.surfaces.face_of(sample.face),
            edge_face: NO_FACE,
        },
        alone: false,
    })
}

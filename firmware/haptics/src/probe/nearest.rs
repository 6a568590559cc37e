//! The smallest gap or largest depth of two parts: branch and bound over the same trees and fields the search for contacts walks.
//!
//! A sphere whose lower bound exceeds the smallest gap found so far holds nothing nearer. One walk each way takes all that a look-up settles by
//! an analytic face, and offers what overlaps as contacts; until it has found something in the band, leaves beyond the band wait, for their bounds
//! are loose and seldom needed after. A last walk each way takes what waited, and measures against all faces the points left over that could still
//! be nearest; when the band held nothing, it goes down by the nearer child first, for a first gap to compare with.

use glam::Vec3;
use mortise_protocol::image::{
    Cell, EDGE_ERROR_CELLS, NO_FACE, Nearby, NodeRecord, Place, PointRecord, Shape,
};

use crate::collision::directed_pair::DirectedPair;
use crate::collision::exact_surface::{OnFace, agreeing, closed_form, exact, on_face, unsigned_distance};
use crate::collision::search::Traversal;
use crate::io::Work;

/// The diagonal of a cell, cells: interpolation this far below the band's end uses no clamped sample.
const DIAGONAL_CELLS: f32 = 1.733;

/// The smallest gap between two parts, or the largest depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Signed distance, m: gap positive, deepest point negative. By the analytic faces when `exact`, else as the field has it, or the
    /// voxmap's tangent planes.
    pub distance_m: f32,
    /// The smallest distance the field itself gave, of the points looked at, m: what the tick acts on. Infinite when none lay where the field
    /// stores distances.
    pub field_distance_m: f32,
    /// The distance is one to an analytic face or edge, within single precision.
    pub exact: bool,
    /// The point lies where the field stores distances, or past a tangent plane; when neither this nor `exact`, the distance is only a bound: at
    /// least so far apart, or at least so deep.
    pub in_band: bool,
    /// From the moving part's centre of mass to the point, axes of the fixed part, m.
    pub arm: Vec3,
    /// Face of the moving part, [`mortise_protocol::image::NO_FACE`] when unknown.
    pub moving_face: u16,
    /// Face of the fixed part, [`mortise_protocol::image::NO_FACE`] when unknown.
    pub fixed_face: u16,
}

/// What was found so far, both ways.
pub(crate) struct SoFar {
    /// The smallest.
    pub best: Nearest,
    /// What was looked at.
    pub work: Work,
}

impl SoFar {
    /// What is farther than this is neither nearest nor overlaps, m.
    #[inline]
    fn limit(&self) -> f32 {
        if self.best.distance_m > 0.0 {
            self.best.distance_m
        } else {
            0.0
        }
    }
}

/// One way of a search.
pub(crate) struct NearestSearch<'s, 'i> {
    pair: &'s DirectedPair<'i>,
    /// The shape whose field it looks up.
    shape: &'s Shape<'i>,
    /// Distances are stored up to here, m.
    band: f32,
    /// Interpolated distances are good up to here, m.
    resolved: f32,
    /// What interpolation may overstate, m.
    edge_error: f32,
    /// All faces of the shape have a closed form: what the field leaves open can be measured.
    measurable: bool,
    /// None of the points left over is nearer than this, m.
    left_over: f32,
    /// Leaves beyond the band wait before this node.
    waiting: u32,
    /// None in the leaves that wait is nearer than this, m.
    waits_beyond: f32,
}

/// A leaf that is to be looked at.
struct PendingLeaf<'i> {
    node: u32,
    points: &'i [PointRecord],
    /// No point of it is nearer, m.
    bound: f32,
    /// Its centre lies beyond the band: its points are not expected to be nearest.
    beyond: bool,
}

/// A point as one look-up has it.
struct Seen {
    /// Its distance: that to the face where it is `settled`, else as interpolated or a bound, m.
    distance: f32,
    /// It is no nearer than this, m.
    least: f32,
    /// As the tick has it, m; infinite where nothing is stored.
    rendered: f32,
    /// The tick may push it.
    overlaps: bool,
    inside: bool,
    /// Nearest face, if known.
    face: u16,
    in_band: bool,
    /// An edge itself is nearest: the surfaces give a bound only.
    edge_nearest: bool,
    /// `distance` is that to an analytic face.
    settled: bool,
}

impl Seen {
    /// Neither inside nor in the band.
    const NOTHING: Self = Self {
        distance: f32::INFINITY,
        least: f32::INFINITY,
        rendered: f32::INFINITY,
        overlaps: false,
        inside: false,
        face: NO_FACE,
        in_band: false,
        edge_nearest: false,
        settled: false,
    };
}

impl<'s, 'i> NearestSearch<'s, 'i> {
    /// About to begin.
    pub fn new(pair: &'s DirectedPair<'i>, shape: &'s Shape<'i>) -> Self {
        let record = shape.field.record();
        Self {
            pair,
            shape,
            band: record.band,
            resolved: record.band - DIAGONAL_CELLS * record.cell,
            edge_error: EDGE_ERROR_CELLS * record.cell,
            measurable: closed_form(shape),
            left_over: f32::INFINITY,
            waiting: 0,
            waits_beyond: f32::INFINITY,
        }
    }

    /// All leaves that could hold the nearest point or one that overlaps, as far as a look-up settles their points. What overlaps goes to
    /// `contacts`. Leaves beyond the band wait as long as nothing in the band was found.
    pub fn walk(&mut self, so_far: &mut SoFar, contacts: &mut Traversal<'_, '_, '_>) {
        self.leaves(so_far, u32::MAX, |search, so_far, leaf| {
            if so_far.best.distance_m > search.band {
                search.waiting = leaf.node + 1;
                if leaf.beyond {
                    search.waits_beyond = search.waits_beyond.min(leaf.bound);
                    return;
                }
            }
            for point in leaf.points {
                let seen = search.see(point);
                if seen.overlaps {
                    contacts.one(search.pair, leaf.node, point, search.found(&seen, point));
                }
                if !search.settle(&seen, point, so_far) {
                    search.left_over = search.left_over.min(seen.least);
                }
            }
            so_far.work.points += leaf.points.len() as u32;
        });
    }

    /// What [`Self::walk`] left over: leaves that waited, and points to be measured.
    pub fn rest(&mut self, so_far: &mut SoFar, contacts: &mut Traversal<'_, '_, '_>) {
        let needed = |least: f32, limit: f32| least < f32::INFINITY && least <= limit;
        if needed(self.waits_beyond, so_far.limit()) && so_far.best.distance_m > self.band {
            self.first(so_far);
        }
        let measure = needed(self.left_over, so_far.best.distance_m);
        let end = match (measure, needed(self.waits_beyond, so_far.limit())) {
            (true, _) => u32::MAX,
            (false, true) => self.waiting,
            (false, false) => return,
        };
        self.leaves(so_far, end, |search, so_far, leaf| {
            let waited = leaf.beyond && leaf.node < search.waiting;
            if !waited && !measure {
                return;
            }
            for point in leaf.points {
                let seen = search.see(point);
                if waited && seen.overlaps {
                    contacts.one(search.pair, leaf.node, point, search.found(&seen, point));
                }
                if waited || !seen.settled {
                    search.measure(&seen, point, so_far);
                }
            }
            so_far.work.points += leaf.points.len() as u32;
        });
    }

    /// Down by the nearer child, to one leaf; measures the point of it that seems nearest. Every step goes forward, so it ends.
    fn first(&mut self, so_far: &mut SoFar) {
        let nodes = self.pair.nodes;
        let mut index = 0;
        while let Some(node) = nodes.get(index) {
            let end = node.skip as usize;
            if end == index + 1 {
                let mut nearest = None;
                for point in node.points(self.pair.points) {
                    so_far.work.points += 1;
                    let seen = self.see(point);
                    if (nearest.as_ref()).is_none_or(|(other, _): &(Seen, _)| seen.distance < other.distance)
                    {
                        nearest = Some((seen, point));
                    }
                }
                if let Some((seen, point)) = nearest {
                    self.measure(&seen, point, so_far);
                }
                return;
            }
            let mut child = index + 1;
            let mut nearest = (f32::INFINITY, child);
            while child < end
                && let Some(node) = nodes.get(child)
            {
                let (bound, _) = self.bound(node, so_far);
                if bound < nearest.0 {
                    nearest = (bound, child);
                }
                child = node.skip as usize;
            }
            index = nearest.1;
        }
    }

    /// Gives `look` every leaf before node `end` in which a point could be nearer than the nearest so far, or overlap.
    #[inline]
    fn leaves(
        &mut self,
        so_far: &mut SoFar,
        end: u32,
        mut look: impl FnMut(&mut Self, &mut SoFar, PendingLeaf<'i>),
    ) {
        let nodes = self.pair.nodes.get(..end as usize).unwrap_or(self.pair.nodes);
        let mut index = 0;
        while let Some(node) = nodes.get(index) {
            let (bound, beyond) = self.bound(node, so_far);
            if bound > so_far.limit() {
                index = node.skip as usize;
                continue;
            }
            if node.skip as usize == index + 1 {
                let points = node.points(self.pair.points);
                look(
                    self,
                    so_far,
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
    fn bound(&self, node: &NodeRecord, so_far: &mut SoFar) -> (f32, bool) {
        so_far.work.nodes += 1;
        let center = self.pair.to_field.apply(node.center);
        let distance = self.pair.field.bound(center.to_array());
        // Inside, a clamped distance and a bound beyond the band say how deep at least, not at most.
        if distance < -self.resolved {
            return (f32::NEG_INFINITY, false);
        }
        // No sample is larger than the band: this is no interpolation.
        let beyond = distance > self.band + self.edge_error;
        let error = if beyond { 0.0 } else { self.edge_error };
        (distance - (node.radius + error), beyond)
    }

    #[inline(always)]
    fn in_field(&self, point: &PointRecord) -> Vec3 {
        self.pair.to_field.apply(point.position)
    }

    /// Looks a point up.
    #[inline(always)]
    fn see(&self, point: &PointRecord) -> Seen {
        let p = self.in_field(point);
        match self.pair.field.place(p.to_array()) {
            Place::Cell(cell) => {
                let nearby = self.pair.field.nearby(&cell);
                let exact = exact(self.shape.faces, nearby, p);
                if let Some((distance, face)) = exact
                    && distance.abs() <= self.resolved
                    && match nearby {
                        Nearby::Convex(_) => distance <= 0.0,
                        Nearby::Reentrant(_) => distance >= 0.0,
                        _ => true,
                    }
                {
                    return Seen {
                        distance,
                        least: distance,
                        rendered: distance,
                        overlaps: distance < 0.0,
                        inside: distance < 0.0,
                        face,
                        in_band: true,
                        edge_nearest: false,
                        settled: true,
                    };
                }
                self.interpolated(&cell, nearby, exact)
            }
            Place::Far { inside, bound } => {
                // Inside a bound says how deep at least, not at most.
                Seen {
                    distance: if inside { -bound } else { bound },
                    least: if inside { f32::NEG_INFINITY } else { bound },
                    overlaps: inside,
                    inside,
                    ..Seen::NOTHING
                }
            }
        }
    }

    /// Looks up what its cell's faces do not settle; `exact` is what they give.
    fn interpolated(&self, cell: &Cell<'_>, nearby: Nearby, exact: Option<(f32, u16)>) -> Seen {
        let interpolated = self.pair.field.distance(cell);
        let mut seen = Seen {
            distance: interpolated,
            least: interpolated - self.edge_error,
            rendered: interpolated,
            face: nearby.face(),
            ..Seen::NOTHING
        };
        if let Some((distance, face)) = exact {
            seen.rendered = distance;
            seen.edge_nearest = match nearby {
                Nearby::Convex(_) => distance > 0.0,
                Nearby::Reentrant(_) => distance < 0.0,
                _ => false,
            };
            if !seen.edge_nearest {
                (seen.distance, seen.least, seen.face) = (distance, distance, face);
            } else if distance > seen.least && distance > 0.0 {
                // Outside a convex edge the surfaces give no more than the distance.
                seen.least = distance;
            }
        }
        seen.overlaps = seen.rendered < 0.0;
        seen.inside = seen.distance < 0.0;
        seen.in_band = seen.face != NO_FACE && seen.distance.abs() <= self.resolved;
        if seen.distance < -self.resolved {
            seen.least = f32::NEG_INFINITY;
        }
        seen
    }

    /// What pushes a settled point.
    fn found(&self, seen: &Seen, point: &PointRecord) -> Option<OnFace> {
        if !seen.settled {
            return None;
        }
        let found = on_face(self.shape.faces, seen.face, self.in_field(point))?;
        Some(OnFace {
            distance: seen.distance,
            ..found
        })
    }

    /// Takes a point if what was seen settles it; whether it is done with.
    #[inline(always)]
    fn settle(&self, seen: &Seen, point: &PointRecord, so_far: &mut SoFar) -> bool {
        if seen.rendered < so_far.best.field_distance_m {
            so_far.best.field_distance_m = seen.rendered;
        }
        if seen.least > so_far.best.distance_m {
            return true;
        }
        let exact = self.at_face(seen, point);
        if exact.is_none() && self.measurable {
            return false;
        }
        self.take(seen, exact, point, so_far);
        true
    }

    /// Takes a point by what tells its distance best.
    fn measure(&self, seen: &Seen, point: &PointRecord, so_far: &mut SoFar) {
        if !self.settle(seen, point, so_far) {
            let exact = self.measured(seen, point, so_far.best.distance_m);
            self.take(seen, exact, point, so_far);
        }
    }

    fn take(&self, seen: &Seen, exact: Option<f32>, point: &PointRecord, so_far: &mut SoFar) {
        let distance_m = exact.unwrap_or(seen.distance);
        if distance_m < so_far.best.distance_m {
            let (moving_face, fixed_face) = if self.pair.backward {
                (seen.face, point.face)
            } else {
                (point.face, seen.face)
            };
            so_far.best = Nearest {
                distance_m,
                field_distance_m: so_far.best.field_distance_m,
                exact: exact.is_some(),
                in_band: seen.in_band,
                arm: self.pair.to_arm.apply(point.position),
                moving_face,
                fixed_face,
            };
        }
    }

    /// Distance to the nearest face's surface, where that is the distance.
    #[inline(always)]
    fn at_face(&self, seen: &Seen, point: &PointRecord) -> Option<f32> {
        if seen.settled {
            return Some(seen.distance);
        }
        if seen.in_band && !seen.edge_nearest {
            return agreeing(self.shape, seen.face, self.in_field(point), seen.distance);
        }
        None
    }

    /// Distance by all faces, if it can be had and does not contradict the field; `best`, or more, where it is no less.
    fn measured(&self, seen: &Seen, point: &PointRecord, best: f32) -> Option<f32> {
        let field = seen.distance;
        // Outside, what is no nearer than the nearest so far need not be known.
        let outside = if seen.in_band { field >= 0.0 } else { !seen.inside };
        let enough = if outside { best } else { f32::INFINITY };
        let edge = point.edge_face != NO_FACE;
        let distance = unsigned_distance(self.shape, self.in_field(point), edge, enough)?;
        if outside && distance >= enough {
            return Some(distance);
        }
        if seen.in_band {
            // Next to an edge the sign is the field's only where that is sure of it.
            let signed = if field < 0.0 { -distance } else { distance };
            ((signed - field).abs() <= self.edge_error).then_some(signed)
        } else if seen.inside {
            (distance >= -field - self.edge_error).then_some(-distance)
        } else {
            (distance >= field - self.edge_error).then_some(distance)
        }
    }
}

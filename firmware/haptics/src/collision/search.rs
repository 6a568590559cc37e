//! Contact search: points of one part in the signed-distance field of the other, in both directions.
//!
//! Forward, every point of the held part is queried in the other part's field; backward, every point of the other part in the held part's field.
//! Without the backward direction a sharp fixed rim would slip between the points of a tilted part. Both directions traverse a preorder sphere tree
//! and skip every sphere whose distance, by the field at its centre, exceeds the margin.
//!
//! When the budget runs out, work is dropped in this order. First, the step gets only as many solves as the budget has left, four at least. Second,
//! contacts in leaves not reached that pushed, or may now, are carried over, their gaps advanced by the last motion, and the next tick resumes where this one
//! stopped, round and round. Third, when two ticks do not complete a round (the ticks after a grab excepted), points inside of faces are decimated evenly where
//! points are the bulk of the work: each second, fourth or eighth near point is queried where points take a quarter of the budget; where they still
//! take half of it, whole leaves are decimated, down to each 128th point. The selection stays the same until the budget suffices again
//! ([`super::decimation`]). The error bound of the pointshell grows by a factor of four at each step; all else stays as it was. Carrying over is
//! prepared once a tick has needed half of the budget, and paid for before the search from three quarters of it at most.
//!
//! Cost: see [`crate::tick()`]; field queries are two thirds of it.

use glam::Vec3;
use mortise_protocol::image::{
    Cell, EDGE_ERROR_CELLS, NO_FACE, NO_SPAN, Place, PointRecord, SceneImage, Shape,
};

use crate::collision::ancestors::Ancestors;
use crate::collision::coherence::{Bound, Coherence, Known};
use crate::collision::contact::{Contact, Contacts, Phase};
use crate::collision::cost::{
    ALLOWANCE, CANDIDATE, LEAF, LOOKUP, MATING, NEAR, NODE, PAIR, PASSED_OVER, PUSHING, Used,
};
use crate::collision::decimation::Decimation;
use crate::collision::directed_pair::DirectedPair;
use crate::collision::exact_surface::{OnFace, exact, exact_on_face, on_surface_of, with_allowance};
use crate::collision::facing::faces_away;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::node_key::{ALL, SHORTEST_SHARE};
use crate::collision::placement::Placed;
use crate::collision::rules::{FacePairRules, Mating, MatingCache};
use crate::collision::side::Sides;
use crate::io::{Flags, Work};
use crate::math::pose::Pose;
use crate::math::scalar::inverse_sqrt;
use crate::math::symmetric6::dot;

/// Squared gradient length below which the gradient gives no direction: the field is clamped there, or lies between two surfaces. Within a cell of a
/// sharp edge the length shrinks to about 0.3 while the direction is still good.
pub(crate) const LEAST_GRADIENT2: f32 = 0.01;
/// Safety factor on the approach predicted by either motion. The motion at the tick's end lies between the last motion and the one without contacts,
/// or is turned by the contacts: the end of a rod struck at the other end moves half as fast again.
pub(crate) const APPROACH: f32 = 2.0;
/// Points whose bound would expire within this many more ticks like the last one count as near and are queried every tick: evaluating the whole leaf
/// to find out costs as much.
const NEAR_TICKS: f32 = 4.0;
/// Inputs of one search: all that a tick fixes before it. Many fields, because the innermost loops read them.
pub(crate) struct Search<'s, 'i, R> {
    pub scene: &'s SceneImage<'i>,
    pub parts: &'s [Placed],
    /// Index of the held part.
    pub held: u16,
    pub held_shape: Shape<'i>,
    /// Distance by which points of the held part are moved inward before voxmaps are queried, m.
    pub shrunk_m: f32,
    pub pose: Pose,
    /// World position of its centre of mass, m.
    pub center: Vec3,
    /// World position of the centre of its bounding sphere, m.
    pub middle: Vec3,
    /// Upper bound of any point's travel in this tick: points with larger gaps are not evaluated further, m.
    pub margin: f32,
    /// Upper bound of any point's travel in the last tick, m.
    pub way: f32,
    /// Points whose gap falls to this by the last motion, or by the motion without contacts, are candidates, m.
    pub slack: f32,
    /// The last tick's motion and the motion without contacts, each of one period, scaled as the step's unknowns, m.
    pub motions: [[f32; 6]; 2],
    /// Weight of the squared lever arm against the gap when contacts are chosen: margin/reach², so that it equals the margin at the object's farthest
    /// point, 1/m.
    pub swing: f32,
    /// 1/L of the step's scaling, 1/m.
    pub inverse_length: f32,
    /// The last tick needed half of the budget or more.
    pub busy: bool,
    /// Decides which near points of a leaf are queried.
    pub decimation: Decimation,
    /// Work budget of the tick, field queries.
    pub budget: u32,
    /// Part of the budget reserved for the step.
    pub reserved: u32,
    /// Contacts carried over, which enter the step even if the search finds none.
    pub carried: u32,
    /// Gap below which points are braked, m; 0 for no braking. With braking, points in proximity voxels are candidates too.
    pub braking_m: f32,
    /// Rules of the constraints in force for guided faces.
    pub rules: &'s R,
}

impl<'i, R: FacePairRules> Search<'_, 'i, R> {
    /// Gap below which points are queried every tick, m.
    #[inline]
    pub fn near(&self) -> f32 {
        (self.margin + NEAR_TICKS * self.way) * (1.0 / SHORTEST_SHARE)
    }

    /// Upper bound of how far a contact's gap may close in this tick, m, at least 0.
    #[inline]
    pub fn approach(&self, row: &[f32; 6]) -> f32 {
        let mut fastest = 0.0f32;
        for motion in &self.motions {
            let closing = -dot(row, motion);
            if closing > fastest {
                fastest = closing;
            }
        }
        APPROACH * fastest
    }

    /// Fills `contacts`, starting at `start` and wrapping round. Returns where to resume if the budget ran out, and the cost.
    pub fn run(
        &self,
        start: NodeCursor,
        coherence: &mut Coherence,
        contacts: &mut Contacts,
        work: &mut Work,
    ) -> (Option<NodeCursor>, Used) {
        let mut traversal = self.traverse(self.busy, coherence, contacts, work);
        let stop = traversal
            .pairs(start, None)
            .or_else(|| traversal.pairs(NodeCursor::FIRST, Some(start)));
        let (spent, not_found, point_work) = (traversal.spent, traversal.expected, traversal.point_work);
        let [mut carried, mut near] = [0; 2];
        if let Some(stop) = stop {
            work.flags.insert(Flags::BUDGET);
            let limit = |row: &[f32; 6]| self.slack + self.approach(row);
            [carried, near] = contacts.carry(&self.motions[0], limit, |leaf| {
                let visited = if start < stop {
                    start <= leaf && leaf < stop
                } else {
                    start <= leaf || leaf < stop
                };
                !visited
            });
        }
        let found = self.expected() - not_found;
        let used = Used {
            all: (spent + PUSHING * carried + CANDIDATE * near - PUSHING * not_found) / LOOKUP,
            point_work: (point_work + PUSHING * (found + carried) + CANDIDATE * near) / LOOKUP,
        };
        (stop, used)
    }

    /// Directed pair `index`; `None` where the scene has no such part.
    fn pair(&self, index: u16) -> Option<DirectedPair<'i>> {
        let part = index / 2;
        let other = self.parts.get(usize::from(part))?;
        if usize::from(part) >= self.scene.parts().len() {
            return None;
        }
        let other_shape = self.scene.shape_of_part(usize::from(part));
        let mut pair = DirectedPair::new(
            index,
            (&self.held_shape, self.pose),
            (&other_shape, other.pose),
            self.center,
        );
        pair.guided = self.rules.concerns(part);
        if pair.guided && !pair.field.is_occupancy() {
            pair.excluded = self.rules.excluded(part, pair.backward);
        }
        Some(pair)
    }

    /// Contacts paid for before the search. A quarter of the budget at least is left, so that every leaf's turn comes.
    fn expected(&self) -> u32 {
        let most = LOOKUP
            .saturating_mul(self.budget / 4 * 3)
            .saturating_sub(LOOKUP * self.reserved);
        self.carried.min(most / PUSHING)
    }

    /// A traversal that has not begun, with an empty contact store; with `keep_previous` the previous contacts can be carried over.
    pub fn traverse<'w>(
        &'w self,
        keep_previous: bool,
        coherence: &'w mut Coherence,
        contacts: &'w mut Contacts,
        work: &'w mut Work,
    ) -> Traversal<'w, 'w, 'i, R> {
        contacts.begin(keep_previous);
        let expected = self.expected();
        Traversal {
            search: self,
            horizon: coherence.horizon(self.margin),
            coherence,
            contacts,
            work,
            spent: LOOKUP * self.reserved + PUSHING * expected,
            expected,
            point_work: 0,
            decimation_work: 0,
            exclusion_work: 0,
            decimated_queries: 0,
            face_searches: 0,
            mating_cache: MatingCache::NONE,
            near: 0,
            boxes: None,
        }
    }
}

/// A search in progress: the stores that it fills, and the counts that its budget and its report need.
pub(crate) struct Traversal<'w, 's, 'i, R> {
    pub search: &'w Search<'s, 'i, R>,
    pub coherence: &'w mut Coherence,
    /// Travel at which bounds of points within the margin expire, nm.
    pub horizon: u32,
    pub contacts: &'w mut Contacts,
    pub work: &'w mut Work,
    /// Budget spent, eighths of a field query.
    pub spent: u32,
    /// Of that, on points rather than on the traversal.
    point_work: u32,
    /// Of that, on decimated points of the current leaf.
    pub decimation_work: u32,
    /// Of that, on exclusion queries.
    pub exclusion_work: u32,
    /// Candidates already paid for and not yet found.
    expected: u32,
    /// Leaves whose decimated points were queried.
    pub decimated_queries: u32,
    /// Leaves whose face was searched for.
    pub face_searches: u32,
    /// Mating of the last point's faces.
    mating_cache: MatingCache,
    /// Number of points within the margin.
    pub near: u32,
    /// The last part of which the boxes were compared, and their gap, m.
    pub boxes: Option<(u16, f32)>,
}

impl<R: FacePairRules> Traversal<'_, '_, '_, R> {
    /// Searches a whole pair.
    pub fn all(&mut self, pair: &DirectedPair<'_>) {
        let _ = self.nodes(pair, 0, u32::MAX);
    }

    /// Offers one point of the leaf `node`, at the surface `found` or after a query.
    #[inline(never)]
    pub fn one(&mut self, pair: &DirectedPair<'_>, node: u32, point: &PointRecord, found: Option<OnFace>) {
        let leaf = NodeCursor {
            pair: pair.index,
            node,
        };
        match found {
            Some(found) => self.near(pair, leaf, point, &found),
            None => {
                let _ = self.point(pair, leaf, point);
            }
        }
    }

    /// Searches everything from `start` to before `end` (or to the last node). Returns where it stopped when the budget ran out.
    fn pairs(&mut self, start: NodeCursor, end: Option<NodeCursor>) -> Option<NodeCursor> {
        let pairs = 2 * self.search.parts.len() as u16;
        let last = end.map_or(pairs, |e| (e.pair + 1).min(pairs));
        for index in start.pair..last {
            let is_whole = index != start.pair && end.is_none_or(|end| end.pair != index);
            if !self.spheres_meet(index) || is_whole && self.pass_over(index) {
                continue;
            }
            let Some(pair) = self.search.pair(index) else {
                continue;
            };
            self.spent += PAIR;
            let from = if index == start.pair { start.node } else { 0 };
            let to = match end {
                Some(end) if end.pair == index => end.node,
                _ => u32::MAX,
            };
            let stopped = self
                .nodes(&pair, from, to)
                .or_else(|| self.edges(&pair, from, to));
            if stopped.is_some() {
                return stopped;
            }
        }
        None
    }

    /// Searches nodes `from..to` of a pair in preorder and skips subtrees beyond the margin. Returns where it stopped when the budget ran out.
    ///
    /// Terminates because every record's `skip` points forward (checked when the image was opened).
    fn nodes(&mut self, pair: &DirectedPair<'_>, from: u32, to: u32) -> Option<NodeCursor> {
        if pair.unused() {
            return None;
        }
        let mut edge_error = EDGE_ERROR_CELLS * pair.field.record().cell;
        if pair.field.is_occupancy() {
            edge_error += self.search.shrunk_m;
        }
        let limit = LOOKUP.saturating_mul(self.search.budget);
        let keys = pair.keys;
        let mut ancestors = Ancestors::new();
        let mut index = from;
        while index < to {
            let Some(node) = pair.nodes.get(index as usize) else {
                break;
            };
            let here = NodeCursor {
                pair: pair.index,
                node: index,
            };
            if self.spent >= limit {
                return Some(here);
            }
            ancestors.close(index, self.coherence);
            let key = keys.of(index);
            let mut queried = false;
            let mut near = ALL;
            let known = self.coherence.query(key, self.horizon, node.skip == index + 1);
            if index == 0
                && let Some(bound) = self.boxes_apart(pair, key, known)
            {
                ancestors.note(bound);
                index = node.skip;
                continue;
            }
            match known {
                Known::Far(bound) => {
                    self.spent += PASSED_OVER;
                    ancestors.note(bound);
                    index = node.skip;
                    continue;
                }
                Known::Near(points) => {
                    self.spent += PASSED_OVER;
                    near = points;
                }
                Known::Expired => {
                    self.spent += PASSED_OVER;
                    queried = true;
                }
                Known::Nothing => {
                    self.spent += NODE;
                    self.work.nodes += 1;
                    let distance = pair.distance(node.center) - (node.radius + edge_error);
                    self.charge_surfaces(pair);
                    if distance > self.search.margin {
                        ancestors.note(self.coherence.set_distance(key, distance));
                        index = node.skip;
                        continue;
                    }
                    self.coherence.set_near(key);
                    queried = true;
                }
            }
            index += 1;
            if node.skip != index {
                ancestors.open(key, node.skip);
                continue;
            }
            let points = node.points(pair.points);
            let mask = self.search.decimation.mask(node.first_point, points);
            // Queried as seldom as the field is.
            if queried
                && !pair.excluded.is_empty()
                && let Some(clear) = self.excluded(pair, points)
            {
                self.coherence.set_excluded(key, clear);
                ancestors.note(Bound::NOW);
                continue;
            }
            // A leaf is evaluated as a whole, unless it exceeds even the whole budget.
            if (self.left() as usize) < points.len() && self.work.points > 0 {
                return Some(here);
            }
            self.spent += LEAF;
            let before = self.spent;
            ancestors.note(if near != ALL {
                self.selected_points(pair, here, points, near & mask);
                Bound::NOW
            } else {
                match mask {
                    ALL => self.points(pair, here, points),
                    mask => self.decimated(pair, here, points, mask),
                }
            });
            self.charge_surfaces(pair);
            self.point_work += self.spent - before - self.decimation_work;
            self.decimation_work = 0;
        }
        ancestors.close(index, self.coherence);
        None
    }

    /// Queries one point and offers it as a contact if it lies within the margin. Returns its gap or a lower bound of it, m.
    #[inline(always)]
    pub fn point(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, point: &PointRecord) -> f32 {
        if pair.field.is_occupancy() {
            return self.voxel(pair, leaf, point);
        }
        if point.span != NO_SPAN {
            return self.span(pair, leaf, point, None);
        }
        self.place(pair, leaf, point)
    }

    /// As [`Self::point`], for one place.
    #[inline(always)]
    pub fn place(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, point: &PointRecord) -> f32 {
        let in_field = pair.to_field.apply(point.position);
        match pair.field.place(in_field.to_array()) {
            Place::Cell(cell) => {
                let found = cell
                    .surface()
                    .and_then(|surface| on_surface_of(pair.surfaces, surface, in_field));
                if let Some(found) = found {
                    if found.distance < self.search.margin {
                        self.near(pair, leaf, point, &found);
                    }
                    return found.distance;
                }
                self.at_edge(pair, leaf, point, &cell, in_field)
            }
            Place::Far { inside: false, bound } => bound,
            Place::Far { inside: true, .. } => {
                self.work.flags.insert(Flags::DEEP);
                f32::NEG_INFINITY
            }
        }
    }

    /// Queries a point near more than one face, or near a face without a closed form.
    #[inline(never)]
    fn at_edge(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        point: &PointRecord,
        cell: &Cell<'_>,
        p: Vec3,
    ) -> f32 {
        let nearby = pair.nearby(cell);
        if let Some(mut found) = exact_on_face(pair.surfaces, nearby, p) {
            let distance = found.distance;
            if distance < self.search.margin {
                if pair.guided {
                    self.spent += ALLOWANCE;
                    // At the rim of a guided face the adjacent face gets the allowance too; otherwise the part would rest on it.
                    let allowance_m = |face| self.mating(pair, leaf, point, face).allowance_m;
                    found = with_allowance(found, pair.surfaces, nearby, p, allowance_m);
                }
                if self.contacts.sides.any() {
                    found = self.contacts.sides.surface(leaf, p, found);
                }
                if !faces_away(pair, nearby, point, found.normal) {
                    self.near(pair, leaf, point, &found);
                }
            }
            return distance;
        }
        // At the centre of a surface the distance is known, but the normal is not.
        let distance = exact(pair.surfaces, nearby, p)
            .map_or_else(|| pair.field.distance(cell), |(distance, _)| distance);
        if distance >= self.search.margin {
            return distance;
        }
        let sample = pair.field.sample(cell);
        let gradient = Vec3::from_array(sample.gradient);
        let squared = gradient.length_squared();
        if squared < LEAST_GRADIENT2 {
            let deep = distance < -pair.field.record().cell;
            self.work.flags.insert_if(deep, Flags::DEEP);
        } else {
            let found = OnFace {
                distance,
                normal: gradient * inverse_sqrt(squared),
                face: pair.surfaces.face_of(sample.face),
                edge_face: NO_FACE,
            };
            self.near(pair, leaf, point, &found);
        }
        distance
    }

    /// Offers a point within the margin as a contact.
    #[inline(always)]
    pub fn near(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, point: &PointRecord, found: &OnFace) {
        self.near += 1;
        self.spent += NEAR;
        let mut found = *found;
        if Sides::concerns(found.distance, self.search.way) || self.contacts.sides.any() {
            found = self.on_side(pair, leaf, point, found);
        }
        let n = pair.to_push * found.normal;
        let (moving, fixed) = sides(pair, point, found.face);
        let mating = if pair.guided {
            self.spent += MATING;
            self.mating(pair, leaf, point, found.face)
        } else {
            Mating::NONE
        };
        let gap = found.distance + mating.allowance_m;
        let arm = pair.to_arm.apply(point.position);
        let Some(contact) = self.offer(gap, n, arm) else {
            return;
        };
        contact.guided = mating.guided;
        contact.single = point.span != NO_SPAN;
        (contact.moving_face, contact.static_face) = (moving[0], fixed[0]);
        (contact.moving_edge_face, contact.static_edge_face) = if pair.backward {
            (found.edge_face, point.edge_face)
        } else {
            (point.edge_face, found.edge_face)
        };
        contact.edges = [NO_FACE; 2];
        contact.leaf = leaf;
    }

    /// The surface of a point on the side from which its leaf came, which is kept for the next tick.
    #[inline(never)]
    fn on_side(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        point: &PointRecord,
        found: OnFace,
    ) -> OnFace {
        let p = pair.to_field.apply(point.position);
        let found = self.contacts.sides.surface(leaf, p, found);
        if Sides::concerns(found.distance, self.search.way) {
            self.contacts.sides.keep(leaf, p, &found);
        }
        found
    }

    /// Slot for a contact at lever arm `arm` with a `gap` along the world normal `n`, if it is a candidate and is kept. The caller fills in faces,
    /// edges and leaf.
    #[inline(always)]
    pub fn offer(&mut self, gap: f32, n: Vec3, arm: Vec3) -> Option<&mut Contact> {
        let turn = arm.cross(n) * self.search.inverse_length;
        let row = [n.x, n.y, n.z, turn.x, turn.y, turn.z];
        let slack = self.search.slack;
        if gap >= slack && gap >= slack + self.search.approach(&row) {
            return None;
        }
        self.count_candidate();
        let arm2 = arm.length_squared();
        let reach_gap = gap - self.search.swing * arm2;
        let contact = self.contacts.offer(gap, reach_gap, arm2)?;
        contact.row = row;
        contact.arm = arm;
        contact.rate = 0.0;
        contact.phase = Phase::Free;
        Some(contact)
    }

    /// Mating of a point and a face.
    fn mating(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        point: &PointRecord,
        face: u16,
    ) -> Mating {
        let (moving, fixed) = sides(pair, point, face);
        self.mating_of(leaf, moving, fixed)
    }

    /// Mating of these faces of the held part and of the other part.
    #[inline]
    pub fn mating_of(&mut self, leaf: NodeCursor, moving: [u16; 2], fixed: [u16; 2]) -> Mating {
        (self.mating_cache).get(self.search.rules, leaf.part(), moving, fixed)
    }

    /// Counts a candidate, a point that may touch, and charges it to the budget.
    #[inline(always)]
    pub fn count_candidate(&mut self) {
        if self.expected > 0 {
            self.expected -= 1;
        } else {
            self.spent += CANDIDATE;
        }
        self.work.candidates = self.work.candidates.saturating_add(1);
    }

    /// Budget left, field queries.
    pub fn left(&self) -> u32 {
        self.search.budget.saturating_sub(self.spent / LOOKUP)
    }
}

/// Faces of the held part and of the other part, where a point meets a face.
#[inline(always)]
fn sides(pair: &DirectedPair<'_>, point: &PointRecord, face: u16) -> ([u16; 2], [u16; 2]) {
    let (own, other) = ([point.face, point.edge_face], [face, NO_FACE]);
    if pair.backward { (other, own) } else { (own, other) }
}

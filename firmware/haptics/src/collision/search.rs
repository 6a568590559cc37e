//! Where the held part is near another: points of one in the signed-distance field of the other, both ways.
//!
//! Forward, every point of the held part is looked up in the other part's field; backward, every point of the other part in the held part's,
//! or a sharp fixed rim would slip between the points of a tilted part. Both walk a preorder sphere tree and skip every sphere that the
//! field's distance at its centre puts farther off than the margin.
//!
//! When the budget runs out, work is left undone in this order. The step has no more solves than the budget has room for, four at least. What pushed
//! in leaves not reached is carried over with the gaps the last motion left them, and the next tick goes on where this one stopped, round and round.
//! When two ticks do not get round, but for those after a grab, points are left out evenly where they are the work: each second, fourth, eighth of
//! those that are near is looked at where points take a quarter of the budget, and where they still take half of it whole leaves are left out, to
//! each 128th point; always the same ones, until there is room again ([`crate::overload`]). The error bound of the pointshell grows by four at each
//! step, all else stays as it was. Carrying is prepared for once a tick needed half the budget.
//!
//! Cost: see [`crate::tick()`]; the look-ups in the field are two thirds of it.

use glam::Vec3;
use mortise_protocol::image::{Cell, EDGE_ERROR_CELLS, NO_FACE, Place, PointRecord, SceneImage, Shape};

use crate::collision::ancestors::Ancestors;
use crate::collision::coherence::{Bound, Coherence, Known};
use crate::collision::contact::{Contacts, Phase};
use crate::collision::cost::{
    ALLOWANCE, CANDIDATE, EDGE, LEAF, LOOKUP, MATING, NEAR, NODE, PASSED_OVER, Used,
};
use crate::collision::decimation::mask;
use crate::collision::directed_pair::DirectedPair;
use crate::collision::exact_surface::{OnFace, exact_on_face, on_face, with_allowance};
use crate::collision::facing::faces_away;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::node_key::{ALL, SHORTEST_SHARE};
use crate::collision::placement::Placed;
use crate::collision::rules::{FacePairRules, Mated, Mating};
use crate::io::{Flags, Work};
use crate::math::pose::Pose;
use crate::math::scalar::inverse_sqrt;
use crate::math::symmetric6::dot;

/// A gradient shorter than this (squared) tells no direction: the field is clamped there, or between two surfaces. Within a cell of a sharp edge
/// it shrinks to about 0.3 while its direction is still good.
const LEAST_GRADIENT2: f32 = 0.01;
/// The motion a tick ends with lies between that so far and that without contacts, or is turned by the contacts: the end of a rod struck at
/// the other end moves half as fast again. So the approach by either is taken this many times.
pub(crate) const APPROACH: f32 = 2.0;
/// What would be due within so many more ticks like the last one counts as near, and is looked at every tick: finding out whether it is, with all of
/// a leaf, costs as much.
const NEAR_TICKS: f32 = 4.0;
/// One search.
pub(crate) struct Search<'s, 'i> {
    pub scene: &'s SceneImage<'i>,
    pub parts: &'s [Placed],
    /// Index of the held part.
    pub held: u16,
    pub held_shape: Shape<'i>,
    /// Its points are this far inward of where they are stored, to voxmaps, m.
    pub shrunk_m: f32,
    pub pose: Pose,
    /// World position of its centre of mass, m.
    pub center: Vec3,
    /// No point can travel farther in this tick: points with larger gaps are not looked at closely, m.
    pub margin: f32,
    /// How far any point went in the last tick at most, m.
    pub way: f32,
    /// Points that come as near as this by the motion so far, or by that without contacts, are candidates, m.
    pub slack: f32,
    /// The last tick's motion and that without contacts, of one period, scaled as the step's unknowns, m.
    pub motions: [[f32; 6]; 2],
    /// How much gap a lever makes up for when contacts are chosen: margin/reach², so that at the object's farthest point it is the margin, 1/m.
    pub swing: f32,
    /// 1/L of the step's scaling, 1/m.
    pub inverse_length: f32,
    /// The last tick came near the budget.
    pub busy: bool,
    /// Of the points of a leaf that is near only each 2ⁿth is looked at.
    pub decimation: u8,
    /// Work allowed, look-ups.
    pub budget: u32,
    /// What of it is the step's.
    pub reserved: u32,
    /// Contacts that will be in it though none is found, for they are carried over.
    pub carried: u32,
    /// Points that come this near are braked, m; 0 for no braking. Then points in proximity voxels are wanted too.
    pub braking_m: f32,
    /// Where guided faces meet, contact makes allowance_m.
    pub rules: &'s dyn FacePairRules,
}

impl<'i> Search<'_, 'i> {
    /// Points that come as near as this are looked at every tick, m.
    #[inline]
    pub fn near(&self) -> f32 {
        (self.margin + NEAR_TICKS * self.way) * (1.0 / SHORTEST_SHARE)
    }

    /// How far a contact's gap may close in this tick, m, at least 0.
    #[inline]
    pub fn approach(&self, row: &[f32; 6]) -> f32 {
        let mut most = 0.0f32;
        for motion in &self.motions {
            let closing = -dot(row, motion);
            if closing > most {
                most = closing;
            }
        }
        APPROACH * most
    }

    /// Fills `contacts`, from `start` on and round; returns where to go on when the budget ran out, and what it took.
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
        traversal.spent -= CANDIDATE * traversal.expected;
        let used = Used {
            all: traversal.used(),
            on_points: traversal.on_points / LOOKUP,
        };
        if let Some(stop) = stop {
            work.flags.insert(Flags::BUDGET);
            contacts.carry(&self.motions[0], |leaf| {
                let seen = if start < stop {
                    start <= leaf && leaf < stop
                } else {
                    start <= leaf || leaf < stop
                };
                !seen
            });
        }
        (stop, used)
    }

    /// Trees and fields of pair `index`, or none when the two parts' spheres are apart.
    fn pair(&self, index: u16) -> Option<DirectedPair<'i>> {
        let part = index / 2;
        let other = self.parts.get(usize::from(part))?;
        let held = self.parts.get(usize::from(self.held))?;
        let apart = held.radius + other.radius + self.margin + self.shrunk_m;
        let held_center = self.pose.transform_point(held.local_center);
        if part == self.held || (held_center - other.center).length_squared() > apart * apart {
            return None;
        }
        let parts = self.scene.parts().len();
        if usize::from(part) >= parts {
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

    /// A walk that has not begun, into an empty store; with `put_aside` what that held can be carried over.
    pub fn traverse<'w>(
        &'w self,
        put_aside: bool,
        coherence: &'w mut Coherence,
        contacts: &'w mut Contacts,
        work: &'w mut Work,
    ) -> Traversal<'w, 'w, 'i> {
        contacts.begin(put_aside);
        Traversal {
            search: self,
            horizon: coherence.horizon(self.margin),
            coherence,
            contacts,
            work,
            spent: LOOKUP * self.reserved + CANDIDATE * self.carried,
            expected: self.carried,
            on_points: 0,
            aside: 0,
            exclusion_work: 0,
            left_out: 0,
            faces_sought: 0,
            mated: Mated::NONE,
            near: 0,
        }
    }
}

/// A search under way.
pub(crate) struct Traversal<'w, 's, 'i> {
    pub search: &'w Search<'s, 'i>,
    pub coherence: &'w mut Coherence,
    /// Travel at which what lies within the margin is due.
    horizon: u32,
    pub contacts: &'w mut Contacts,
    pub work: &'w mut Work,
    /// Of the budget, eighths of a look-up.
    pub spent: u32,
    /// Of that, on points rather than the way to them.
    on_points: u32,
    /// Of that, for what decimation leaves out of the leaf that is looked at.
    pub aside: u32,
    /// Of that, for what exclusions keep apart.
    pub exclusion_work: u32,
    /// Candidates paid for and not yet found.
    expected: u32,
    /// Leaves looked at for what decimation leaves out of them.
    pub left_out: u32,
    /// Leaves whose face_cache were asked for.
    pub faces_sought: u32,
    /// What guidance said of the last point's faces.
    mated: Mated,
    /// Points within the margin.
    pub near: u32,
}

impl Traversal<'_, '_, '_> {
    /// All of a pair.
    pub fn all(&mut self, pair: &DirectedPair<'_>) {
        let _ = self.nodes(pair, 0, u32::MAX);
    }

    /// One point of the leaf `node`: as `found`, or looked up.
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

    /// Everything from `start` to before `end` (or the last); where it stopped when the budget ran out.
    fn pairs(&mut self, start: NodeCursor, end: Option<NodeCursor>) -> Option<NodeCursor> {
        let pairs = 2 * self.search.parts.len() as u16;
        let last = end.map_or(pairs, |e| (e.pair + 1).min(pairs));
        for index in start.pair..last {
            let Some(pair) = self.search.pair(index) else {
                continue;
            };
            let from = if index == start.pair { start.node } else { 0 };
            let to = match end {
                Some(end) if end.pair == index => end.node,
                _ => u32::MAX,
            };
            let stopped = self.nodes(&pair, from, to);
            if stopped.is_some() {
                return stopped;
            }
        }
        None
    }

    /// Nodes `from..to` of a pair in preorder, skipping what is too far; where it stopped when the budget ran out.
    ///
    /// Ends because every record's `skip` points forward (checked when the image was opened).
    fn nodes(&mut self, pair: &DirectedPair<'_>, from: u32, to: u32) -> Option<NodeCursor> {
        if pair.left_out() {
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
            let mut asked = false;
            let mut near = ALL;
            match self.coherence.query(key, self.horizon, node.skip == index + 1) {
                Known::Far(due) => {
                    self.spent += PASSED_OVER;
                    ancestors.note(due);
                    index = node.skip;
                    continue;
                }
                Known::Near(points) => {
                    self.spent += PASSED_OVER;
                    near = points;
                }
                Known::Expired => {
                    self.spent += PASSED_OVER;
                    asked = true;
                }
                Known::Nothing => {
                    self.spent += NODE;
                    self.work.nodes += 1;
                    let distance = pair.distance(node.center) - (node.radius + edge_error);
                    if distance > self.search.margin {
                        ancestors.note(self.coherence.set_distance(key, distance));
                        index = node.skip;
                        continue;
                    }
                    self.coherence.set_near(key);
                    asked = true;
                }
            }
            index += 1;
            if node.skip != index {
                ancestors.open(key, node.skip);
                continue;
            }
            let mask = mask(self.search.decimation, node.first_point);
            let points = node.points(pair.points);
            // Asked as seldom as the field is.
            if asked
                && !pair.excluded.is_empty()
                && let Some(clear) = self.excluded(pair, points)
            {
                self.coherence.set_excluded(key, clear);
                ancestors.note(Bound::NOW);
                continue;
            }
            // A leaf is looked at as a whole, unless even the whole budget would not do.
            if (self.left() as usize) < points.len() && self.work.points > 0 {
                return Some(here);
            }
            self.spent += LEAF;
            let before = self.spent;
            ancestors.note(if near != ALL {
                self.some(pair, here, points, near & mask);
                Bound::NOW
            } else {
                match mask {
                    ALL => self.points(pair, here, points),
                    mask => self.decimated(pair, here, points, mask),
                }
            });
            self.on_points += self.spent - before - self.aside;
            self.aside = 0;
        }
        ancestors.close(index, self.coherence);
        None
    }

    /// Looks one point up and offers it as a contact if it is within the margin; its gap, or a lower bound of it.
    #[inline(always)]
    pub fn point(&mut self, pair: &DirectedPair<'_>, leaf: NodeCursor, point: &PointRecord) -> f32 {
        if pair.field.is_occupancy() {
            return self.voxel(pair, leaf, point);
        }
        let in_field = pair.to_field.apply(point.position);
        match pair.field.place(in_field.to_array()) {
            Place::Cell(cell) => {
                let found = cell.face().and_then(|face| on_face(pair.faces, face, in_field));
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

    /// A point where more than one face is near, or none has a closed form.
    #[inline(never)]
    fn at_edge(
        &mut self,
        pair: &DirectedPair<'_>,
        leaf: NodeCursor,
        point: &PointRecord,
        cell: &Cell<'_>,
        p: Vec3,
    ) -> f32 {
        self.spent += EDGE;
        let nearby = pair.field.nearby(cell);
        if let Some(mut found) = exact_on_face(pair.faces, nearby, p) {
            let distance = found.distance;
            if distance < self.search.margin {
                if pair.guided {
                    self.spent += ALLOWANCE;
                    // At the rim of a guided face the other face gives way with it: the part would stand on it else.
                    let most = self.search.rules.max_allowance_m();
                    let allowance_m = |face| self.mating(pair, leaf, point, face).allowance_m;
                    found = with_allowance(found, pair.faces, nearby, p, most, allowance_m);
                }
                if !faces_away(pair, nearby, point, found.normal) {
                    self.near(pair, leaf, point, &found);
                }
            }
            return distance;
        }
        let distance = pair.field.distance(cell);
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
                face: sample.face,
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
        let turn = arm.cross(n) * self.search.inverse_length;
        let row = [n.x, n.y, n.z, turn.x, turn.y, turn.z];
        let slack = self.search.slack;
        if gap >= slack && gap >= slack + self.search.approach(&row) {
            return;
        }
        self.count_candidate();
        let arm2 = arm.length_squared();
        let reach_gap = gap - self.search.swing * arm2;
        let Some(contact) = self.contacts.offer(gap, reach_gap, arm2) else {
            return;
        };
        contact.row = row;
        contact.arm = arm;
        contact.rate = 0.0;
        contact.phase = Phase::Free;
        contact.guided = mating.guided;
        (contact.moving_face, contact.static_face) = (moving[0], fixed[0]);
        (contact.moving_edge_face, contact.static_edge_face) = if pair.backward {
            (found.edge_face, point.edge_face)
        } else {
            (point.edge_face, found.edge_face)
        };
        contact.leaf = leaf;
    }

    /// What guidance says of a point and a face.
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

    /// What guidance says of these faces of the held part and of the other one.
    #[inline]
    pub fn mating_of(&mut self, leaf: NodeCursor, moving: [u16; 2], fixed: [u16; 2]) -> Mating {
        (self.mated).look_up(self.search.rules, leaf.part(), moving, fixed)
    }

    /// A point may touch.
    #[inline(always)]
    pub fn count_candidate(&mut self) {
        if self.expected > 0 {
            self.expected -= 1;
        } else {
            self.spent += CANDIDATE;
        }
        self.work.candidates = self.work.candidates.saturating_add(1);
    }

    /// What was done so far, in look-ups.
    fn used(&self) -> u32 {
        self.spent / LOOKUP
    }

    /// Look-ups left.
    pub fn left(&self) -> u32 {
        self.search.budget.saturating_sub(self.used())
    }
}

/// Faces of the held part and of the other one, where a point meets a face.
#[inline(always)]
fn sides(pair: &DirectedPair<'_>, point: &PointRecord, face: u16) -> ([u16; 2], [u16; 2]) {
    let (own, other) = ([point.face, point.edge_face], [face, NO_FACE]);
    if pair.backward { (other, own) } else { (own, other) }
}

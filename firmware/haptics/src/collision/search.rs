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

use crate::collision::ancestors::Above;
use crate::collision::coherence::{Coherence, Due, Known};
use crate::collision::contact::{Contacts, Phase};
use crate::collision::cost::{CANDIDATE, EDGE, LEAF, LOOKUP, MATING, NEAR, NODE, PASSED_OVER, ROOM, Used};
use crate::collision::decimation::mask;
use crate::collision::directed_pair::Job;
use crate::collision::exact_surface::{OnFace, exact_on_face, on_face, with_room};
use crate::collision::facing::faces_away;
use crate::collision::node_cursor::Leaf;
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
    pub thinning: u8,
    /// Work allowed, look-ups.
    pub budget: u32,
    /// What of it is the step's.
    pub reserved: u32,
    /// Contacts that will be in it though none is found, for they are carried over.
    pub carried: u32,
    /// Points that come this near are braked, m; 0 for no braking. Then points in proximity voxels are wanted too.
    pub braking_m: f32,
    /// Where guided faces meet, contact makes room.
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
        start: Leaf,
        coherence: &mut Coherence,
        contacts: &mut Contacts,
        work: &mut Work,
    ) -> (Option<Leaf>, Used) {
        let mut walk = self.walk(self.busy, coherence, contacts, work);
        let stop = walk
            .jobs(start, None)
            .or_else(|| walk.jobs(Leaf::FIRST, Some(start)));
        walk.spent -= CANDIDATE * walk.expected;
        let used = Used {
            all: walk.used(),
            on_points: walk.on_points / LOOKUP,
        };
        if let Some(stop) = stop {
            work.flags.insert(Flags::BUDGET_EXCEEDED);
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

    /// Trees and fields of job `index`, or none when the two parts' spheres are apart.
    fn job(&self, index: u16) -> Option<Job<'i>> {
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
        let mut job = Job::new(
            index,
            (&self.held_shape, self.pose),
            (&other_shape, other.pose),
            self.center,
        );
        job.guided = self.rules.concerns(part);
        if job.guided && !job.field.is_occupancy() {
            job.joined = self.rules.joined(part, job.backward);
        }
        Some(job)
    }

    /// A walk that has not begun, into an empty store; with `put_aside` what that held can be carried over.
    pub fn walk<'w>(
        &'w self,
        put_aside: bool,
        coherence: &'w mut Coherence,
        contacts: &'w mut Contacts,
        work: &'w mut Work,
    ) -> Walk<'w, 'w, 'i> {
        contacts.begin(put_aside);
        Walk {
            search: self,
            horizon: coherence.horizon(self.margin),
            coherence,
            contacts,
            work,
            spent: LOOKUP * self.reserved + CANDIDATE * self.carried,
            expected: self.carried,
            on_points: 0,
            aside: 0,
            clearing: 0,
            left_out: 0,
            asked_walls: 0,
            mated: Mated::NONE,
            near: 0,
        }
    }
}

/// A search under way.
pub(crate) struct Walk<'w, 's, 'i> {
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
    /// Of that, for what thinning leaves out of the leaf that is looked at.
    pub aside: u32,
    /// Of that, for what joints keep apart.
    pub clearing: u32,
    /// Candidates paid for and not yet found.
    expected: u32,
    /// Leaves looked at for what thinning leaves out of them.
    pub left_out: u32,
    /// Leaves whose walls were asked for.
    pub asked_walls: u32,
    /// What guidance said of the last point's faces.
    mated: Mated,
    /// Points within the margin.
    pub near: u32,
}

impl Walk<'_, '_, '_> {
    /// All of a job.
    pub fn all(&mut self, job: &Job<'_>) {
        let _ = self.nodes(job, 0, u32::MAX);
    }

    /// One point of the leaf `node`: as `found`, or looked up.
    #[inline(never)]
    pub fn one(&mut self, job: &Job<'_>, node: u32, point: &PointRecord, found: Option<OnFace>) {
        let leaf = Leaf { job: job.index, node };
        match found {
            Some(found) => self.near(job, leaf, point, &found),
            None => {
                let _ = self.point(job, leaf, point);
            }
        }
    }

    /// Everything from `start` to before `end` (or the last); where it stopped when the budget ran out.
    fn jobs(&mut self, start: Leaf, end: Option<Leaf>) -> Option<Leaf> {
        let jobs = 2 * self.search.parts.len() as u16;
        let last = end.map_or(jobs, |e| (e.job + 1).min(jobs));
        for index in start.job..last {
            let Some(job) = self.search.job(index) else {
                continue;
            };
            let from = if index == start.job { start.node } else { 0 };
            let to = match end {
                Some(end) if end.job == index => end.node,
                _ => u32::MAX,
            };
            let stopped = self.nodes(&job, from, to);
            if stopped.is_some() {
                return stopped;
            }
        }
        None
    }

    /// Nodes `from..to` of a job in preorder, skipping what is too far; where it stopped when the budget ran out.
    ///
    /// Ends because every record's `skip` points forward (checked when the image was opened).
    fn nodes(&mut self, job: &Job<'_>, from: u32, to: u32) -> Option<Leaf> {
        if job.left_out() {
            return None;
        }
        let mut edge_error = EDGE_ERROR_CELLS * job.field.record().cell;
        if job.field.is_occupancy() {
            edge_error += self.search.shrunk_m;
        }
        let limit = LOOKUP.saturating_mul(self.search.budget);
        let keys = job.keys;
        let mut above = Above::new();
        let mut index = from;
        while index < to {
            let Some(node) = job.nodes.get(index as usize) else {
                break;
            };
            let here = Leaf {
                job: job.index,
                node: index,
            };
            if self.spent >= limit {
                return Some(here);
            }
            above.close(index, self.coherence);
            let key = keys.of(index);
            let mut asked = false;
            let mut near = ALL;
            match self.coherence.ask(key, self.horizon, node.skip == index + 1) {
                Known::Far(due) => {
                    self.spent += PASSED_OVER;
                    above.hear(due);
                    index = node.skip;
                    continue;
                }
                Known::Near(points) => {
                    self.spent += PASSED_OVER;
                    near = points;
                }
                Known::Due => {
                    self.spent += PASSED_OVER;
                    asked = true;
                }
                Known::Nothing => {
                    self.spent += NODE;
                    self.work.nodes += 1;
                    let distance = job.distance(node.center) - (node.radius + edge_error);
                    if distance > self.search.margin {
                        above.hear(self.coherence.set_distance(key, distance));
                        index = node.skip;
                        continue;
                    }
                    self.coherence.set_near(key);
                    asked = true;
                }
            }
            index += 1;
            if node.skip != index {
                above.open(key, node.skip);
                continue;
            }
            let mask = mask(self.search.thinning, node.first_point);
            let points = node.points(job.points);
            // Asked as seldom as the field is.
            if asked
                && !job.joined.is_empty()
                && let Some(clear) = self.joined(job, points)
            {
                self.coherence.set_joined(key, clear);
                above.hear(Due::NOW);
                continue;
            }
            // A leaf is looked at as a whole, unless even the whole budget would not do.
            if (self.left() as usize) < points.len() && self.work.points > 0 {
                return Some(here);
            }
            self.spent += LEAF;
            let before = self.spent;
            above.hear(if near != ALL {
                self.some(job, here, points, near & mask);
                Due::NOW
            } else {
                match mask {
                    ALL => self.points(job, here, points),
                    mask => self.thinned(job, here, points, mask),
                }
            });
            self.on_points += self.spent - before - self.aside;
            self.aside = 0;
        }
        above.close(index, self.coherence);
        None
    }

    /// Looks one point up and offers it as a contact if it is within the margin; its gap, or a lower bound of it.
    #[inline(always)]
    pub fn point(&mut self, job: &Job<'_>, leaf: Leaf, point: &PointRecord) -> f32 {
        if job.field.is_occupancy() {
            return self.voxel(job, leaf, point);
        }
        let in_field = job.to_field.apply(point.position);
        match job.field.place(in_field.to_array()) {
            Place::Cell(cell) => {
                let found = cell.face().and_then(|face| on_face(job.faces, face, in_field));
                if let Some(found) = found {
                    if found.distance < self.search.margin {
                        self.near(job, leaf, point, &found);
                    }
                    return found.distance;
                }
                self.at_edge(job, leaf, point, &cell, in_field)
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
    fn at_edge(&mut self, job: &Job<'_>, leaf: Leaf, point: &PointRecord, cell: &Cell<'_>, p: Vec3) -> f32 {
        self.spent += EDGE;
        let nearby = job.field.nearby(cell);
        if let Some(mut found) = exact_on_face(job.faces, nearby, p) {
            let distance = found.distance;
            if distance < self.search.margin {
                if job.guided {
                    self.spent += ROOM;
                    // At the rim of a guided face the other face gives way with it: the part would stand on it else.
                    let most = self.search.rules.most_room();
                    let room = |face| self.mating(job, leaf, point, face).room;
                    found = with_room(found, job.faces, nearby, p, most, room);
                }
                if !faces_away(job, nearby, point, found.normal) {
                    self.near(job, leaf, point, &found);
                }
            }
            return distance;
        }
        let distance = job.field.distance(cell);
        if distance >= self.search.margin {
            return distance;
        }
        let sample = job.field.sample(cell);
        let gradient = Vec3::from_array(sample.gradient);
        let squared = gradient.length_squared();
        if squared < LEAST_GRADIENT2 {
            let deep = distance < -job.field.record().cell;
            self.work.flags.insert_if(deep, Flags::DEEP);
        } else {
            let found = OnFace {
                distance,
                normal: gradient * inverse_sqrt(squared),
                face: sample.face,
                edge_face: NO_FACE,
            };
            self.near(job, leaf, point, &found);
        }
        distance
    }

    /// Offers a point within the margin as a contact.
    #[inline(always)]
    pub fn near(&mut self, job: &Job<'_>, leaf: Leaf, point: &PointRecord, found: &OnFace) {
        self.near += 1;
        self.spent += NEAR;
        let n = job.to_push * found.normal;
        let (moving, fixed) = sides(job, point, found.face);
        let mating = if job.guided {
            self.spent += MATING;
            self.mating(job, leaf, point, found.face)
        } else {
            Mating::NONE
        };
        let gap = found.distance + mating.room;
        let arm = job.to_arm.apply(point.position);
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
        (contact.moving_edge_face, contact.static_edge_face) = if job.backward {
            (found.edge_face, point.edge_face)
        } else {
            (point.edge_face, found.edge_face)
        };
        contact.leaf = leaf;
    }

    /// What guidance says of a point and a face.
    fn mating(&mut self, job: &Job<'_>, leaf: Leaf, point: &PointRecord, face: u16) -> Mating {
        let (moving, fixed) = sides(job, point, face);
        self.mating_of(leaf, moving, fixed)
    }

    /// What guidance says of these faces of the held part and of the other one.
    #[inline]
    pub fn mating_of(&mut self, leaf: Leaf, moving: [u16; 2], fixed: [u16; 2]) -> Mating {
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
fn sides(job: &Job<'_>, point: &PointRecord, face: u16) -> ([u16; 2], [u16; 2]) {
    let (own, other) = ([point.face, point.edge_face], [face, NO_FACE]);
    if job.backward { (other, own) } else { (own, other) }
}

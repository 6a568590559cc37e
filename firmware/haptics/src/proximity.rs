//! Where the held part is near another: points of one in the signed-distance field of the other, both ways.
//!
//! Forward, every point of the held part is looked up in the other part's field; backward, the other part's *edge* points are looked up in the
//! held part's field, or a sharp fixed rim would slip between the points of a tilted part. Both walk a preorder sphere tree and skip every
//! sphere that the field's distance at its centre puts farther off than the margin.
//!
//! When the look-up budget runs out, the next tick first looks at the leaves whose points pushed, then goes on where this one stopped,
//! round and round: what touches stays felt, and everything is looked at again within a few ticks.
//!
//! Cost on a Cortex-M7: about 135 instructions a look-up in the band and 15 outside (see [`Field`]), 30 to place the point, 80 more for a
//! candidate.

use glam::{Mat3, Vec3};
use mortise_protocol::image::{Field, Lookup, NO_FACE, NodeRecord, PointRecord, SceneImage};

use crate::coherence::{Coherence, Key};
use crate::contact::{Contact, Contacts, Phase};
use crate::io::{Flags, Work};
use crate::pose::Pose;
use crate::state::Placed;

/// Trilinear interpolation can overstate the distance next to a sharp edge; measured at 0.2 cells for a right angle, taken as this many.
const EDGE_ERROR_CELLS: f32 = 0.25;
/// A gradient shorter than this (squared) tells no direction: the field is clamped there, or between two surfaces. Within a cell of a sharp edge
/// it shrinks to about 0.3 while its direction is still good.
const LEAST_GRADIENT2: f32 = 0.01;
/// Passing over a point that is no edge point, or a node that is not due, costs about an eighth of a look-up.
const PASSED_OVER_PER_LOOKUP: u32 = 8;

/// Place in the order in which everything is looked at: part by part, forward before backward, node by node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Leaf {
    /// Twice the part's index, plus one for backward.
    job: u16,
    node: u32,
}

impl Leaf {
    /// The beginning.
    pub const FIRST: Self = Self { job: 0, node: 0 };

    /// Index of the other part.
    pub fn part(self) -> u16 {
        self.job / 2
    }
}

/// One search.
pub(crate) struct Search<'s, 'i> {
    pub scene: &'s SceneImage<'i>,
    pub parts: &'s [Placed],
    /// Index of the held part.
    pub held: u16,
    pub pose: Pose,
    /// World position of its centre of mass, m.
    pub center: Vec3,
    /// Points with a gap below this are candidates, m.
    pub margin: f32,
    /// 1/L of the step's scaling, 1/m.
    pub inverse_length: f32,
    /// Look-ups allowed.
    pub budget: u32,
}

/// Trees and fields of one job, and the way between their frames.
struct Job<'i> {
    index: u16,
    backward: bool,
    nodes: &'i [NodeRecord],
    points: &'i [PointRecord],
    field: Field<'i>,
    /// Tree frame to field frame.
    to_field: Affine,
    /// Tree frame to arm (from the held part's centre of mass, world axes).
    to_arm: Affine,
    /// Field gradient to the direction, in the world, that pushes the held part away.
    to_push: Mat3,
}

#[derive(Clone, Copy)]
struct Affine {
    linear: Mat3,
    offset: Vec3,
}

impl Affine {
    #[inline]
    fn apply(&self, p: [f32; 3]) -> Vec3 {
        self.linear * Vec3::from_array(p) + self.offset
    }
}

impl<'i> Search<'_, 'i> {
    /// Fills `contacts`; returns where to go on when the budget ran out. After such a tick (`resume`), `first` are the leaves to begin with.
    pub fn run(
        &self,
        resume: Option<Leaf>,
        first: &[Leaf],
        coherence: &mut Coherence,
        contacts: &mut Contacts,
        work: &mut Work,
    ) -> Option<Leaf> {
        contacts.clear();
        let mut walk = Walk {
            search: self,
            horizon: coherence.horizon(self.margin),
            coherence,
            contacts,
            work,
            passed_over: 0,
        };
        let Some(start) = resume else {
            let stopped = walk.jobs(Leaf::FIRST, None, &[]);
            walk.work
                .flags
                .insert_if(stopped.is_some(), Flags::BUDGET_EXCEEDED);
            return stopped;
        };
        let mut job = None;
        for leaf in first {
            if job.as_ref().is_none_or(|j: &Job<'_>| j.index != leaf.job) {
                job = self.job(leaf.job);
            }
            if let Some(job) = &job
                && let Some(stopped) = walk.nodes(job, leaf.node, leaf.node + 1, &[])
            {
                // The budget did not even do for what touched: begin there again.
                walk.work.flags.insert(Flags::BUDGET_EXCEEDED);
                return Some(stopped);
            }
        }
        let stopped = walk
            .jobs(start, None, first)
            .or_else(|| walk.jobs(Leaf::FIRST, Some(start), first));
        walk.work
            .flags
            .insert_if(stopped.is_some(), Flags::BUDGET_EXCEEDED);
        stopped
    }

    /// Trees and fields of job `index`, or none when the two parts' spheres are apart.
    fn job(&self, index: u16) -> Option<Job<'i>> {
        let part = index / 2;
        let other = self.parts.get(usize::from(part))?;
        let held = self.parts.get(usize::from(self.held))?;
        let apart = held.radius + other.radius + self.margin;
        let held_center = self.pose.transform_point(held.local_center);
        if part == self.held || (held_center - other.center).length_squared() > apart * apart {
            return None;
        }
        let parts = self.scene.parts().len();
        if usize::from(part) >= parts || usize::from(self.held) >= parts {
            return None;
        }
        let held_shape = self.scene.shape_of_part(usize::from(self.held));
        let other_shape = self.scene.shape_of_part(usize::from(part));
        let held_rotation = self.pose.rotation();
        let other_rotation = other.pose.rotation();
        let apart = self.pose.position - other.pose.position;
        Some(if index.is_multiple_of(2) {
            let back = other_rotation.transpose();
            Job {
                index,
                backward: false,
                nodes: held_shape.nodes,
                points: held_shape.points,
                field: other_shape.field,
                to_field: Affine {
                    linear: back * held_rotation,
                    offset: back * apart,
                },
                to_arm: Affine {
                    linear: held_rotation,
                    offset: self.pose.position - self.center,
                },
                to_push: other_rotation,
            }
        } else {
            let back = held_rotation.transpose();
            Job {
                index,
                backward: true,
                nodes: other_shape.nodes,
                points: other_shape.points,
                field: held_shape.field,
                to_field: Affine {
                    linear: back * other_rotation,
                    offset: back * -apart,
                },
                to_arm: Affine {
                    linear: other_rotation,
                    offset: other.pose.position - self.center,
                },
                to_push: held_rotation * -1.0,
            }
        })
    }
}

/// A search under way.
struct Walk<'w, 's, 'i> {
    search: &'w Search<'s, 'i>,
    coherence: &'w mut Coherence,
    /// Travel at which what lies within the margin is due.
    horizon: u32,
    contacts: &'w mut Contacts,
    work: &'w mut Work,
    /// Points that were no edge points, nodes that were not due.
    passed_over: u32,
}

impl Walk<'_, '_, '_> {
    /// Everything from `start` to before `end` (or the last) but the leaves in `done`; where it stopped when the budget ran out.
    fn jobs(&mut self, start: Leaf, end: Option<Leaf>, done: &[Leaf]) -> Option<Leaf> {
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
            let stopped = self.nodes(&job, from, to, done);
            if stopped.is_some() {
                return stopped;
            }
        }
        None
    }

    /// Nodes `from..to` of a job in preorder, skipping what is too far; where it stopped when the budget ran out.
    ///
    /// Ends because every record's `skip` points forward (checked when the image was opened).
    fn nodes(&mut self, job: &Job<'_>, from: u32, to: u32, done: &[Leaf]) -> Option<Leaf> {
        let edge_error = EDGE_ERROR_CELLS * job.field.record().cell;
        let mut index = from;
        while index < to {
            let Some(node) = job.nodes.get(index as usize) else {
                break;
            };
            let here = Leaf {
                job: job.index,
                node: index,
            };
            if self.left() == 0 {
                return Some(here);
            }
            let key = Key::new(job.index, index);
            if !self.coherence.is_due(key, self.horizon) {
                self.passed_over += 1;
                index = node.skip;
                continue;
            }
            self.work.nodes += 1;
            let center = job.to_field.apply(node.center);
            let distance = job.field.bound(center.to_array()) - (node.radius + edge_error);
            if distance > self.search.margin {
                self.coherence.set(key, distance);
                index = node.skip;
                continue;
            }
            index += 1;
            if node.skip == index && !done.contains(&here) {
                let first = node.first_point as usize;
                let points = job
                    .points
                    .get(first..first + node.point_count as usize)
                    .unwrap_or(&[]);
                if !self.points(job, here, points) {
                    return Some(here);
                }
            }
        }
        None
    }

    /// All points of a leaf; false when the budget ran out.
    fn points(&mut self, job: &Job<'_>, leaf: Leaf, points: &[PointRecord]) -> bool {
        let mut left = self.left();
        let mut nearest = f32::INFINITY;
        for point in points {
            if job.backward && point.edge_face == NO_FACE {
                self.passed_over += 1;
                if self.passed_over.is_multiple_of(PASSED_OVER_PER_LOOKUP) {
                    left = left.saturating_sub(1);
                }
                continue;
            }
            if left == 0 {
                return false;
            }
            left -= 1;
            self.work.points += 1;
            let gap = self.point(job, leaf, point);
            if gap < nearest {
                nearest = gap;
            }
        }
        self.coherence.set(Key::new(leaf.job, leaf.node), nearest);
        true
    }

    /// Looks one point up and offers it as a contact if it is within the margin; its gap, or a lower bound of it.
    #[inline]
    fn point(&mut self, job: &Job<'_>, leaf: Leaf, point: &PointRecord) -> f32 {
        let in_field = job.to_field.apply(point.position);
        let sample = match job.field.lookup(in_field.to_array()) {
            Lookup::Near(sample) => sample,
            Lookup::Far { inside: false, bound } => return bound,
            Lookup::Far { inside: true, .. } => {
                self.work.flags.insert(Flags::DEEP);
                return f32::NEG_INFINITY;
            }
        };
        if sample.distance >= self.search.margin {
            return sample.distance;
        }
        let gradient = Vec3::from_array(sample.gradient);
        let squared = gradient.length_squared();
        if squared < LEAST_GRADIENT2 {
            let deep = sample.distance < -job.field.record().cell;
            self.work.flags.insert_if(deep, Flags::DEEP);
            return sample.distance;
        }
        let n = job.to_push * (gradient * inverse_sqrt(squared));
        let arm = job.to_arm.apply(point.position);
        let turn = arm.cross(n) * self.search.inverse_length;
        let (moving_face, static_face) = if job.backward {
            (sample.face, point.face)
        } else {
            (point.face, sample.face)
        };
        self.work.candidates = self.work.candidates.saturating_add(1);
        self.contacts.offer(Contact {
            row: [n.x, n.y, n.z, turn.x, turn.y, turn.z],
            arm,
            gap: sample.distance,
            rate: 0.0,
            phase: Phase::Free,
            moving_face,
            static_face,
            leaf,
        });
        sample.distance
    }

    /// Look-ups left.
    fn left(&self) -> u32 {
        let used = self.work.nodes + self.work.points + self.passed_over / PASSED_OVER_PER_LOOKUP;
        self.search.budget.saturating_sub(used)
    }
}

/// 1/√x for ordinary positive x: first guess from the bits (within 3.5 %), three Newton steps (1.9·10⁻³, 5·10⁻⁶, below rounding).
#[inline]
fn inverse_sqrt(x: f32) -> f32 {
    let mut y = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    for _ in 0..3 {
        y *= 1.5 - 0.5 * x * y * y;
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_square_root() {
        for i in 0..10_000 {
            let x = 0.01 + 3.99 * i as f32 / 10_000.0;
            let y = inverse_sqrt(x);
            assert!(
                (f64::from(y) * f64::from(y) * f64::from(x) - 1.0).abs() < 6e-7,
                "{x}"
            );
        }
    }
}

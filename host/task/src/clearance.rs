//! Least signed distance of two placed shapes, and how far one can move before it meets the other.
//!
//! The distance of two shapes is the least signed distance of a sample of either in the other: the gap, or minus the depth of the deepest sample.
//! Signed distances are exact ([`mortise_bake::ExactSurface`]) and change by no more than their point moves, so the value at the centre of a sphere bounds
//! those of all samples in it, and the value at the middle of a stretch of a motion bounds those on the stretch. Both searches are branch and bound
//! on these bounds.
//!
//! What lies between samples is found by a descent on the surface from the least sample ([`refined`]). Parts that rest on each other stay in contact while
//! they slide, where the bounds end at [`Limits::step_mm`]: there a sample is checked once a step.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::body::{Body, Node};
use crate::motion::Motion;
use crate::work::work;

/// A body at a pose in the assembly's frame.
#[derive(Clone, Copy)]
pub struct Placed<'a> {
    /// The body.
    pub body: &'a Body,
    /// Body frame to assembly frame.
    pub pose: DAffine3,
}

/// Least distance of two placed bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Signed, mm: gap, or minus the depth.
    pub distance_mm: f64,
    /// Where, in the assembly's frame.
    pub point: DVec3,
    /// Unit direction in which the first body moves away from the second there.
    pub away: DVec3,
}

/// Limits of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Depth up to which an overlap is accepted, mm.
    pub allow_mm: f64,
    /// Travel between two checks of a sample that stays in contact, mm.
    pub step_mm: f64,
    /// Fewer samples: for a search, whose result is checked again.
    pub coarse: bool,
}

/// Directions of a query: samples of the first body in the second, and the reverse.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    Forth,
    Back,
}

const WAYS: [Way; 2] = [Way::Forth, Way::Back];

/// Sides of a query: whose samples, in whose surface, and the transform between them.
struct Sides<'a> {
    of: &'a Body,
    within: &'a Body,
    to: DAffine3,
}

fn sides<'a>(way: Way, a: Placed<'a>, b: Placed<'a>) -> Sides<'a> {
    match way {
        Way::Forth => Sides {
            of: a.body,
            within: b.body,
            to: b.pose.inverse() * a.pose,
        },
        Way::Back => Sides {
            of: b.body,
            within: a.body,
            to: a.pose.inverse() * b.pose,
        },
    }
}

/// Least signed distance of two placed bodies where it is below `within` mm, by their samples; `None` where it is not.
pub fn gap(a: Placed<'_>, b: Placed<'_>, within: f64) -> Option<Gap> {
    let (distance, way, sample) = least_sample(a, b, within, f64::NEG_INFINITY)?;
    let position = sides(way, a, b).of.samples()[sample as usize].position;
    Some(place(way, a, b, position, distance))
}

/// As the distance of [`gap`]; ends with the first sample at or below `enough`.
pub(crate) fn gap_until(a: Placed<'_>, b: Placed<'_>, within: f64, enough: f64) -> Option<f64> {
    least_sample(a, b, within, enough).map(|(distance, ..)| distance)
}

fn least_sample(a: Placed<'_>, b: Placed<'_>, within: f64, enough: f64) -> Option<(f64, Way, u32)> {
    let mut best = within;
    let mut found = None;
    for way in WAYS {
        let s = sides(way, a, b);
        let nodes = s.of.nodes(false);
        let mut stack = if nodes.is_empty() { Vec::new() } else { vec![0u32] };
        while let Some(i) = stack.pop() {
            work(1);
            let node = nodes[i as usize];
            let p = s.to.transform_point3(node.center);
            if s.within.exceeds(p, best + node.radius) {
                continue;
            }
            if node.is_leaf() {
                let d = s.within.distance(p);
                if d < best {
                    best = d;
                    found = Some((d, way, node.first));
                    if d <= enough {
                        return found;
                    }
                }
            } else {
                stack.push(node.second);
                stack.push(node.first);
            }
        }
    }
    found
}

/// The gap at a point of one of the surfaces: `position` in the frame of the body whose surface it is on.
fn place(way: Way, a: Placed<'_>, b: Placed<'_>, position: DVec3, distance_mm: f64) -> Gap {
    let s = sides(way, a, b);
    let p = s.to.transform_point3(position);
    let (of, within) = match way {
        Way::Forth => (a.pose, b.pose),
        Way::Back => (b.pose, a.pose),
    };
    let away = within.transform_vector3(s.within.outward(p)).normalize_or_zero();
    Gap {
        distance_mm,
        point: of.transform_point3(position),
        away: if way == Way::Forth { away } else { -away },
    }
}

/// Calls `each` for every sample of either body within `within` mm of the other: its place, the direction in which the first body moves away there (both in
/// the assembly's frame), and its signed distance.
pub(crate) fn each_near(a: Placed<'_>, b: Placed<'_>, within: f64, coarse: bool, each: &mut dyn FnMut(Gap)) {
    for way in WAYS {
        let s = sides(way, a, b);
        let (of, other) = match way {
            Way::Forth => (a.pose, b.pose),
            Way::Back => (b.pose, a.pose),
        };
        let nodes = s.of.nodes(coarse);
        let mut stack = if nodes.is_empty() { Vec::new() } else { vec![0u32] };
        while let Some(i) = stack.pop() {
            work(1);
            let node = nodes[i as usize];
            let p = s.to.transform_point3(node.center);
            if !node.is_leaf() {
                if !s.within.exceeds(p, within + node.radius) {
                    stack.push(node.second);
                    stack.push(node.first);
                }
                continue;
            }
            if s.within.surely_exceeds(p, within) {
                continue;
            }
            let Some((distance_mm, outward)) = s.within.distance_outward(p).filter(|d| d.0 < within) else {
                continue;
            };
            let away = other.transform_vector3(outward).normalize_or_zero();
            each(Gap {
                distance_mm,
                point: of.transform_point3(node.center),
                away: if way == Way::Forth { away } else { -away },
            });
        }
    }
}

/// Least step of [`refined`], mm, its directions a round, and its most rounds.
const LAST_STEP_MM: f64 = 2e-5;
const DIRECTIONS: usize = 10;
const ROUNDS: usize = 120;

/// As [`gap`], with what lies between samples: a descent on the surfaces from the least sample, down to steps of 0.02 µm. Random directions of a fixed seed.
pub fn refined(a: Placed<'_>, b: Placed<'_>, within: f64) -> Option<Gap> {
    let mut least = gap(a, b, within)?;
    for way in WAYS {
        let s = sides(way, a, b);
        let of = if way == Way::Forth { a.pose } else { b.pose };
        let start = of.inverse().transform_point3(least.point);
        // The point may lie on the other body's surface: the nearest point of this one starts the descent.
        let Some(start) = s.of.nearest(start) else {
            continue;
        };
        let mut p = start.point;
        let value = |p: DVec3| s.within.distance(s.to.transform_point3(p));
        let mut best = value(p);
        let mut random = fastrand::Rng::with_seed(7);
        let mut step = 0.5;
        for _ in 0..ROUNDS {
            let mut better = false;
            for _ in 0..DIRECTIONS {
                let direction = DVec3::from_array([0; 3].map(|_| 2.0 * random.f64() - 1.0));
                let Some(near) = s.of.nearest(p + step * direction) else {
                    continue;
                };
                let d = value(near.point);
                if d < best {
                    (p, best, better) = (near.point, d, true);
                }
            }
            if !better {
                step *= 0.5;
            }
            if step < LAST_STEP_MM {
                break;
            }
        }
        if best < least.distance_mm {
            least = place(way, a, b, p, best);
        }
    }
    Some(least)
}

/// Share of `motion` of `a`, 0 to 1, up to which no sample of either is deeper in the other than allowed. 1: all of it.
pub fn free_share(a: Placed<'_>, b: Placed<'_>, motion: &Motion, limits: &Limits) -> f64 {
    let mut items = Vec::new();
    for way in WAYS {
        if !sides(way, a, b).of.nodes(limits.coarse).is_empty() {
            items.push((way, 0));
        }
    }
    let earliest = AtomicU64::new(WHOLE);
    let sweep = Sweep::new(a, b, motion, limits, &earliest);
    sweep.stretch(&items, 0.0, 1.0, 0).unwrap_or(1.0)
}

/// Bits of the share 1: positive numbers are ordered as their bits.
pub(crate) const WHOLE: u64 = 1f64.to_bits();

/// Least number of pieces of a body's tree that are swept side by side: most of the work may be in few of them.
const PIECES: usize = 64;

/// As [`free_share`], to the same bits, by all cores. `earliest`: bits of the share at which this or another pair has met; what lies beyond is not searched, and
/// a pair that does not meet before has the share 1.
pub(crate) fn free_share_by_cores(
    a: Placed<'_>,
    b: Placed<'_>,
    motion: &Motion,
    limits: &Limits,
    earliest: &AtomicU64,
) -> f64 {
    let mut pieces = Vec::new();
    for way in WAYS {
        let nodes = sides(way, a, b).of.nodes(limits.coarse);
        let mut level: Vec<u32> = (0..nodes.len().min(1) as u32).collect();
        while level.len() < PIECES && level.iter().any(|&i| !nodes[i as usize].is_leaf()) {
            let halves = level.iter().flat_map(|&i| match nodes[i as usize] {
                node if node.is_leaf() => vec![i],
                node => vec![node.first, node.second],
            });
            level = halves.collect();
        }
        pieces.extend(level.into_iter().map(|i| (way, i)));
    }
    let sweep = Sweep::new(a, b, motion, limits, earliest);
    // The first stretch that a piece finds is the earliest of it, and the earliest of all pieces is that of the whole tree.
    let met = pieces
        .par_iter()
        .filter_map(|&piece| sweep.stretch(&[piece], 0.0, 1.0, 0));
    met.reduce(|| 1.0, f64::min)
}

/// Least distance of the bodies over a motion of the first where it is below `within` mm, and the share of the motion at which it is reached; `None` where it
/// stays above. Samples that stay near are checked at least every `step_mm` of travel.
pub fn least_over(
    a: Placed<'_>,
    b: Placed<'_>,
    motion: &Motion,
    step_mm: f64,
    within: f64,
) -> Option<(f64, Gap)> {
    let limits = Limits {
        allow_mm: 0.0,
        step_mm,
        coarse: false,
    };
    let mut items = Vec::new();
    for way in WAYS {
        if !sides(way, a, b).of.nodes(limits.coarse).is_empty() {
            items.push((way, 0));
        }
    }
    let mut least = Least {
        distance: within,
        found: None,
    };
    // Both ends first: most paths are narrowest at one of them.
    for t in [0.0, 1.0] {
        let moved = Placed {
            body: a.body,
            pose: motion.at(t) * a.pose,
        };
        if let Some(gap) = gap(moved, b, least.distance) {
            least = Least {
                distance: gap.distance_mm,
                found: Some((t, gap)),
            };
        }
    }
    let earliest = AtomicU64::new(WHOLE);
    let sweep = Sweep::new(a, b, motion, &limits, &earliest);
    sweep.least(&items, 0.0, 1.0, 0, &mut least);
    least.found
}

struct Least {
    distance: f64,
    found: Option<(f64, Gap)>,
}

/// Deepest halving of a motion: 2⁻²⁶ of it.
const MOST_HALVINGS: u32 = 26;

struct Sweep<'a> {
    a: Placed<'a>,
    b: Placed<'a>,
    motion: &'a Motion,
    limits: &'a Limits,
    /// Bits of the share at which something has met.
    earliest: &'a AtomicU64,
    /// Faces and edges of either body that the motion carries along themselves: samples inside follow those of the leading end on the same lines, so that they need
    /// a check at the start alone.
    following: [Vec<bool>; 2],
    /// Of either body, in its frame: velocity of the slide, angular velocity, and a point of its axis, against the other body, where these stay the same.
    velocities: [Option<[DVec3; 3]>; 2],
}

impl<'a> Sweep<'a> {
    fn new(
        a: Placed<'a>,
        b: Placed<'a>,
        motion: &'a Motion,
        limits: &'a Limits,
        earliest: &'a AtomicU64,
    ) -> Self {
        let following = [a, b].map(|of| of.body.carried_along(motion, &of.pose));
        let velocities = [(a, 1.0), (b, -1.0)].map(|(of, sense)| {
            let back = of.pose.inverse();
            let vector = |v: DVec3| sense * back.transform_vector3(v);
            let is_steady = motion.slide.cross(motion.axis * motion.angle) == DVec3::ZERO;
            let [slide, turn] = [motion.slide, motion.axis * motion.angle].map(vector);
            is_steady.then(|| [slide, turn, back.transform_point3(motion.point)])
        });
        Self {
            a,
            b,
            motion,
            limits,
            earliest,
            following,
            velocities,
        }
    }

    /// Whether all samples of a node are inside a face or edge that the motion carries along itself.
    fn follows(&self, node: &Node, way: Way) -> bool {
        let of = &self.following[usize::from(way == Way::Back)];
        of.get(node.inside as usize).copied().unwrap_or(false)
    }

    /// Whether a sample goes where its body was before, all the time.
    fn is_led(&self, s: &Sides<'_>, leaf: &Node, way: Way) -> bool {
        let Some([slide, turn, point]) = self.velocities[usize::from(way == Way::Back)] else {
            return false;
        };
        let velocity = slide + turn.cross(leaf.center - point);
        !s.of.samples()[leaf.first as usize].leads(velocity)
    }

    fn moved(&self, t: f64) -> Placed<'a> {
        Placed {
            body: self.a.body,
            pose: self.motion.at(t) * self.a.pose,
        }
    }

    fn is_free_at_start(&self, way: Way, position: DVec3) -> bool {
        let s = sides(way, self.a, self.b);
        s.within
            .exceeds(s.to.transform_point3(position), -self.limits.allow_mm)
    }

    /// Place of a node in the other body's frame at `middle`, and a bound on its travel in half of the stretch.
    fn travel(&self, s: &Sides<'_>, way: Way, i: u32, middle: f64, half: f64) -> (DVec3, f64) {
        let node = s.of.nodes(self.limits.coarse)[i as usize];
        let p = s.to.transform_point3(node.center);
        let in_assembly = if way == Way::Forth {
            self.b.pose.transform_point3(p)
        } else {
            self.b.pose.transform_point3(node.center)
        };
        // Distance from the turned axis, which the slide carries along. Of a fixed point it changes by the slide.
        let arm = self.motion.arm(in_assembly - self.motion.slide * middle) + node.radius;
        let slack = if way == Way::Back {
            self.motion.slide.length() * half
        } else {
            0.0
        };
        (p, self.motion.speed(arm + slack) * half)
    }

    /// Start of the first stretch within `from`..`to` on which a sample below `items` is too deep; `None` where none is, or none before the earliest found.
    fn stretch(&self, items: &[(Way, u32)], from: f64, to: f64, depth: u32) -> Option<f64> {
        // What meets at the same share counts: of several pairs the first is stated, whichever core is faster.
        if from.to_bits() > self.earliest.load(Ordering::Relaxed) {
            return None;
        }
        let middle = (from + to) / 2.0;
        let both = WAYS.map(|way| sides(way, self.moved(middle), self.b));
        let mut stack = items.to_vec();
        let mut left: Vec<(Way, u32)> = Vec::new();
        while let Some((way, i)) = stack.pop() {
            work(1);
            let s = &both[usize::from(way == Way::Back)];
            let node = s.of.nodes(self.limits.coarse)[i as usize];
            let is_led = self.follows(&node, way) || node.is_leaf() && self.is_led(s, &node, way);
            if is_led && from > 0.0 {
                continue;
            }
            let (p, travel) = self.travel(s, way, i, middle, (to - from) / 2.0);
            if s.within.exceeds(p, node.radius + travel - self.limits.allow_mm) {
                continue;
            }
            if is_led && node.is_leaf() {
                if self.is_free_at_start(way, node.center) {
                    continue;
                }
                self.earliest.fetch_min(0, Ordering::Relaxed);
                return Some(0.0);
            }
            let last = travel <= self.limits.step_mm / 2.0 || depth >= MOST_HALVINGS;
            if !node.is_leaf() && (node.radius > travel || last) {
                stack.push((way, node.second));
                stack.push((way, node.first));
            } else if !last {
                left.push((way, i));
            } else if !s.within.exceeds(p, -self.limits.allow_mm) {
                self.earliest.fetch_min(from.to_bits(), Ordering::Relaxed);
                return Some(from);
            }
        }
        if left.is_empty() {
            return None;
        }
        self.stretch(&left, from, middle, depth + 1)
            .or_else(|| self.stretch(&left, middle, to, depth + 1))
    }

    /// Lowers `least` to the least distance of samples below `items` within `from`..`to`.
    fn least(&self, items: &[(Way, u32)], from: f64, to: f64, depth: u32, least: &mut Least) {
        let middle = (from + to) / 2.0;
        let both = WAYS.map(|way| sides(way, self.moved(middle), self.b));
        let mut stack = items.to_vec();
        let mut left: Vec<(Way, u32)> = Vec::new();
        while let Some((way, i)) = stack.pop() {
            work(1);
            let s = &both[usize::from(way == Way::Back)];
            let node = s.of.nodes(self.limits.coarse)[i as usize];
            let (p, travel) = self.travel(s, way, i, middle, (to - from) / 2.0);
            if s.within.exceeds(p, node.radius + travel + least.distance) {
                continue;
            }
            if node.is_leaf() {
                let d = s.within.distance(p);
                if d < least.distance {
                    let position = s.of.samples()[node.first as usize].position;
                    *least = Least {
                        distance: d,
                        found: Some((middle, place(way, self.moved(middle), self.b, position, d))),
                    };
                }
            }
            let last = travel <= self.limits.step_mm / 2.0 || depth >= MOST_HALVINGS;
            if !node.is_leaf() && (node.radius > travel || last) {
                stack.push((way, node.second));
                stack.push((way, node.first));
            } else if !last {
                left.push((way, i));
            }
        }
        if !left.is_empty() {
            self.least(&left, from, middle, depth + 1, least);
            self.least(&left, middle, to, depth + 1, least);
        }
    }
}

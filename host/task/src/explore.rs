//! The search for a way by walks: where opening by opening finds none.
//!
//! A tree of poses grows from the group's place. Each walk ([`crate::walk`]) starts at a pose in a rarely visited cell of the space of poses, slides in a direction or turns about an
//! axis of the surfaces there (or a random one), and goes on while it makes progress. From every pose in a new cell straight ways out are tried. The random numbers are those of the budget's seed.

use std::collections::HashMap;

use glam::{DAffine3, DQuat, DVec3};

use crate::assembly::Assembly;
use crate::directions::candidates;
use crate::line::Line;
use crate::mobility::leaving_mm;
use crate::motion::Motion;
use crate::race::Clock;
use crate::walk::{At, KEEP_MM, Twist, Walker};
use crate::way::Path;

/// Length of a step as a share of the group's size, and its limits, mm.
const STEP: f64 = 0.02;
const STEP_MM: [f64; 2] = [0.2, 2.0];
/// Size of a cell in steps.
const CELL: f64 = 4.0;
/// Most steps of a walk, and shortest step as a share of the longest.
const STEPS: [usize; 2] = [8, 100];
const LEAST_STEP: f64 = 1.0 / 16.0;
/// Walks after which the search ends, and more of them for each cell.
const WALKS: [usize; 2] = [300, 12];
/// Progress below which a step does not count, as a share of what was wanted.
const PROGRESS: f64 = 0.15;

type Key = [i32; 6];

struct Node {
    by: DAffine3,
    parent: usize,
    /// Whether all samples, not the few of a walk, were found free on the way from the parent.
    checked: bool,
    /// Whether they were not.
    dead: bool,
}

#[derive(Default)]
struct Cell {
    nodes: Vec<usize>,
    picks: u32,
}

/// What a walk wants.
enum Aim {
    Slide(DVec3),
    /// Turn about a line fixed to the others.
    Turn(Line),
    /// Turn about a line fixed to the group.
    Carried(Line),
    Twist(Twist),
}

pub(crate) struct Explorer<'a> {
    walker: Walker<'a>,
    extra: &'a [DVec3],
    clock: &'a Clock<'a>,
    random: fastrand::Rng,
    nodes: Vec<Node>,
    cells: HashMap<Key, Cell>,
    order: Vec<Key>,
    step_mm: f64,
    /// Box of the others.
    bounds: (DVec3, DVec3),
}

impl<'a> Explorer<'a> {
    pub fn new(
        assembly: &'a Assembly,
        parts: &'a [usize],
        others: &'a [usize],
        extra: &'a [DVec3],
        clock: &'a Clock<'a>,
    ) -> Self {
        let walker = Walker::new(assembly, parts, others);
        Self {
            step_mm: (STEP * walker.size).clamp(STEP_MM[0], STEP_MM[1]),
            walker,
            extra,
            clock,
            random: fastrand::Rng::with_seed(clock.budget.seed),
            nodes: Vec::new(),
            cells: HashMap::new(),
            order: Vec::new(),
            bounds: assembly.bounds_of(others, DAffine3::IDENTITY),
        }
    }

    /// Searches until a way is found, time is over, or nothing new is met any more.
    pub fn search(&mut self) -> Option<Path> {
        self.add(DAffine3::IDENTITY, 0);
        for walks in 0.. {
            if self.clock.is_over() || walks > WALKS[0] + WALKS[1] * self.cells.len() {
                break;
            }
            let from = self.pick();
            if let Some(path) = self.walk(from) {
                return Some(path);
            }
        }
        None
    }

    fn key(&self, by: &DAffine3) -> Key {
        let cell = CELL * self.step_mm;
        let t = by.transform_point3(self.walker.middle) / cell;
        let r = DQuat::from_mat3(&by.matrix3).normalize();
        let r = if r.w < 0.0 { -r } else { r };
        let r = r.to_scaled_axis() * self.walker.gyration / cell;
        [t.x, t.y, t.z, r.x, r.y, r.z].map(|x| x.round() as i32)
    }

    /// Adds a pose; whether its cell is new.
    fn add(&mut self, by: DAffine3, parent: usize) -> bool {
        let key = self.key(&by);
        let id = self.nodes.len();
        self.nodes.push(Node {
            by,
            parent,
            checked: id == 0,
            dead: false,
        });
        let cell = self.cells.entry(key).or_default();
        cell.nodes.push(id);
        let new = cell.nodes.len() == 1;
        if new {
            self.order.push(key);
        }
        new
    }

    /// A node in a cell from which few walks started: among the newest cells, or among all.
    fn pick(&mut self) -> usize {
        let count = self.order.len();
        let from = if self.random.bool() {
            count.saturating_sub(12)
        } else {
            0
        };
        let mut best: Option<Key> = None;
        for _ in 0..6 {
            let key = self.order[self.random.usize(from..count)];
            let picks = |k: &Key| self.cells.get(k).map_or(0, |c| c.picks);
            if best.is_none_or(|b| picks(&key) < picks(&b)) {
                best = Some(key);
            }
        }
        let cell = best.and_then(|key| self.cells.get_mut(&key));
        cell.map_or(0, |cell| {
            cell.picks += 1;
            cell.nodes[self.random.usize(0..cell.nodes.len())]
        })
    }

    fn aim(&mut self, at: &At) -> Aim {
        let group = self.walker.moved(at.by);
        let found = candidates(self.walker.assembly, &group, self.walker.others);
        let middle = at.by.transform_point3(self.walker.middle);
        let random = &mut self.random;
        let any = unit(random);
        let sign = if random.bool() { 1.0 } else { -1.0 };
        let direction = one_of(random, &found.directions).map_or(any, |d| d * sign);
        match random.u32(0..100) {
            0..35 => Aim::Slide(direction),
            35..45 => Aim::Slide(any),
            45..85 => {
                let line = if random.u32(0..8) < 3
                    && let Some(axis) = one_of(random, &found.axes)
                {
                    Line {
                        direction: axis.direction * sign,
                        ..axis
                    }
                } else {
                    let touching: Vec<DVec3> = (at.near.iter())
                        .filter(|g| g.distance_mm < 6.0 * KEEP_MM)
                        .map(|g| g.point)
                        .collect();
                    let point = match random.u32(0..3) {
                        0 => middle,
                        1 => one_of(random, &touching).unwrap_or(middle),
                        _ if touching.is_empty() => middle,
                        _ => touching.iter().sum::<DVec3>() / touching.len() as f64,
                    };
                    Line {
                        point,
                        direction: if random.u32(0..3) > 0 { direction } else { any },
                    }
                };
                if random.bool() {
                    Aim::Turn(line)
                } else {
                    Aim::Carried(line)
                }
            }
            _ => Aim::Twist(Twist {
                v: any,
                w: unit(random),
            }),
        }
    }

    /// The wanted twist of a step at a pose.
    fn want(&self, aim: &Aim, start: &DAffine3, by: &DAffine3, length: f64) -> Twist {
        let middle = by.transform_point3(self.walker.middle);
        let turn = |line: &Line| Twist {
            v: line.direction.cross(middle - line.point),
            w: line.direction * self.walker.gyration,
        };
        let twist = match aim {
            Aim::Slide(d) => Twist {
                v: *d,
                w: DVec3::ZERO,
            },
            Aim::Turn(line) => turn(line),
            Aim::Carried(line) => {
                let carry = *by * start.inverse();
                turn(&Line {
                    point: carry.transform_point3(line.point),
                    direction: line.direction,
                })
            }
            Aim::Twist(twist) => *twist,
        };
        twist.times(length / twist.length().max(1e-12))
    }

    /// Ends all that was reached over a node.
    fn cut(&mut self, node: usize) {
        self.nodes[node].dead = true;
        // A parent comes before its children.
        for i in node + 1..self.nodes.len() {
            let parent = self.nodes[i].parent;
            self.nodes[i].dead |= self.nodes[parent].dead;
        }
        let nodes = &self.nodes;
        for cell in self.cells.values_mut() {
            cell.nodes.retain(|&n| !nodes[n].dead);
        }
        let cells = &self.cells;
        self.order
            .retain(|key| cells.get(key).is_some_and(|c| !c.nodes.is_empty()));
        self.cells.retain(|_, c| !c.nodes.is_empty());
    }

    fn walk(&mut self, from: usize) -> Option<Path> {
        let start = self.nodes[from].by;
        let reach = KEEP_MM + 0.6 * self.step_mm;
        let mut at = self.walker.at(start, reach);
        let aim = self.aim(&at);
        let most = self.random.usize(STEPS[0]..STEPS[1]);
        let mut last = from;
        let mut length = self.step_mm;
        for _ in 0..most {
            if self.clock.is_over() {
                return None;
            }
            let want = self.want(&aim, &start, &at.by, length);
            let next = self.walker.step(&at, &want);
            let gain = next
                .as_ref()
                .map_or(0.0, |n| self.walker.between(&at.by, &n.by).dot(&want) / length);
            let Some(next) = next.filter(|_| gain >= PROGRESS * length) else {
                length /= 2.0;
                if length < LEAST_STEP * self.step_mm {
                    break;
                }
                continue;
            };
            length = (2.0 * length).min(self.step_mm);
            let new = self.add(next.by, last);
            last = self.nodes.len() - 1;
            at = next;
            if new && let Some(out) = self.straight(&at) {
                match self.path(last, out) {
                    Ok(path) => return Some(path),
                    Err(node) => {
                        self.cut(node);
                        return None;
                    }
                }
            }
        }
        None
    }

    /// A straight way out from a pose, or no motion where the group is already outside.
    fn straight(&self, at: &At) -> Option<Option<Motion>> {
        let (assembly, others) = (self.walker.assembly, self.walker.others);
        let group = self.walker.moved(at.by);
        let (low, high) = assembly.bounds_of(self.walker.parts, at.by);
        if (low - self.bounds.1).max(self.bounds.0 - high).max_element() > 0.0 {
            return Some(None);
        }
        let found = candidates(assembly, &group, others).directions;
        for d in found.iter().chain(self.extra).flat_map(|&d| [d, -d]) {
            if (at.near.iter()).any(|g| g.away.dot(d) < -0.2 && g.distance_mm < 4.0 * KEEP_MM) {
                continue;
            }
            let motion = Motion::slide(d * leaving_mm(assembly, &group, others, d));
            if self.walker.goes(&at.by, &motion, true) {
                return Some(Some(motion));
            }
        }
        None
    }

    /// The way to a node and out, in few legs; or the first node that is not reached freely.
    fn path(&mut self, to: usize, out: Option<Motion>) -> Result<Path, usize> {
        let mut way = vec![to];
        let mut at = to;
        while at != 0 {
            at = self.nodes[at].parent;
            way.push(at);
        }
        way.reverse();
        for pair in way.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            if !self.nodes[to].checked {
                if !self
                    .walker
                    .is_free(&self.nodes[from].by, &self.nodes[to].by, false)
                {
                    return Err(to);
                }
                self.nodes[to].checked = true;
            }
        }
        let mut poses: Vec<DAffine3> = way.iter().map(|&n| self.nodes[n].by).collect();
        if let Some(out) = out {
            let last = out.at(1.0) * self.nodes[to].by;
            if !self.walker.is_free(&self.nodes[to].by, &last, false) {
                return Err(to);
            }
            poses.push(last);
        }
        Ok(crate::shorten::shorten(&self.walker, &poses))
    }
}

/// A random direction.
fn unit(random: &mut fastrand::Rng) -> DVec3 {
    loop {
        let v = DVec3::from_array([0; 3].map(|_| 2.0 * random.f64() - 1.0));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

fn one_of<T: Copy>(random: &mut fastrand::Rng, list: &[T]) -> Option<T> {
    if list.is_empty() {
        None
    } else {
        Some(list[random.usize(0..list.len())])
    }
}

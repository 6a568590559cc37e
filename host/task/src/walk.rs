//! Walks of a group among other parts: it moves as wanted and yields where it touches.
//!
//! A step is the small motion nearest to the wanted one after which every near sample keeps its distance: the least change of a linear motion under linear
//! constraints, solved by Gauss-Seidel over their multipliers (Jacobsen's yielding constraints, as physics engines use them). Where two sides cannot both keep their
//! distance the group comes to the middle, so that a walk follows the middle of a narrow passage, and where the way bends the group slides along the wall. What the linear motion
//! overlooks is mended by further steps, and the motion from pose to pose is checked by the exact sweep.

use glam::{DAffine3, DQuat, DVec3};

use crate::assembly::{Assembly, Moved, SEARCH_STEP_MM};
use crate::clearance::Gap;
use crate::motion::Motion;

/// Distance that a walk keeps where there is room, mm.
pub(crate) const KEEP_MM: f64 = 0.05;
/// Travel between two checks of samples in contact on a way that is found, mm: of a turn about a corner in a narrow passage, the longer steps of a search
/// overlook overlaps.
pub(crate) const CHECK_STEP_MM: f64 = 0.05;
/// Softness of the constraints, and rounds of their solution.
const SOFT: f64 = 0.02;
const ROUNDS: usize = 40;
/// Steps that mend an overlap after a step.
const MENDS: usize = 4;
/// Samples of one place, mm, are one constraint.
const CLUSTERS: f64 = 0.03;

/// A small motion: translation of the group's middle, and rotation times the group's radius of gyration, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Twist {
    pub v: DVec3,
    pub w: DVec3,
}

impl Twist {
    pub const ZERO: Self = Self {
        v: DVec3::ZERO,
        w: DVec3::ZERO,
    };

    pub fn dot(&self, o: &Self) -> f64 {
        self.v.dot(o.v) + self.w.dot(o.w)
    }

    pub fn length(&self) -> f64 {
        self.dot(self).sqrt()
    }

    pub fn times(&self, s: f64) -> Self {
        Self {
            v: self.v * s,
            w: self.w * s,
        }
    }
}

/// A place of a walk: the group's motion from where the file places it, and the samples that are near there.
#[derive(Clone, Debug)]
pub(crate) struct At {
    pub by: DAffine3,
    pub near: Vec<Gap>,
}

/// A group that walks.
pub(crate) struct Walker<'a> {
    pub assembly: &'a Assembly,
    pub parts: &'a [usize],
    pub others: &'a [usize],
    /// Middle of the group in place.
    pub middle: DVec3,
    /// Its radius of gyration about the middle, mm, by its samples.
    pub gyration: f64,
    /// Length of its box's diagonal, mm.
    pub size: f64,
}

impl<'a> Walker<'a> {
    pub fn new(assembly: &'a Assembly, parts: &'a [usize], others: &'a [usize]) -> Self {
        let (low, high) = assembly.bounds_of(parts, DAffine3::IDENTITY);
        let middle = (low + high) / 2.0;
        let (mut sum, mut count) = (0.0, 0.0f64);
        for &p in parts {
            let pose = assembly.placement(p);
            for s in assembly.body(p).samples() {
                sum += pose.transform_point3(s.position).distance_squared(middle);
                count += 1.0;
            }
        }
        Self {
            assembly,
            parts,
            others,
            middle,
            gyration: (sum / count.max(1.0)).sqrt().max(1e-3),
            size: low.distance(high),
        }
    }

    pub fn moved(&self, by: DAffine3) -> Moved<'a> {
        Moved {
            parts: self.parts,
            by,
        }
    }

    /// The group at `by` with the samples within `within` mm, of each place the nearest.
    pub fn at(&self, by: DAffine3, within: f64) -> At {
        let mut near = Vec::new();
        self.assembly
            .near(&self.moved(by), self.others, within, &mut near);
        let cell = CLUSTERS * self.size;
        let key = |g: &Gap| {
            let place = (g.point / cell).floor();
            let side = (g.away * 2.0).round();
            [place.x, place.y, place.z, side.x, side.y, side.z].map(|x| x as i32)
        };
        near.sort_by_cached_key(key);
        let mut kept: Vec<Gap> = Vec::with_capacity(near.len().min(256));
        let mut last = None;
        for gap in near {
            let this = Some(key(&gap));
            match kept.last_mut() {
                Some(known) if this == last => {
                    if gap.distance_mm < known.distance_mm {
                        *known = gap;
                    }
                }
                _ => kept.push(gap),
            }
            last = this;
        }
        At { by, near: kept }
    }

    /// The motion nearest to `want` after which near samples keep their distance, as far as all of them can.
    pub fn yielding(&self, at: &At, want: &Twist) -> Twist {
        let middle = at.by.transform_point3(self.middle);
        struct Row {
            v: DVec3,
            w: DVec3,
            lacks: f64,
            size: f64,
            force: f64,
        }
        let mut rows: Vec<Row> = at
            .near
            .iter()
            .map(|g| {
                let w = (g.point - middle).cross(g.away) / self.gyration;
                Row {
                    v: g.away,
                    w,
                    lacks: KEEP_MM - g.distance_mm,
                    size: g.away.length_squared() + w.length_squared() + SOFT,
                    force: 0.0,
                }
            })
            .filter(|r| r.size > 0.5)
            .collect();
        let mut twist = *want;
        for _ in 0..ROUNDS {
            let mut most: f64 = 0.0;
            for row in &mut rows {
                let moved = row.v.dot(twist.v) + row.w.dot(twist.w);
                let force = (row.force + (row.lacks - moved - SOFT * row.force) / row.size).max(0.0);
                let change = force - row.force;
                if change != 0.0 {
                    row.force = force;
                    twist.v += row.v * change;
                    twist.w += row.w * change;
                    most = most.max(change.abs());
                }
            }
            if most < 1e-4 {
                break;
            }
        }
        twist
    }

    /// Pose after a twist.
    pub fn after(&self, by: DAffine3, twist: &Twist) -> DAffine3 {
        let middle = by.transform_point3(self.middle);
        let turn = DQuat::from_scaled_axis(twist.w / self.gyration);
        DAffine3::from_translation(middle + twist.v)
            * DAffine3::from_quat(turn)
            * DAffine3::from_translation(-middle)
            * by
    }

    /// The twist from one pose to another.
    pub fn between(&self, from: &DAffine3, to: &DAffine3) -> Twist {
        let motion = self.motion(from, to);
        Twist {
            v: motion.slide,
            w: motion.axis * motion.angle * self.gyration,
        }
    }

    pub fn motion(&self, from: &DAffine3, to: &DAffine3) -> Motion {
        Motion::between(from, to, from.transform_point3(self.middle))
    }

    /// Whether the group moves freely from one pose to another; `coarse`: by few samples.
    pub fn is_free(&self, from: &DAffine3, to: &DAffine3, coarse: bool) -> bool {
        self.goes(from, &self.motion(from, to), coarse)
    }

    /// Whether a motion from a pose is free.
    pub fn goes(&self, from: &DAffine3, motion: &Motion, coarse: bool) -> bool {
        let group = self.moved(*from);
        let step_mm = if coarse { SEARCH_STEP_MM } else { CHECK_STEP_MM };
        let free = (self.assembly).free_share_beyond(&group, self.others, motion, step_mm, 0.0, coarse);
        free.0 >= 1.0
    }

    /// Moves as wanted as far as near samples allow; `None` where the result overlaps or cannot be reached. `want` has the length of a step.
    pub fn step(&self, at: &At, want: &Twist) -> Option<At> {
        let reach = want.length();
        let within = KEEP_MM + 0.6 * reach;
        let mut next = self.at(self.after(at.by, &self.yielding(at, want)), within);
        for _ in 0..MENDS {
            if next.near.iter().all(|g| g.distance_mm >= 0.0) {
                return self.is_free(&at.by, &next.by, true).then_some(next);
            }
            let mend = self.yielding(&next, &Twist::ZERO);
            if mend.length() > 2.0 * reach {
                return None;
            }
            next = self.at(self.after(next.by, &mend), within);
        }
        None
    }
}

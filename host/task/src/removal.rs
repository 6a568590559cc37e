//! Removal paths of a part or group: straight ways first, then ways of several legs.
//!
//! A leg is a slide along a candidate direction or a turn about a candidate axis ([`crate::directions`]). A way of several legs is searched from opening to
//! opening: while the group makes one leg, another motion that was blocked becomes possible. Where it does is found by testing the group *displaced* by that
//! motion past its present range, at places along the leg: the depth of its overlap there changes by no more than the group travels, so the next place
//! worth testing is as far as the overlap is deep. Of a stretch that is clear the displacement grows until the stretch is narrowest, and the leg ends
//! in its middle: so the way goes through the middle of narrow passages, and of an opening that is too small the least overlap is known.
//!
//! Cost: at each place of the search one sweep per candidate, and for each pair of a free leg and a blocked motion some tens of distance queries.

use std::time::{Duration, Instant};

use glam::{DAffine3, DVec3};

use crate::assembly::{Assembly, Moved, SEARCH_STEP_MM};
use crate::cone::cone;
use crate::directions::{Line, candidates, contact_normals};
use crate::mobility::{PLAY_MM, leaving_mm};
use crate::motion::Motion;

/// A collision-free way of a group from its place: legs one after another, in the assembly's frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// The legs. Each starts where the one before ends.
    pub legs: Vec<Motion>,
}

impl Path {
    /// Motions of the group from its place: the start (identity), and the end of every leg.
    pub fn poses(&self) -> Vec<DAffine3> {
        let mut poses = vec![DAffine3::IDENTITY];
        for leg in &self.legs {
            poses.push(leg.at(1.0) * poses[poses.len() - 1]);
        }
        poses
    }

    /// The way back, from outside into place: its legs, and where the group is at its start.
    pub fn reversed(&self) -> (DAffine3, Self) {
        let start = self.poses().pop().unwrap_or(DAffine3::IDENTITY);
        (
            start,
            Self {
                legs: self.legs.iter().rev().map(Motion::reversed).collect(),
            },
        )
    }
}

/// What keeps a group in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocked {
    /// Part of the group, and the part that holds it.
    pub pair: [usize; 2],
    /// Overlap that the group would need to leave straight, or turn by half a turn, at the most promising place found, mm: by how much it is held. `None` where
    /// no such place was within a millimetre.
    pub overlap_mm: Option<f64>,
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq)]
pub enum Removal {
    /// It comes out on this way.
    Out(Path),
    /// All that the search knows was tried.
    Blocked(Blocked),
    /// Time ran out first.
    TimedOut(Blocked),
}

/// Bounds of a search.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// When it ends.
    pub until: Instant,
    /// Most legs of a way; 1: straight ways only.
    pub legs: usize,
}

impl Budget {
    /// Ends after this long; up to twelve legs.
    pub fn lasting(time: Duration) -> Self {
        Self {
            until: Instant::now() + time,
            legs: 12,
        }
    }

    fn is_over(&self) -> bool {
        Instant::now() >= self.until
    }
}

/// Displacement past its present range by which a blocked motion is tested, as a share of the group's size and its limits, mm of travel: a larger one overlooks
/// shallow openings, a smaller one takes more tests.
const OPENING: f64 = 0.04;
const OPENING_MM: [f64; 2] = [0.5, 3.0];
/// Smallest step between tested places, mm of travel, and most places of a scan.
const SCAN_MM: f64 = 0.008;
const MOST_SCANS: usize = 300;
/// Overlap that is as good as any deeper one for the next place, mm.
const DEEP_MM: f64 = 3.0;
/// Overlap that is worth a push aside, mm; pushes, and the distance each leaves, mm.
const COMPLY_MM: f64 = 0.6;
const PUSHES: usize = 40;
const PUSH_MM: f64 = 5e-3;
/// Missed openings that are kept, the part of a leg around one that is searched for the place with the least overlap, and steps of its motion, mm.
const MOST_MISSED: usize = 6;
const NEAR_MM: f64 = 0.2;
const NEEDED_STEP_MM: f64 = 0.1;
/// Poses nearer to each other than this are one, mm and radians.
const SAME_POSE: (f64, f64) = (0.4, 0.03);
/// Directions and axes used at each place.
const DIRECTIONS: usize = 5;
const AXES: usize = 4;

/// A motion of unit travel, in either sense.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Slide(DVec3),
    /// Turn; the arm of the group's farthest point, mm.
    Turn(Line, f64),
}

impl Kind {
    /// The motion over a travel, mm.
    fn over(&self, travel: f64) -> Motion {
        match *self {
            Self::Slide(d) => Motion::slide(d * travel),
            Self::Turn(line, arm) => Motion::turn(line.point, line.direction, travel / arm),
        }
    }
}

/// Searches a way out of `parts` from among `others`, which stay.
pub fn remove(
    assembly: &Assembly,
    parts: &[usize],
    others: &[usize],
    extra: &[DVec3],
    budget: &Budget,
) -> Removal {
    let (low, high) = assembly.bounds_of(parts, DAffine3::IDENTITY);
    let opening_mm = (OPENING * low.distance(high)).clamp(OPENING_MM[0], OPENING_MM[1]);
    let mut search = Search {
        assembly,
        parts,
        others,
        extra,
        budget,
        seen: vec![DAffine3::IDENTITY],
        missed: Vec::new(),
        out_of_time: false,
        tilts: false,
        opening_mm,
    };
    let start = Moved {
        parts,
        by: DAffine3::IDENTITY,
    };
    if let Some(leg) = search.straight(&start) {
        return Removal::Out(Path { legs: vec![leg] });
    }
    let mut found = if budget.legs > 1 { search.legs() } else { None };
    if found.is_none() && budget.legs > 1 && !search.out_of_time {
        // Again, with more motions.
        search.tilts = true;
        search.seen.truncate(1);
        found = search.legs();
    }
    if let Some(path) = found {
        return Removal::Out(path);
    }
    let blocked = search.held().unwrap_or_else(|| Blocked {
        pair: search.nearest_pair(),
        overlap_mm: None,
    });
    if search.out_of_time {
        Removal::TimedOut(blocked)
    } else {
        Removal::Blocked(blocked)
    }
}

struct Search<'a> {
    assembly: &'a Assembly,
    parts: &'a [usize],
    others: &'a [usize],
    extra: &'a [DVec3],
    budget: &'a Budget,
    seen: Vec<DAffine3>,
    /// Narrowly missed openings, least overlap first.
    missed: Vec<Missed>,
    out_of_time: bool,
    /// Whether turns about the place where the group is held count.
    tilts: bool,
    /// Least displacement of an opening, mm.
    opening_mm: f64,
}

impl Kind {
    fn shifted(self, by: DVec3) -> Self {
        match self {
            Self::Slide(d) => Self::Slide(d),
            Self::Turn(line, arm) => Self::Turn(
                Line {
                    point: line.point + by,
                    ..line
                },
                arm,
            ),
        }
    }
}

/// Least overlap on a leg: where, mm along it; how deep, mm; of which pair.
type Least = (f64, f64, [usize; 2]);

/// A place along a leg at which another motion opens.
#[derive(Clone, Copy, Debug)]
struct Opening {
    /// Travel of the leg, mm.
    at: f64,
    /// A small slide after it.
    shift: Option<DVec3>,
    /// How far the motion goes beyond its range before, mm.
    gain: f64,
}

impl Opening {
    fn shift(&self) -> DAffine3 {
        DAffine3::from_translation(self.shift.unwrap_or(DVec3::ZERO))
    }
}

/// An opening that was missed.
#[derive(Clone, Copy, Debug)]
struct Missed {
    /// Where the leg starts.
    by: DAffine3,
    leg: Kind,
    /// Travel of the leg at which the least was missing, mm.
    at: f64,
    motion: Kind,
    /// Travel of the motion after which it is over, mm.
    most: f64,
    /// What was missing, mm.
    excess: f64,
    pair: [usize; 2],
}

/// A place of the search.
struct Place {
    by: DAffine3,
    legs: Vec<Motion>,
}

impl Search<'_> {
    fn group(&self, by: DAffine3) -> Moved<'_> {
        Moved {
            parts: self.parts,
            by,
        }
    }

    /// Directions to try from a pose, both ways, and extreme rays of its contacts.
    fn directions(&self, group: &Moved<'_>) -> Vec<DVec3> {
        let c = cone(&contact_normals(self.assembly, group, self.others));
        let found = candidates(self.assembly, group, self.others).directions;
        let mut all: Vec<DVec3> = Vec::new();
        let both = found
            .iter()
            .chain(self.extra)
            .chain(&c.lines)
            .flat_map(|&d| [d, -d]);
        for d in c.rays.iter().copied().chain(both) {
            if all.iter().all(|e| e.dot(d) < 1.0 - 1e-6) {
                all.push(d);
            }
        }
        all
    }

    /// A straight way out from a pose.
    fn straight(&self, group: &Moved<'_>) -> Option<Motion> {
        for d in self.directions(group) {
            if self.budget.is_over() {
                return None;
            }
            let first = Motion::slide(d * PLAY_MM);
            if self
                .assembly
                .free_share(group, self.others, &first, SEARCH_STEP_MM)
                .0
                < 1.0
            {
                continue;
            }
            let far = leaving_mm(self.assembly, group, self.others, d);
            let motion = Motion::slide(d * far);
            if self
                .assembly
                .free_share(group, self.others, &motion, SEARCH_STEP_MM)
                .0
                >= 1.0
            {
                return Some(motion);
            }
        }
        None
    }

    fn legs(&mut self) -> Option<Path> {
        let mut open = vec![Place {
            by: DAffine3::IDENTITY,
            legs: Vec::new(),
        }];
        while let Some(place) = open.pop() {
            if self.budget.is_over() {
                self.out_of_time = true;
                return None;
            }
            if place.legs.len() + 1 > self.budget.legs {
                continue;
            }
            let group = Moved {
                parts: self.parts,
                by: place.by,
            };
            if !place.legs.is_empty()
                && let Some(last) = self.straight(&group)
            {
                let mut legs = place.legs;
                legs.push(last);
                return Some(Path { legs });
            }
            let mut next = self.openings(&place);
            // The largest gain is expanded first.
            next.sort_by(|a, b| a.0.total_cmp(&b.0));
            open.extend(next.into_iter().map(|(_, place)| place));
        }
        None
    }

    /// Places reached by one leg at which another motion opens, with the gain of that motion in mm.
    fn openings(&mut self, place: &Place) -> Vec<(f64, Place)> {
        let group = Moved {
            parts: self.parts,
            by: place.by,
        };
        let kinds = self.kinds(&group);
        let mut ranges = Vec::new();
        for kind in &kinds {
            if self.budget.is_over() {
                self.out_of_time = true;
                return Vec::new();
            }
            ranges.push(self.range(&group, kind));
        }
        let mut found = Vec::new();
        for (p, &(reach, _)) in kinds.iter().zip(&ranges) {
            if reach <= PLAY_MM {
                continue;
            }
            for (q, &(range, pair)) in kinds.iter().zip(&ranges) {
                if self.budget.is_over() {
                    self.out_of_time = true;
                    return found;
                }
                if pair.is_none() {
                    continue;
                }
                if let Some(opening) = self.opening(&group, p, reach, q, range) {
                    let leg = p.over(opening.at);
                    let by = opening.shift() * leg.at(1.0) * place.by;
                    if self.is_new(by) {
                        self.seen.push(by);
                        let mut legs = place.legs.clone();
                        legs.push(leg);
                        legs.extend(opening.shift.map(Motion::slide));
                        found.push((opening.gain, Place { by, legs }));
                    }
                }
            }
        }
        found
    }

    fn kinds(&self, group: &Moved<'_>) -> Vec<Kind> {
        let found = candidates(self.assembly, group, self.others);
        let directions: Vec<DVec3> = found.directions.iter().take(DIRECTIONS).copied().collect();
        let mut kinds: Vec<Kind> = directions
            .iter()
            .flat_map(|&d| [Kind::Slide(d), Kind::Slide(-d)])
            .collect();
        let mut axes: Vec<Line> = found.axes.into_iter().take(AXES).collect();
        // Where the group is held narrowly it can tilt.
        if self.tilts
            && let Some(pivot) = self.pivot(group)
        {
            for &direction in directions.iter().take(3) {
                let axis = Line {
                    point: pivot,
                    direction,
                };
                if axes
                    .iter()
                    .all(|known| !crate::directions::same_line(*known, axis))
                {
                    axes.push(axis);
                }
            }
        }
        let points: Vec<DVec3> = self
            .parts
            .iter()
            .flat_map(|&p| {
                let pose = group.by * self.assembly.placement(p);
                self.assembly
                    .body(p)
                    .samples()
                    .iter()
                    .step_by(7)
                    .map(move |s| pose.transform_point3(s.position))
            })
            .collect();
        for axis in axes {
            let arm = points
                .iter()
                .map(|p| (*p - axis.point).reject_from_normalized(axis.direction).length())
                .fold(0.0, f64::max);
            if arm > 0.1 {
                let back = Line {
                    direction: -axis.direction,
                    ..axis
                };
                kinds.extend([Kind::Turn(axis, arm), Kind::Turn(back, arm)]);
            }
        }
        kinds
    }

    /// Middle of the samples of the group that are about as near to the others as its nearest.
    fn pivot(&self, group: &Moved<'_>) -> Option<DVec3> {
        let least = self.assembly.clearance(group, self.others, 5.0, false)?;
        let [a, b] = least.pair;
        let within = least.gap.distance_mm.max(0.0) + 0.3;
        let (pa, pb) = (
            self.assembly.placed(a, group.by),
            self.assembly.placed(b, DAffine3::IDENTITY),
        );
        let to = pb.pose.inverse() * pa.pose;
        let mut low = DVec3::INFINITY;
        let mut high = DVec3::NEG_INFINITY;
        for s in pa.body.samples() {
            if !pb.body.exceeds(to.transform_point3(s.position), within) {
                let p = pa.pose.transform_point3(s.position);
                (low, high) = (low.min(p), high.max(p));
            }
        }
        low.is_finite().then(|| (low + high) / 2.0)
    }

    /// Free travel of a motion, mm, and the pair that ends it (`None`: it leaves, or turns all around).
    fn range(&self, group: &Moved<'_>, kind: &Kind) -> (f64, Option<[usize; 2]>) {
        let most = match kind {
            Kind::Slide(d) => leaving_mm(self.assembly, group, self.others, *d),
            Kind::Turn(_, arm) => std::f64::consts::TAU * arm,
        };
        let (share, pair) = self
            .assembly
            .touch_share(group, self.others, &kind.over(most), SEARCH_STEP_MM);
        (share * most, pair)
    }

    /// Most travel by which a motion is displaced, mm: until it leaves, or half a turn.
    fn most(&self, group: &Moved<'_>, q: &Kind) -> f64 {
        match q {
            Kind::Slide(d) => leaving_mm(self.assembly, group, self.others, *d),
            Kind::Turn(_, arm) => std::f64::consts::PI * arm,
        }
    }

    /// Where along leg `p` motion `q` goes beyond its `range` by at least the displacement of an opening.
    fn opening(&mut self, group: &Moved<'_>, p: &Kind, reach: f64, q: &Kind, range: f64) -> Option<Opening> {
        if same_axis(p, q) {
            return None;
        }
        let (mut low, mut high) = (0.0, reach);
        let mut found = None;
        let mut gain = self.opening_mm;
        // The displacement doubles while there is a clear stretch.
        let most = self.most(group, q);
        while range + gain <= most {
            let travel = range + gain;
            let (at, shift) = match self.clear_stretch(group, p, low, high, q, travel) {
                Ok((from, to)) => {
                    (low, high) = (from, to);
                    ((from + to) / 2.0, None)
                }
                Err(least) => {
                    if let Some((at, excess, pair)) = least {
                        self.note(Missed {
                            by: group.by,
                            leg: *p,
                            at,
                            motion: *q,
                            most,
                            excess,
                            pair,
                        });
                    }
                    // A wider opening that was found before is as good.
                    if found.is_some() {
                        break;
                    }
                    let (at, ..) = least.filter(|&(_, excess, _)| excess <= COMPLY_MM)?;
                    (at, Some(self.comply(group, p, at, q, travel)?))
                }
            };
            let opening = Opening { at, shift, gain };
            let leg = p.over(at);
            let mut by = leg.at(1.0) * group.by;
            if let Some(shift) = shift {
                // The shift must be free where the leg ends.
                if self
                    .assembly
                    .free_share(
                        &Moved {
                            parts: self.parts,
                            by,
                        },
                        self.others,
                        &Motion::slide(shift),
                        SEARCH_STEP_MM,
                    )
                    .0
                    < 1.0
                {
                    break;
                }
                by = opening.shift() * by;
            }
            // The motion itself, not its end alone, must be free.
            let carried = carry(q, &leg).shifted(shift.unwrap_or(DVec3::ZERO));
            if self
                .assembly
                .free_share(
                    &Moved {
                        parts: self.parts,
                        by,
                    },
                    self.others,
                    &carried.over(travel),
                    SEARCH_STEP_MM,
                )
                .0
                < 1.0
            {
                break;
            }
            found = Some(opening);
            gain *= 2.0;
            if shift.is_some() || high - low <= 4.0 * SCAN_MM {
                break;
            }
        }
        found
    }

    /// A small slide after which the group, at `at` of leg `p` and displaced by `q`, is clear: pushed out of its deepest overlap again and again.
    fn comply(&self, group: &Moved<'_>, p: &Kind, at: f64, q: &Kind, travel: f64) -> Option<DVec3> {
        let leg = p.over(at);
        let displaced = carry(q, &leg).over(travel).at(1.0) * leg.at(1.0) * group.by;
        let moved = |shift: DVec3| Moved {
            parts: self.parts,
            by: DAffine3::from_translation(shift) * displaced,
        };
        let mut shift = DVec3::ZERO;
        for _ in 0..PUSHES {
            let Some(met) = self.assembly.blocker(&moved(shift), self.others) else {
                // Beyond contact the middle of the play is better than its end.
                let gap = |s: DVec3| {
                    self.assembly
                        .clearance(&moved(s), self.others, 1.0, false)
                        .map_or(1.0, |c| c.gap.distance_mm)
                };
                let further = (0..=8).map(|i| shift + shift.normalize_or_zero() * (0.05 * f64::from(i)));
                return further
                    .map(|s| (gap(s), s))
                    .max_by(|a, b| a.0.total_cmp(&b.0))
                    .map(|(_, s)| s);
            };
            shift += met.gap.away * (PUSH_MM - met.gap.distance_mm);
            // Pushed back along the motion itself nothing is gained.
            let back = matches!(q, Kind::Slide(d) if shift.dot(*d) < -0.5 * shift.length());
            if back || shift.length() > 4.0 * COMPLY_MM {
                return None;
            }
        }
        None
    }

    /// Keeps an opening that was missed by the overlap `excess`.
    fn note(&mut self, missed: Missed) {
        let at = self.missed.partition_point(|m| m.excess <= missed.excess);
        self.missed.insert(at, missed);
        self.missed.truncate(MOST_MISSED);
    }

    /// What holds the group: of the missed openings the one that needs the least overlap all along its motion.
    fn held(&self) -> Option<Blocked> {
        let mut best: Option<Blocked> = None;
        for missed in &self.missed {
            // The place along the leg where the least is needed, by ternary search.
            let (mut low, mut high) = (missed.at - NEAR_MM, missed.at + NEAR_MM);
            let mut found = self.needed(missed, missed.at);
            while high - low > SCAN_MM {
                let (l, h) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                let (at_l, at_h) = (self.needed(missed, l), self.needed(missed, h));
                for (depth, pair) in [at_l, at_h] {
                    if depth < found.0 {
                        found = (depth, pair);
                    }
                }
                if at_l.0 < at_h.0 {
                    high = h
                } else {
                    low = l
                }
                if found.0 >= DEEP_MM {
                    break;
                }
            }
            let (depth, pair) = found;
            if depth <= 1.0 && best.is_none_or(|b| b.overlap_mm.is_none_or(|mm| depth < mm)) {
                best = Some(Blocked {
                    pair,
                    overlap_mm: Some(depth),
                });
            }
        }
        best
    }

    /// Largest overlap of the missed motion from `at` on its leg to its end, mm, and of which pair; stops at [`DEEP_MM`].
    fn needed(&self, missed: &Missed, at: f64) -> (f64, [usize; 2]) {
        let leg = missed.leg.over(at);
        let by = leg.at(1.0) * missed.by;
        let motion = carry(&missed.motion, &leg);
        let mut most = (0.0, missed.pair);
        let mut travel = 0.0;
        while travel < missed.most {
            let moved = Moved {
                parts: self.parts,
                by: motion.over(travel).at(1.0) * by,
            };
            let depth = self.assembly.excess(&moved, self.others, DEEP_MM);
            if let Some((excess, pair)) = depth {
                let full = excess + self.assembly.allowed_mm(pair[0], pair[1]);
                if full > most.0 {
                    most = (full, pair);
                }
                if most.0 >= 1.0 {
                    return (DEEP_MM, pair);
                }
            }
            travel += NEEDED_STEP_MM;
        }
        most
    }

    /// The first stretch of leg `p` within `low`..`high` along which the group displaced by `q` is clear; else the least overlap found.
    fn clear_stretch(
        &self,
        group: &Moved<'_>,
        p: &Kind,
        low: f64,
        high: f64,
        q: &Kind,
        travel: f64,
    ) -> Result<(f64, f64), Option<Least>> {
        let depth = |s: f64| {
            let leg = p.over(s);
            let by = carry(q, &leg).over(travel).at(1.0) * leg.at(1.0) * group.by;
            self.assembly.excess(
                &Moved {
                    parts: self.parts,
                    by,
                },
                self.others,
                DEEP_MM,
            )
        };
        // A group displaced sideways has a longer arm.
        let scale = if matches!((p, q), (Kind::Turn(..), _)) {
            1.3
        } else {
            1.0
        };
        let mut least: Option<Least> = None;
        let mut s = low;
        let mut start = None;
        for _ in 0..MOST_SCANS {
            match depth(s) {
                None => {
                    start = Some(s);
                    break;
                }
                Some((excess, pair)) => {
                    if excess < DEEP_MM && least.is_none_or(|(_, e, _)| excess < e) {
                        least = Some((s, excess, pair));
                    }
                    if s >= high {
                        break;
                    }
                    s = (s + (excess / scale).max(SCAN_MM)).min(high);
                }
            }
        }
        let Some(start) = start else { return Err(least) };
        // The end of the stretch: steps that grow, then halving.
        let (mut clear, mut step) = (start, 2.0 * SCAN_MM);
        loop {
            let next = (clear + step).min(high);
            if next <= clear {
                return Ok((start, high));
            }
            if depth(next).is_some() {
                let mut met = next;
                while met - clear > SCAN_MM / 2.0 {
                    let middle = (met + clear) / 2.0;
                    if depth(middle).is_none() {
                        clear = middle
                    } else {
                        met = middle
                    }
                }
                return Ok((start, clear));
            }
            clear = next;
            step = (2.0 * step).min(1.0);
        }
    }

    fn is_new(&self, by: DAffine3) -> bool {
        let center = self.assembly.bounds_of(self.parts, DAffine3::IDENTITY);
        let center = (center.0 + center.1) / 2.0;
        self.seen.iter().all(|known| {
            let apart = Motion::between(known, &by, known.transform_point3(center));
            apart.slide.length() > SAME_POSE.0 || apart.angle.abs() > SAME_POSE.1
        })
    }

    fn nearest_pair(&self) -> [usize; 2] {
        let group = self.group(DAffine3::IDENTITY);
        self.assembly
            .clearance(&group, self.others, f64::INFINITY, false)
            .map_or_else(
                || {
                    [
                        self.parts.first().copied().unwrap_or(0),
                        self.others.first().copied().unwrap_or(0),
                    ]
                },
                |c| c.pair,
            )
    }
}

/// A motion of the group after a leg: axes of turns are carried along, directions of slides stay.
fn carry(q: &Kind, leg: &Motion) -> Kind {
    match *q {
        Kind::Slide(d) => Kind::Slide(d),
        Kind::Turn(line, arm) => {
            let by = leg.at(1.0);
            Kind::Turn(
                Line {
                    point: by.transform_point3(line.point),
                    direction: by.transform_vector3(line.direction).normalize(),
                },
                arm,
            )
        }
    }
}

/// Whether two motions are the same one or its reverse.
fn same_axis(p: &Kind, q: &Kind) -> bool {
    match (p, q) {
        (Kind::Slide(a), Kind::Slide(b)) => a.cross(*b).length() < 1e-3,
        (Kind::Turn(a, _), Kind::Turn(b, _)) => crate::directions::same_line(*a, *b),
        _ => false,
    }
}

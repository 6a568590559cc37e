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
use crate::directions::{Line, candidates, contact_normals};
use crate::cone::cone;
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
        (start, Self { legs: self.legs.iter().rev().map(Motion::reversed).collect() })
    }
}

/// What keeps a group in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocked {
    /// Part of the group, and the part that holds it.
    pub pair: [usize; 2],
    /// Least overlap with which the search could have gone on at its narrowest place, mm; `None` where no opening was near.
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
        Self { until: Instant::now() + time, legs: 12 }
    }

    fn is_over(&self) -> bool {
        Instant::now() >= self.until
    }
}

/// Displacement past its present range by which a blocked motion is tested, mm of travel.
const OPENING_MM: f64 = 1.0;
/// Smallest step between tested places, mm of travel, and most places of a scan.
const SCAN_MM: f64 = 0.008;
const MOST_SCANS: usize = 300;
/// Overlap that is as good as any deeper one for the next place, mm.
const DEEP_MM: f64 = 3.0;
/// Overlap that is worth a push aside, mm; pushes, and the distance each leaves, mm.
const COMPLY_MM: f64 = 0.6;
const PUSHES: usize = 40;
const PUSH_MM: f64 = 5e-3;
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
pub fn remove(assembly: &Assembly, parts: &[usize], others: &[usize], extra: &[DVec3], budget: &Budget) -> Removal {
    let mut search = Search { assembly, parts, others, extra, budget, seen: vec![DAffine3::IDENTITY], blocked: None, out_of_time: false, tilts: false };
    let start = Moved { parts, by: DAffine3::IDENTITY };
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
    let blocked = search.blocked.unwrap_or_else(|| Blocked {
        pair: search.nearest_pair(),
        overlap_mm: None,
    });
    if search.out_of_time { Removal::TimedOut(blocked) } else { Removal::Blocked(blocked) }
}

struct Search<'a> {
    assembly: &'a Assembly,
    parts: &'a [usize],
    others: &'a [usize],
    extra: &'a [DVec3],
    budget: &'a Budget,
    seen: Vec<DAffine3>,
    blocked: Option<Blocked>,
    out_of_time: bool,
    /// Whether turns about the place where the group is held count.
    tilts: bool,
}

impl Kind {
    fn shifted(self, by: DVec3) -> Self {
        match self {
            Self::Slide(d) => Self::Slide(d),
            Self::Turn(line, arm) => Self::Turn(Line { point: line.point + by, ..line }, arm),
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

/// A place of the search.
struct Place {
    by: DAffine3,
    legs: Vec<Motion>,
}

impl Search<'_> {
    fn group(&self, by: DAffine3) -> Moved<'_> {
        Moved { parts: self.parts, by }
    }

    /// Directions to try from a pose, both ways, and extreme rays of its contacts.
    fn directions(&self, group: &Moved<'_>) -> Vec<DVec3> {
        let c = cone(&contact_normals(self.assembly, group, self.others));
        let found = candidates(self.assembly, group, self.others).directions;
        let mut all: Vec<DVec3> = Vec::new();
        let both = found.iter().chain(self.extra).chain(&c.lines).flat_map(|&d| [d, -d]);
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
            if self.assembly.free_share(group, self.others, &first, SEARCH_STEP_MM).0 < 1.0 {
                continue;
            }
            let far = leaving_mm(self.assembly, group, self.others, d);
            let motion = Motion::slide(d * far);
            if self.assembly.free_share(group, self.others, &motion, SEARCH_STEP_MM).0 >= 1.0 {
                return Some(motion);
            }
        }
        None
    }

    fn legs(&mut self) -> Option<Path> {
        let mut open = vec![Place { by: DAffine3::IDENTITY, legs: Vec::new() }];
        while let Some(place) = open.pop() {
            if self.budget.is_over() {
                self.out_of_time = true;
                return None;
            }
            if place.legs.len() + 1 > self.budget.legs {
                continue;
            }
            let group = Moved { parts: self.parts, by: place.by };
            if !place.legs.is_empty() && let Some(last) = self.straight(&group) {
                let mut legs = place.legs;
                legs.push(last);
                return Some(Path { legs });
            }
            let t = Instant::now();
            if std::env::var("TRACE").is_ok() { eprintln!("place legs {} by {:.2}", place.legs.len(), place.by); }
            let mut next = self.openings(&place);
            if std::env::var("TRACE").is_ok() { eprintln!("expanded {:?}: {}", t.elapsed(), next.len()); }
            // The largest gain is expanded first.
            next.sort_by(|a, b| a.0.total_cmp(&b.0));
            open.extend(next.into_iter().map(|(_, place)| place));
        }
        None
    }

    /// Places reached by one leg at which another motion opens, with the gain of that motion in mm.
    fn openings(&mut self, place: &Place) -> Vec<(f64, Place)> {
        let group = Moved { parts: self.parts, by: place.by };
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
                let Some(pair) = pair else { continue };
                let t = Instant::now();
                let o = self.opening(&group, p, reach, q, range, pair);
                if std::env::var("TRACE").is_ok() && (o.is_some() || t.elapsed().as_millis() > 300) {
                eprintln!("  p {p:.2?} reach {reach:.3} q {q:.2?} range {range:.3} -> {o:.3?} {:?}", t.elapsed());
                }
                if let Some(opening) = o {
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
        let mut kinds: Vec<Kind> = directions.iter().flat_map(|&d| [Kind::Slide(d), Kind::Slide(-d)]).collect();
        let mut axes: Vec<Line> = found.axes.into_iter().take(AXES).collect();
        // Where the group is held narrowly it can tilt.
        if self.tilts && let Some(pivot) = self.pivot(group) {
            for &direction in directions.iter().take(3) {
                let axis = Line { point: pivot, direction };
                if axes.iter().all(|known| !crate::directions::same_line(*known, axis)) {
                    axes.push(axis);
                }
            }
        }
        let points: Vec<DVec3> = self.parts.iter().flat_map(|&p| {
            let pose = group.by * self.assembly.placement(p);
            self.assembly.body(p).samples().iter().step_by(7).map(move |s| pose.transform_point3(s.position))
        }).collect();
        for axis in axes {
            let arm = points.iter().map(|p| (*p - axis.point).reject_from_normalized(axis.direction).length()).fold(0.0, f64::max);
            if arm > 0.1 {
                let back = Line { direction: -axis.direction, ..axis };
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
        let (pa, pb) = (self.assembly.placed(a, group.by), self.assembly.placed(b, DAffine3::IDENTITY));
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
        let (share, pair) = self.assembly.touch_share(group, self.others, &kind.over(most), SEARCH_STEP_MM);
        (share * most, pair)
    }

    /// Most travel by which a motion is displaced, mm: until it leaves, or half a turn.
    fn most(&self, group: &Moved<'_>, q: &Kind) -> f64 {
        match q {
            Kind::Slide(d) => leaving_mm(self.assembly, group, self.others, *d),
            Kind::Turn(_, arm) => std::f64::consts::PI * arm,
        }
    }

    /// Where along leg `p` motion `q` goes at least [`OPENING_MM`] beyond its `range`.
    fn opening(&mut self, group: &Moved<'_>, p: &Kind, reach: f64, q: &Kind, range: f64, pair: [usize; 2]) -> Option<Opening> {
        if same_axis(p, q) {
            return None;
        }
        let (mut low, mut high) = (0.0, reach);
        let mut found = None;
        let mut gain = OPENING_MM;
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
                    self.note(least.map(|(_, excess, pair)| (excess, pair)), pair);
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
                if self.assembly.free_share(&Moved { parts: self.parts, by }, self.others, &Motion::slide(shift), SEARCH_STEP_MM).0 < 1.0 {
                    break;
                }
                by = opening.shift() * by;
            }
            // The motion itself, not its end alone, must be free.
            let carried = carry(q, &leg).shifted(shift.unwrap_or(DVec3::ZERO));
            if self.assembly.free_share(&Moved { parts: self.parts, by }, self.others, &carried.over(travel), SEARCH_STEP_MM).0 < 1.0 {
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
        let moved = |shift: DVec3| Moved { parts: self.parts, by: DAffine3::from_translation(shift) * displaced };
        let mut shift = DVec3::ZERO;
        for _ in 0..PUSHES {
            let Some(met) = self.assembly.blocker(&moved(shift), self.others) else {
                // Beyond contact the middle of the play is better than its end.
                let gap = |s: DVec3| self.assembly.clearance(&moved(s), self.others, 1.0, false).map_or(1.0, |c| c.gap.distance_mm);
                let further = (0..=8).map(|i| shift + shift.normalize_or_zero() * (0.05 * f64::from(i)));
                return further.map(|s| (gap(s), s)).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, s)| s);
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

    fn note(&mut self, least: Option<(f64, [usize; 2])>, pair: [usize; 2]) {
        let overlap = least.map(|(overlap, _)| overlap);
        let pair = least.map_or(pair, |(_, pair)| pair);
        let better = match (self.blocked, overlap) {
            (None, _) => true,
            (Some(known), Some(overlap)) => known.overlap_mm.is_none_or(|o| overlap < o),
            (Some(_), None) => false,
        };
        if better {
            self.blocked = Some(Blocked { pair, overlap_mm: overlap });
        }
    }

    /// The first stretch of leg `p` within `low`..`high` along which the group displaced by `q` is clear; else the least overlap found.
    fn clear_stretch(&self, group: &Moved<'_>, p: &Kind, low: f64, high: f64, q: &Kind, travel: f64) -> Result<(f64, f64), Option<Least>> {
        let depth = |s: f64| {
            let leg = p.over(s);
            let by = carry(q, &leg).over(travel).at(1.0) * leg.at(1.0) * group.by;
            self.assembly.excess(&Moved { parts: self.parts, by }, self.others, DEEP_MM)
        };
        let scale = if matches!(p, Kind::Turn(..)) { 2.0 } else { 1.0 };
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
                    if depth(middle).is_none() { clear = middle } else { met = middle }
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
        self.assembly.clearance(&group, self.others, f64::INFINITY, false).map_or_else(
            || [self.parts.first().copied().unwrap_or(0), self.others.first().copied().unwrap_or(0)],
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
            Kind::Turn(Line { point: by.transform_point3(line.point), direction: by.transform_vector3(line.direction).normalize() }, arm)
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

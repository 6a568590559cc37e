//! The search for a way of several legs: places, the motions from each, and the order in which they are tried.

use std::collections::VecDeque;

use glam::{DAffine3, DVec3};

use crate::assembly::{Assembly, Moved, SEARCH_STEP_MM};
use crate::cone::cone;
use crate::directions::{between_planes, candidates, contact_normals};
use crate::leg::{Kind, Missed, Opening};
use crate::line::{Line, same_direction, same_line};
use crate::mobility::{PLAY_MM, leaving_mm};
use crate::motion::Motion;
use crate::race::Clock;
use crate::way::Path;

/// Displacement past its present range by which a blocked motion is tested, as a share of the group's size and its limits, mm of travel: a larger one overlooks
/// shallow openings, a smaller one takes more tests.
const OPENING: f64 = 0.04;
const OPENING_MM: [f64; 2] = [0.5, 3.0];
/// Poses nearer to each other than this are one, mm and radians.
const SAME_POSE: (f64, f64) = (0.4, 0.03);
/// Directions and axes used at each place.
const DIRECTIONS: usize = 5;
const AXES: usize = 4;
/// Directions between planes nearby that are used at each place and at the end of each leg.
const BETWEEN: usize = 3;

/// State of a search.
pub(crate) struct Search<'a> {
    pub assembly: &'a Assembly,
    pub parts: &'a [usize],
    pub others: &'a [usize],
    pub extra: &'a [DVec3],
    pub clock: &'a Clock<'a>,
    pub seen: Vec<DAffine3>,
    /// Poses from which motions were tried.
    expanded: Vec<DAffine3>,
    /// Box of the group in place.
    start: (DVec3, DVec3),
    /// Narrowly missed openings, least overlap first.
    pub missed: Vec<Missed>,
    pub out_of_time: bool,
    /// Whether turns about the place where the group is held count.
    pub tilts: bool,
    /// Least displacement of an opening, mm.
    pub opening_mm: f64,
}

impl<'a> Search<'a> {
    /// A search that has not begun.
    pub fn new(
        assembly: &'a Assembly,
        parts: &'a [usize],
        others: &'a [usize],
        extra: &'a [DVec3],
        clock: &'a Clock<'a>,
    ) -> Self {
        let (low, high) = assembly.bounds_of(parts, DAffine3::IDENTITY);
        Self {
            assembly,
            parts,
            others,
            extra,
            clock,
            seen: vec![DAffine3::IDENTITY],
            expanded: Vec::new(),
            start: (low, high),
            missed: Vec::new(),
            out_of_time: false,
            tilts: false,
            opening_mm: (OPENING * low.distance(high)).clamp(OPENING_MM[0], OPENING_MM[1]),
        }
    }
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
    pub fn straight(&self, group: &Moved<'_>) -> Option<Motion> {
        for d in self.directions(group) {
            if self.clock.is_over() {
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

    /// A way of several legs, at first by the motions of the surfaces alone.
    pub fn way(&mut self) -> Option<Path> {
        let found = self.legs();
        if found.is_some() || self.out_of_time {
            return found;
        }
        self.tilts = true;
        self.seen.truncate(1);
        self.expanded.clear();
        self.legs()
    }

    fn legs(&mut self) -> Option<Path> {
        let mut open = VecDeque::from([Place {
            by: DAffine3::IDENTITY,
            legs: Vec::new(),
        }]);
        // The place farthest from all known ones and the oldest one in turn. The way through a maze is deep; but where a part turns freely everywhere, depth first adds
        // turn after turn and misses a way of two legs.
        let mut deep = false;
        loop {
            deep = !deep;
            let place = (if deep {
                self.farthest(&mut open)
            } else {
                open.pop_front()
            })?;
            if self.clock.is_over() {
                self.out_of_time = true;
                return None;
            }
            if place.legs.len() + 1 > self.clock.budget.legs {
                continue;
            }
            self.expanded.push(place.by);
            let mut next = self.openings(&place);
            // The largest gain is expanded first.
            next.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (_, place) in next.iter().rev() {
                let group = Moved {
                    parts: self.parts,
                    by: place.by,
                };
                if let Some(last) = self.straight(&group) {
                    let mut legs = place.legs.clone();
                    legs.push(last);
                    return Some(Path { legs });
                }
            }
            open.extend(next.into_iter().map(|(_, place)| place));
        }
    }

    /// Takes out the place that is farthest from all from which motions were tried.
    fn farthest(&self, open: &mut VecDeque<Place>) -> Option<Place> {
        let far = |place: &Place| {
            (self.expanded.iter().map(|known| self.apart_mm(known, &place.by))).fold(f64::INFINITY, f64::min)
        };
        let distances = open.iter().map(far).enumerate();
        let (at, _) = distances.max_by(|a, b| a.1.total_cmp(&b.1))?;
        open.remove(at)
    }

    /// How far the group moves between two poses: its middle, and by a turn a point half as far from there as its corners, mm.
    fn apart_mm(&self, a: &DAffine3, b: &DAffine3) -> f64 {
        let (low, high) = self.start;
        let apart = Motion::between(a, b, a.transform_point3((low + high) / 2.0));
        apart.slide.length() + apart.angle.abs() * low.distance(high) / 4.0
    }

    /// Free travel of each kind of motion from a place.
    fn ranges(&mut self, group: &Moved<'_>, kinds: &[Kind]) -> Vec<(f64, Option<[usize; 2]>)> {
        let mut ranges = Vec::new();
        for kind in kinds {
            if self.clock.is_over() {
                self.out_of_time = true;
                return Vec::new();
            }
            ranges.push(self.range(group, kind));
        }
        ranges
    }

    /// Places reached by one leg at which another motion opens, with the gain of that motion in mm.
    fn openings(&mut self, place: &Place) -> Vec<(f64, Place)> {
        let group = Moved {
            parts: self.parts,
            by: place.by,
        };
        let kinds = self.kinds(&group);
        let ranges = self.ranges(&group, &kinds);
        let mut found = Vec::new();
        for (p, &(reach, _)) in kinds.iter().zip(&ranges) {
            if reach <= PLAY_MM {
                continue;
            }
            let mut openings = Vec::new();
            for (q, &(range, pair)) in kinds.iter().zip(&ranges) {
                if pair.is_some() {
                    openings.extend(self.opening(&group, p, [0.0, reach], q, range));
                }
                if range >= self.opening_mm {
                    openings.extend(self.reopening(&group, p, reach, q));
                }
                if self.clock.is_over() {
                    self.out_of_time = true;
                    return found;
                }
            }
            for q in self.at_the_end(&group, p, reach, &kinds) {
                openings.extend(self.opening(&group, p, [0.0, reach], &q, 0.0));
            }
            for opening in openings {
                found.extend(self.reached(place, p, &opening));
            }
        }
        found
    }

    /// Slides between the planes that are near at the end of leg `p`, in directions of none of `kinds`: beyond a bend of a channel.
    fn at_the_end(&self, group: &Moved<'_>, p: &Kind, reach: f64, kinds: &[Kind]) -> Vec<Kind> {
        let end = self.group(p.over(reach).at(1.0) * group.by);
        let mut found = between_planes(self.assembly, &end, self.others, self.opening_mm);
        found.retain(|d| {
            let is_along = |k: &Kind| matches!(k, Kind::Slide(known) if same_direction(*known, *d));
            !kinds.iter().any(is_along)
        });
        found.truncate(BETWEEN);
        (found.into_iter())
            .flat_map(|d| [Kind::Slide(d), Kind::Slide(-d)])
            .collect()
    }

    /// The place at an opening along leg `p`, where it is new, with its gain.
    fn reached(&mut self, place: &Place, p: &Kind, opening: &Opening) -> Option<(f64, Place)> {
        let leg = p.over(opening.at);
        let by = opening.shift() * leg.at(1.0) * place.by;
        if !self.is_new(by) {
            return None;
        }
        self.seen.push(by);
        let mut legs = place.legs.clone();
        if opening.at > 0.0 {
            legs.push(leg);
        }
        legs.extend(opening.shift.map(Motion::slide));
        Some((opening.gain, Place { by, legs }))
    }

    fn kinds(&self, group: &Moved<'_>) -> Vec<Kind> {
        let found = candidates(self.assembly, group, self.others);
        let mut directions: Vec<DVec3> = found.directions.iter().take(DIRECTIONS).copied().collect();
        let between = between_planes(self.assembly, group, self.others, self.opening_mm);
        let new = |d: &DVec3| !directions.iter().any(|known| same_direction(*known, *d));
        let between: Vec<DVec3> = between.into_iter().filter(new).take(BETWEEN).collect();
        directions.extend(between);
        let mut kinds: Vec<Kind> = directions
            .iter()
            .flat_map(|&d| [Kind::Slide(d), Kind::Slide(-d)])
            .collect();
        let mut axes: Vec<Line> = found.axes.into_iter().take(AXES).collect();
        axes.retain(|axis| !turns_into_itself(self.assembly, group, axis));
        // Where the group is held narrowly it can tilt.
        if self.tilts
            && let Some(pivot) = self.pivot(group)
        {
            for &direction in directions.iter().take(3) {
                let axis = Line {
                    point: pivot,
                    direction,
                };
                if axes.iter().all(|known| !same_line(*known, axis)) {
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
    pub fn most(&self, group: &Moved<'_>, q: &Kind) -> f64 {
        match q {
            Kind::Slide(d) => leaving_mm(self.assembly, group, self.others, *d),
            Kind::Turn(_, arm) => std::f64::consts::PI * arm,
        }
    }

    fn is_new(&self, by: DAffine3) -> bool {
        let center = (self.start.0 + self.start.1) / 2.0;
        self.seen.iter().all(|known| {
            let apart = Motion::between(known, &by, known.transform_point3(center));
            apart.slide.length() > SAME_POSE.0 || apart.angle.abs() > SAME_POSE.1
        })
    }

    pub fn nearest_pair(&self) -> [usize; 2] {
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

/// Whether a turn about `axis` leaves a group as it is: all its faces are surfaces of revolution about it.
fn turns_into_itself(assembly: &Assembly, group: &Moved<'_>, axis: &Line) -> bool {
    let turn = Motion::turn(axis.point, axis.direction, 1.0);
    group.parts.iter().all(|&part| {
        let placed = assembly.placed(part, group.by);
        let carried = placed.body.carried_along(&turn, &placed.pose);
        let faces = placed.body.surface().shape().faces.len();
        carried.iter().take(faces).all(|carried| *carried)
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// A peg turns into itself about its own axis alone, wherever it is; a block about none, nor the two together.
    #[test]
    fn a_turned_part_turns_into_itself_about_its_axis() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../app/samples/pair_d18.75_clear1.00.step");
        let assembly = Assembly::new(mortise_brep::load_step(file).unwrap()).unwrap();
        let (peg, block) = (assembly.part("peg").unwrap(), assembly.part("block").unwrap());
        let by = Motion::turn(DVec3::new(3.0, -5.0, 1.0), DVec3::X, 0.6).at(1.0);
        let placed = by * assembly.placement(peg);
        let frames = assembly.body(peg).surface().shape().faces.iter();
        let frame = (frames.filter_map(|face| match face.surface {
            mortise_brep::Surface::Cylinder { frame, .. } => Some(frame),
            _ => None,
        }))
        .next()
        .unwrap();
        let axis = Line {
            point: placed.transform_point3(frame.origin),
            direction: placed.transform_vector3(frame.z),
        };
        let beside = Line {
            point: axis.point + 0.1 * axis.direction.any_orthonormal_vector(),
            ..axis
        };
        let across = Line {
            direction: axis.direction.any_orthonormal_vector(),
            ..axis
        };
        let turns = |parts: &[usize], axis: &Line| turns_into_itself(&assembly, &Moved { parts, by }, axis);
        assert!(turns(&[peg], &axis));
        assert!(!turns(&[peg], &beside) && !turns(&[peg], &across));
        assert!(!turns(&[block], &axis) && !turns(&[peg, block], &axis));
    }
}

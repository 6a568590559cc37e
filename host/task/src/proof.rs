//! Proofs that two parts cannot come apart, with the overlap that they would need at the least.
//!
//! 1. *Linked*: a closed curve inside one part is linked with one inside or on the other. While the parts do not overlap the curves stay disjoint, and their linking
//!    number cannot change; apart it is 0.
//! 2. *Ends*: a curve inside one part runs through a flat opening of the other, whose rim lies in the other part, and has at both of its ends a ball or a disc within the part
//!    that is larger than the opening. To come off, the curve passes the rim, or the middle of an end passes the opening; both are overlaps: a disc whose middle is in the
//!    opening's plane has a diameter there, or all of itself, whose shorter side within the opening is no longer than the opening's radius.
//! 3. *Passage*: a ball within one part is enclosed by the other: every way of its centre to the outside comes nearer to the other part than the ball's radius ([`crate::passage`]).
//!
//! Each proof also holds while the parts overlap by less than a stated depth. None found does not mean that the parts come apart.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec3};
use mortise_brep::{Curve, Surface};

use crate::clearance::Placed;
use crate::disc::disc_depth;
use crate::linking::Loop;
use crate::passage::widest_below;
use crate::skeleton::Skeleton;

/// Share of a full circle or torus that must be there.
const FULL: f64 = 0.9999;
/// Share from which on the rest of a circle may lie in other material, and the distance of points at which that is tested, mm.
const HALF: f64 = 0.5;
const GAP_MM: f64 = 4e-3;
/// Distance from the material up to which a curve is on it, mm.
const ON_MM: f64 = 1e-4;
/// Least overlap of a proof, mm.
const LEAST_MM: f64 = 1e-3;
/// Accuracy of the bound of a passage, mm, and balls that are tried.
const WITHIN_MM: f64 = 2e-4;
const BALLS: usize = 3;
/// Points of each side of an opening that are tried as ends, beside those on axes; divisions of the discs of either.
const TRIED: usize = 12;
const PIECES: usize = 300;
const PIECES_AXIAL: usize = 60_000;
/// Most curves of a skeleton.
const CYCLES: usize = 4;

/// Why two parts cannot come apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Proof {
    /// A closed curve in one is linked with one in the other.
    Linked,
    /// A curve through an opening has larger balls or discs at both of its ends.
    Ends {
        /// Radii of the balls or discs, mm.
        radius_mm: [f64; 2],
        /// Radius of the opening, mm.
        opening_mm: f64,
    },
    /// A ball is enclosed.
    Passage {
        /// Its radius, mm.
        radius_mm: f64,
        /// Radius of the largest ball that leaves, at most, mm.
        opening_mm: f64,
    },
}

impl std::fmt::Display for Proof {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Linked => write!(
                f,
                "linked: a closed curve in one runs through a closed curve in the other"
            ),
            Self::Ends {
                radius_mm: [a, b],
                opening_mm,
            } => write!(
                f,
                "held on both sides: balls or discs of radius {a:.3} and {b:.3} mm beside an opening of radius {opening_mm:.3} mm"
            ),
            Self::Passage {
                radius_mm,
                opening_mm,
            } => write!(
                f,
                "enclosed: a ball of radius {radius_mm:.3} mm, and no way is wider than {opening_mm:.4} mm"
            ),
        }
    }
}

/// A proof, and the depth of overlap below which it holds, mm.
pub(crate) type Locked = (f64, Proof);

/// The strongest proof that is found that two placed parts cannot come apart.
pub(crate) fn locked(
    a: (Placed<'_>, &Skeleton),
    b: (Placed<'_>, &Skeleton),
    over: &dyn Fn() -> bool,
) -> Option<Locked> {
    let mut best: Option<Locked> = None;
    let mut add = |found: Option<Locked>| {
        if let Some(found) = found.filter(|f| f.0 >= LEAST_MM)
            && best.is_none_or(|b| found.0 > b.0)
        {
            best = Some(found);
        }
    };
    let sides = [a, b].map(Side::new);
    for (x, y) in [(0, 1), (1, 0)] {
        for curve in &sides[y].loops {
            if over() {
                return best;
            }
            if sides[x].is_near(curve) {
                add(sides[x].held_by(curve));
            }
        }
    }
    for (x, y) in [(0, 1), (1, 0)] {
        add(sides[x].enclosed_by(&sides[y], over));
    }
    best
}

/// One part of a pair, in the assembly's frame.
struct Side<'a> {
    placed: Placed<'a>,
    skeleton: Skeleton,
    /// Closed curves in the material or on it.
    loops: Vec<Loop>,
    /// Those deep in it, with their depth.
    cores: Vec<(Loop, f64)>,
}

impl<'a> Side<'a> {
    fn new((placed, skeleton): (Placed<'a>, &Skeleton)) -> Self {
        let mut skeleton = skeleton.clone();
        for p in &mut skeleton.points {
            *p = placed.pose.transform_point3(*p);
        }
        let mut side = Self {
            placed,
            skeleton,
            loops: Vec::new(),
            cores: Vec::new(),
        };
        for circle in circles(placed.body.surface().shape(), placed.pose) {
            // Its depth at its corners, and where the surface does not tell that all of it is in the material, at points so dense that no gap is overlooked.
            let depth_of = |points: &[DVec3]| {
                -(points.iter())
                    .map(|p| side.distance(*p))
                    .fold(f64::NEG_INFINITY, f64::max)
            };
            let mut at = circle.at;
            let mut depth = depth_of(&at.corners);
            if depth < -ON_MM {
                continue;
            }
            if !circle.whole {
                // Between two corners it is less deep by half of their distance at the most.
                depth -= at.corners[0].distance(at.corners[1]) / 2.0;
                if depth < 0.0 {
                    if depth_of(&at.fine(GAP_MM)) < -ON_MM {
                        continue;
                    }
                    at.gap = GAP_MM / 2.0;
                }
            }
            if depth > at.deviation + LEAST_MM {
                side.cores.push((at.clone(), depth - at.deviation));
            }
            side.loops.push(at);
        }
        side.loops.extend(side.skeleton.cycles());
        side
    }

    fn distance(&self, p: DVec3) -> f64 {
        (self.placed.body).distance_once(self.placed.pose.inverse().transform_point3(p))
    }

    /// Whether a curve of the other part encloses, by its box, something of this one.
    fn is_near(&self, curve: &Loop) -> bool {
        let box_of = |points: &[DVec3]| {
            points
                .iter()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
                    (l.min(*p), h.max(*p))
                })
        };
        let ((l, h), (low, high)) = (box_of(&curve.corners), box_of(&self.skeleton.points));
        (l - high).max(low - h).max_element() < 0.0
    }

    /// A proof by a closed curve of the other part: linked, or both ends too large for it.
    fn held_by(&self, curve: &Loop) -> Option<Locked> {
        for (core, depth) in &self.cores {
            let number = curve.linking(&core.corners);
            if number.round() != 0.0 && (number - number.round()).abs() < 0.05 {
                return Some((depth - curve.deviation - curve.gap, Proof::Linked));
            }
        }
        let tree = self.skeleton.tree(curve);
        if let Some((cycle, depth)) = tree.linked {
            let number = curve.linking(&cycle);
            let linked = number.round() != 0.0 && (number - number.round()).abs() < 0.05;
            return linked.then_some((depth - curve.deviation - curve.gap, Proof::Linked));
        }
        let normal = curve.normal?;
        // Of each side of the opening the deepest points.
        let mut sides: BTreeMap<(usize, i32), Vec<usize>> = BTreeMap::new();
        for (i, &place) in tree.places.iter().enumerate() {
            sides.entry(place).or_default().push(i);
        }
        let mut ends: Vec<((usize, i32), End)> = Vec::new();
        for (&place, points) in &mut sides {
            let beyond = |&(root, crossed): &(usize, i32)| root == place.0 && crossed != place.1;
            if !tree.places.iter().any(beyond) {
                continue;
            }
            // Ascending: those on axes are the last ones.
            let axial = points.split_off(points.partition_point(|&i| i < self.skeleton.axial));
            points.sort_by(|&i, &j| self.skeleton.depths[j].total_cmp(&self.skeleton.depths[i]));
            points.truncate(TRIED);
            points.extend(axial);
            ends.extend(
                points
                    .iter()
                    .filter_map(|&i| Some((place, self.end(i, curve, normal)?))),
            );
        }
        let mut best: Option<Locked> = None;
        for ((root, crossed), one) in &ends {
            for ((same, times), other) in &ends {
                if root != same || crossed >= times {
                    continue;
                }
                let lacks = (one.lacks_mm.min(other.lacks_mm))
                    .min(tree.bottleneck(one.at, other.at) - curve.deviation)
                    - curve.gap;
                if best.is_none_or(|b| lacks > b.0) {
                    let proof = Proof::Ends {
                        radius_mm: [one.radius_mm, other.radius_mm],
                        opening_mm: curve.inner_radius,
                    };
                    best = Some((lacks, proof));
                }
            }
        }
        best
    }

    /// The end of a curve at a point of the skeleton, where a ball or a disc parallel to the opening is larger than that.
    fn end(&self, at: usize, curve: &Loop, normal: DVec3) -> Option<End> {
        let (opening, depth) = (curve.inner_radius, self.skeleton.depths[at]);
        let ball = End {
            at,
            radius_mm: depth,
            lacks_mm: depth - opening,
        };
        let radius_mm = opening + LEAST_MM;
        let pieces = if at < self.skeleton.axial {
            PIECES
        } else {
            PIECES_AXIAL
        };
        let center = self.skeleton.points[at];
        let depth = disc_depth(&|p| self.distance(p), center, normal, radius_mm, LEAST_MM, pieces);
        let disc = End {
            at,
            radius_mm,
            lacks_mm: depth - curve.deviation,
        };
        let end = if ball.lacks_mm >= disc.lacks_mm {
            ball
        } else {
            disc
        };
        (end.lacks_mm >= LEAST_MM).then_some(end)
    }

    /// A proof by a ball of this part inside the other.
    fn enclosed_by(&self, other: &Side<'_>, over: &dyn Fn() -> bool) -> Option<Locked> {
        let (low, high) = other.placed.body.bounds();
        let to = other.placed.pose.inverse();
        let mut order: Vec<usize> = (0..self.skeleton.points.len()).collect();
        order.sort_by(|&a, &b| self.skeleton.depths[b].total_cmp(&self.skeleton.depths[a]));
        let mut tried: Vec<DVec3> = Vec::new();
        let mut best: Option<Locked> = None;
        for i in order {
            if tried.len() >= BALLS || over() {
                break;
            }
            let (center, radius) = (
                to.transform_point3(self.skeleton.points[i]),
                self.skeleton.depths[i],
            );
            if tried.iter().any(|c| c.distance(center) < radius) {
                continue;
            }
            tried.push(center);
            if center.clamp(low, high) != center {
                continue;
            }
            let distance = |p: DVec3| other.placed.body.distance_once(p);
            let space = [low - (radius + 0.1), high + (radius + 0.1)];
            if let Some(bound) = widest_below(&distance, center, space, radius, WITHIN_MM, over)
                && best.is_none_or(|b| radius - bound > b.0)
            {
                let proof = Proof::Passage {
                    radius_mm: radius,
                    opening_mm: bound,
                };
                best = Some((radius - bound, proof));
            }
        }
        best
    }
}

/// End of a curve through an opening.
struct End {
    /// Point of the skeleton.
    at: usize,
    /// Radius of the ball or disc there, mm.
    radius_mm: f64,
    /// Overlap that its way through the opening needs, mm.
    lacks_mm: f64,
}

/// A circle, and whether it is known to lie on the shape as a whole.
struct Circle {
    at: Loop,
    whole: bool,
}

/// Circles of a shape: closed edges, and of tori the core and the inner equator, which need not lie on the shape where only a part of the torus does.
fn circles(shape: &mortise_brep::Shape, pose: DAffine3) -> Vec<Circle> {
    let mut sums: Vec<(DVec3, DVec3, f64, f64)> = Vec::new();
    let mut add = |center: DVec3, normal: DVec3, radius: f64, share: f64| {
        let same = |c: &&mut (DVec3, DVec3, f64, f64)| {
            c.0.distance(center) < ON_MM && c.1.cross(normal).length() < 1e-6 && (c.2 - radius).abs() < ON_MM
        };
        match sums.iter_mut().find(same) {
            Some(known) => known.3 += share,
            None => sums.push((center, normal, radius, share)),
        }
    };
    for edge in &shape.edges {
        if let Curve::Circle { frame, radius } = edge.curve {
            add(frame.origin, frame.z, radius, edge.length_mm / (TAU * radius));
        }
    }
    let mut tori = Vec::new();
    for face in &shape.faces {
        if let Surface::Torus { frame, major, minor } = &face.surface {
            let share = face.area_mm2 / (4.0 * PI * PI * major * minor);
            let same = |t: &&mut (DVec3, DVec3, f64, f64, f64)| {
                t.0.distance(frame.origin) < ON_MM
                    && t.1.cross(frame.z).length() < 1e-6
                    && (t.2 - major).abs() < ON_MM
                    && (t.3 - minor).abs() < ON_MM
            };
            match tori.iter_mut().find(same) {
                Some(known) => known.4 += share,
                None => tori.push((frame.origin, frame.z, *major, *minor, share)),
            }
        }
    }
    for (center, normal, major, minor, share) in tori {
        if share > HALF && major > minor {
            for radius in [major, major - minor] {
                add(center, normal, radius, share);
            }
        }
    }
    sums.into_iter()
        .filter(|c| c.3 > HALF)
        .map(|(center, normal, radius, share)| Circle {
            at: Loop::circle(
                pose.transform_point3(center),
                pose.transform_vector3(normal),
                radius,
            ),
            whole: share > FULL,
        })
        .collect()
}

/// A spanning tree of a skeleton that prefers deep segments, with the crossings of a curve's region on the way to each point.
struct Tree {
    /// Root of each point, and crossings from there.
    places: Vec<(usize, i32)>,
    neighbours: Vec<Vec<(u32, f64)>>,
    /// A closed polygon that crosses the region, and its depth.
    linked: Option<(Vec<DVec3>, f64)>,
}

impl Tree {
    /// The way over the tree between two points.
    fn way(&self, from: usize, to: usize) -> Option<Vec<usize>> {
        let mut before: HashMap<usize, usize> = HashMap::from([(from, from)]);
        let mut open = VecDeque::from([from]);
        while let Some(at) = open.pop_front() {
            if at == to {
                let mut way = vec![at];
                let mut last = at;
                while last != from {
                    last = *before.get(&last)?;
                    way.push(last);
                }
                return Some(way);
            }
            for &(next, _) in &self.neighbours[at] {
                before.entry(next as usize).or_insert_with(|| {
                    open.push_back(next as usize);
                    at
                });
            }
        }
        None
    }

    /// Least depth on the way between two points, mm.
    fn bottleneck(&self, from: usize, to: usize) -> f64 {
        let Some(way) = self.way(from, to) else { return 0.0 };
        way.windows(2)
            .filter_map(|w| self.neighbours[w[0]].iter().find(|n| n.0 as usize == w[1]))
            .map(|n| n.1)
            .fold(f64::INFINITY, f64::min)
    }
}

impl Skeleton {
    fn tree(&self, curve: &Loop) -> Tree {
        self.spanning(|p, q| curve.crossings(p, q), |_| true)
    }

    /// Kruskal's tree with `crossings` of its segments summed from each root; ends at the first segment that closes a cycle with crossings that `wanted` accepts.
    fn spanning(&self, crossings: impl Fn(DVec3, DVec3) -> i32, wanted: impl Fn(&[DVec3]) -> bool) -> Tree {
        let count = self.points.len();
        let mut tree = Tree {
            places: Vec::new(),
            neighbours: vec![Vec::new(); count],
            linked: None,
        };
        // Parent, and crossings from there.
        let mut up: Vec<(usize, i32)> = (0..count).map(|i| (i, 0)).collect();
        for s in &self.segments {
            let [i, j] = s.ends.map(|e| e as usize);
            let crossed = crossings(self.points[i], self.points[j]);
            let ((a, from), (b, to)) = (root(&mut up, i), root(&mut up, j));
            if a != b {
                // Crossings from a to i, then to j, then back to b.
                up[b] = (a, from + crossed - to);
                tree.neighbours[i].push((s.ends[1], s.depth));
                tree.neighbours[j].push((s.ends[0], s.depth));
            } else if from + crossed != to
                && let Some(way) = tree.way(i, j)
            {
                let cycle: Vec<DVec3> = way.iter().map(|&k| self.points[k]).collect();
                if wanted(&cycle) {
                    tree.linked = Some((cycle, s.depth));
                    return tree;
                }
            }
        }
        tree.places = (0..count).map(|i| root(&mut up, i)).collect();
        tree
    }

    /// Long closed curves of the material that its cells do not fill: those whose ways around are much longer than the segment that closes them.
    fn cycles(&self) -> Vec<Loop> {
        let tree = self.spanning(|_, _| 0, |_| true);
        let mut long: Vec<Vec<DVec3>> = Vec::new();
        let mut hops: Vec<(usize, &crate::skeleton::Segment)> = Vec::new();
        let depth = tree.levels();
        for s in &self.segments {
            let [i, j] = s.ends.map(|e| e as usize);
            if tree.neighbours[i].iter().all(|n| n.0 != s.ends[1]) {
                hops.push((depth[i].abs_diff(depth[j]), s));
            }
        }
        hops.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.depth.total_cmp(&a.1.depth)));
        for (_, s) in hops.into_iter().take(4 * CYCLES) {
            let [i, j] = s.ends.map(|e| e as usize);
            if let Some(way) = tree.way(i, j).filter(|w| w.len() >= 12)
                && long.len() < CYCLES
            {
                let cycle: Vec<DVec3> = way.iter().map(|&k| self.points[k]).collect();
                // Not beside one that is known.
                let apart = |a: &[DVec3], b: &[DVec3]| {
                    let near = |p: &DVec3| b.iter().map(|q| q.distance(*p)).fold(f64::INFINITY, f64::min);
                    a.iter().map(near).fold(0.0, f64::max)
                };
                let step = self.points[i].distance(self.points[j]);
                if long.iter().all(|known| apart(&cycle, known) > 4.0 * step) {
                    long.push(cycle);
                }
            }
        }
        long.into_iter().map(Loop::polygon).collect()
    }
}

impl Tree {
    /// Hops of each point from the root of its part of the tree.
    fn levels(&self) -> Vec<usize> {
        let mut levels = vec![usize::MAX; self.neighbours.len()];
        for start in 0..levels.len() {
            if levels[start] != usize::MAX {
                continue;
            }
            levels[start] = 0;
            let mut open = VecDeque::from([start]);
            while let Some(at) = open.pop_front() {
                for &(next, _) in &self.neighbours[at] {
                    if levels[next as usize] == usize::MAX {
                        levels[next as usize] = levels[at] + 1;
                        open.push_back(next as usize);
                    }
                }
            }
        }
        levels
    }
}

/// Root of a point, and crossings from there; shortens the way for the next time.
fn root(up: &mut [(usize, i32)], i: usize) -> (usize, i32) {
    let mut way = vec![i];
    let mut at = i;
    while up[at].0 != at {
        at = up[at].0;
        way.push(at);
    }
    let mut sum = 0;
    for &k in way.iter().rev().skip(1) {
        sum += up[k].1;
        up[k] = (at, sum);
    }
    (at, sum)
}

//! Gaps between neighbouring parts along the borders of a cut. Pure.
//!
//! Each value is the exact signed distance of a point of one part's border to the nearest other part, in space and not in the plane alone. A border's side is
//! divided until it is short for the picture, but not where both of its ends are farther from every neighbour than the range by more than its length: the
//! distance changes by no more than the way gone.

use glam::{DAffine3, DVec2, DVec3};
use mortise_inspect::{CutPlane, Solid};

/// A piece of a border near another part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// The border's part, and the nearest other one.
    pub parts: [usize; 2],
    /// Start and end in the plane's coordinates, mm.
    pub ends: [DVec2; 2],
    /// Signed distance to the nearest other part at both, mm, negative inside it.
    pub distances_mm: [f64; 2],
}

/// Gaps along the borders of a cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaps {
    /// Gaps up to this were followed, mm.
    pub range_mm: f64,
    /// Pieces of borders, in the order of the parts.
    pub bands: Vec<Band>,
}

/// A part as placed.
#[derive(Clone, Copy)]
pub struct Placed<'a> {
    /// Index of the part.
    pub part: usize,
    /// Its solid.
    pub solid: &'a Solid,
    /// Shape to world, mm.
    pub pose: DAffine3,
    /// Bounding sphere in the world: centre and radius, mm.
    pub ball: (DVec3, f64),
}

impl Placed<'_> {
    /// The point of the surface nearest to `p`: a border's side lies on it within the border's sag only.
    fn onto(&self, p: DVec3) -> DVec3 {
        let near = self
            .solid
            .surface()
            .nearest(self.pose.inverse().transform_point3(p));
        near.map_or(p, |near| self.pose.transform_point3(near.point))
    }

    fn distance(&self, p: DVec3) -> f64 {
        self.solid.distance(self.pose.inverse().transform_point3(p))
    }
}

/// How gaps are followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Following {
    /// Gaps up to this are followed, mm.
    pub range_mm: f64,
    /// Longest piece, mm.
    pub longest_mm: f64,
}

/// Most halvings of a side.
const HALVINGS: u32 = 14;

/// A point of a side, the distance there to the nearest other part, and that part.
#[derive(Clone, Copy)]
struct Probe {
    at: DVec3,
    distance: f64,
    part: usize,
}

/// The side of one border that is followed.
struct Side<'a> {
    own: Placed<'a>,
    near: Vec<Placed<'a>>,
    plane: CutPlane,
    how: Following,
}

/// Appends to `out` the pieces of the side from `a` to `b` of `own`'s border whose gap to any of `others` is within the range.
pub fn along(
    [a, b]: [DVec3; 2],
    own: Placed<'_>,
    others: &[Placed<'_>],
    plane: CutPlane,
    how: Following,
    out: &mut Vec<Band>,
) {
    let reach = how.range_mm + a.distance(b) / 2.0;
    let middle = a.midpoint(b);
    let near: Vec<Placed<'_>> = (others.iter().copied())
        .filter(|other| other.part != own.part && other.ball.0.distance(middle) - other.ball.1 <= reach)
        .collect();
    if near.is_empty() {
        return;
    }
    let side = Side {
        own,
        near,
        plane,
        how,
    };
    side.divide([side.probe(a), side.probe(b)], 0, out);
}

impl Side<'_> {
    fn probe(&self, at: DVec3) -> Probe {
        let on = self.own.onto(at);
        let nearest = (self.near.iter())
            .map(|other| (other.distance(on), other.part))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let (distance, part) = nearest.unwrap_or((f64::INFINITY, self.own.part));
        Probe { at, distance, part }
    }

    fn divide(&self, [a, b]: [Probe; 2], depth: u32, out: &mut Vec<Band>) {
        let length = a.at.distance(b.at);
        // No point between is nearer than half of what the ends have in common, less the way to it.
        if (a.distance + b.distance - length) / 2.0 > self.how.range_mm {
            return;
        }
        if length <= self.how.longest_mm || depth >= HALVINGS {
            let nearer = if a.distance <= b.distance { a } else { b };
            out.push(Band {
                parts: [self.own.part, nearer.part],
                ends: [self.plane.to_plane(a.at), self.plane.to_plane(b.at)],
                distances_mm: [a.distance, b.distance],
            });
            return;
        }
        let middle = self.probe(a.at.midpoint(b.at));
        self.divide([a, middle], depth + 1, out);
        self.divide([middle, b], depth + 1, out);
    }
}

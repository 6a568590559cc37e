//! Curves of a shape in the frame of another: pieces of edges, and the points, circles and lines about which bulging faces lie.

use glam::{Mat3, Vec3};
use mortise_protocol::image::{EdgeRecord, Shape};

use crate::collision::exact_surface::edge_foot;
use crate::math::vector::length;

/// Largest distance of a piece of a curved edge from the edge, m.
const PIECE_M: f32 = 0.5e-6;
/// A curve in the frame of the other shape: p(t) = center + t·half + t²·bend for |t| ≤ 1, or a circle about `center`; the surface searched lies
/// `radius` from it.
#[derive(Clone, Copy)]
pub(crate) struct Curve {
    pub center: Vec3,
    pub half: Vec3,
    pub bend: Vec3,
    /// For a circle `half` and `bend` are two perpendicular radii, and t is the angle over π.
    pub circle: bool,
    pub radius: f32,
    /// Faces of the own shape that meet in it, for a piece of an edge.
    pub faces: Option<[u16; 2]>,
    /// Distance of the curve from the true one at most, m.
    pub error: f32,
}

impl Curve {
    pub fn at(&self, t: f32) -> Vec3 {
        if self.circle {
            let (sin, cos) = libm::sincosf(t * core::f32::consts::PI);
            self.center + self.half * cos + self.bend * sin
        } else {
            self.center + (self.half + self.bend * t) * t
        }
    }

    /// First and second derivative.
    pub fn derivatives(&self, t: f32) -> (Vec3, Vec3) {
        if self.circle {
            const PI: f32 = core::f32::consts::PI;
            let (sin, cos) = libm::sincosf(t * PI);
            let (x, y) = (self.half * PI, self.bend * PI);
            (y * cos - x * sin, (x * cos + y * sin) * -PI)
        } else {
            (self.half + self.bend * (2.0 * t), self.bend * 2.0)
        }
    }

    /// Largest speed, m per unit of t.
    pub fn speed(&self) -> f32 {
        if self.circle {
            length(self.half) * core::f32::consts::PI
        } else {
            length(self.half) + 2.0 * length(self.bend)
        }
    }
}

/// One of the two shapes, seen from the other.
pub(crate) struct Side<'s, 'i> {
    pub shape: &'s Shape<'i>,
    /// Its frame to the other's.
    pub rotation: Mat3,
    pub offset: Vec3,
}

impl Side<'_, '_> {
    pub fn to_other(&self, p: Vec3) -> Vec3 {
        self.rotation * p + self.offset
    }

    pub fn bring_back(&self, p: Vec3) -> Vec3 {
        self.rotation.transpose() * (p - self.offset)
    }
}

/// A piece of an edge in the other shape's frame.
pub(crate) fn placed(own: &Side<'_, '_>, edge: &EdgeRecord) -> Curve {
    let piece = placed_at_rest(edge);
    Curve {
        center: own.to_other(piece.center),
        half: own.rotation * piece.half,
        bend: own.rotation * piece.bend,
        ..piece
    }
}

/// A piece of an edge in its own frame.
pub(crate) fn placed_at_rest(edge: &EdgeRecord) -> Curve {
    Curve {
        center: Vec3::from_array(edge.center),
        half: Vec3::from_array(edge.half),
        bend: Vec3::from_array(edge.bend),
        circle: false,
        radius: 0.0,
        faces: Some(edge.faces),
        error: if edge.is_straight() { 0.0 } else { PIECE_M },
    }
}

/// The point of the exact edge nearest to the point `p` of a curve of `own`, and how far off it may be, m.
pub(crate) fn on_edge(own: &Side<'_, '_>, curve: &Curve, p: Vec3) -> (Vec3, f32) {
    let faces = curve.faces.filter(|_| curve.error > 0.0);
    let exact = faces.and_then(|faces| {
        let [a, b] = faces.map(|face| own.shape.faces.get(usize::from(face)));
        edge_foot(a?, b?, own.bring_back(p))
    });
    let exact = exact
        .map(|q| own.to_other(q))
        .filter(|&q| length(q - p) <= 2.0 * curve.error);
    exact.map_or((p, curve.error), |q| (q, 0.0))
}

/// Places at which a quadratic that meets a smooth curve at its middle and ends is farthest off.
const FARTHEST_OFF: f32 = 0.707;
/// Factor by which an error measured there is enlarged, and the least error, m.
const OFF_FACTOR: f32 = 1.5;
const LEAST_OFF_M: f32 = 0.02e-6;

/// The curve, or its halves through exact points with their error measured: the baker's tolerance is half a micrometre, and quadratics through the
/// points of a circle are sixteen times better for half of the angle.
pub(crate) fn refined(own: &Side<'_, '_>, curve: &Curve) -> heapless::Vec<Curve, 2> {
    let mut parts = heapless::Vec::new();
    if curve.error == 0.0 || curve.faces.is_none() {
        let _ = parts.push(*curve);
        return parts;
    }
    for middle in [-0.5, 0.5] {
        let [(a, off_a), (center, off), (b, off_b)] =
            [middle - 0.5, middle, middle + 0.5].map(|t| on_edge(own, curve, curve.at(t)));
        let part = Curve {
            center,
            half: (b - a) * 0.5,
            bend: (a + b) * 0.5 - center,
            ..*curve
        };
        let mut most = if off > off_a { off } else { off_a };
        most = if off_b > most { off_b } else { most };
        for t in [-FARTHEST_OFF, FARTHEST_OFF] {
            let p = part.at(t);
            let (exact, off) = on_edge(own, curve, p);
            let off = off + length(exact - p);
            most = if off > most { off } else { most };
        }
        let error = OFF_FACTOR * most + LEAST_OFF_M;
        let error = if error < curve.error { error } else { curve.error };
        let _ = parts.push(Curve { error, ..part });
    }
    parts
}

/// Where two segments are nearest to each other, as shares of their lengths (Ericson, "Real-Time Collision Detection", 5.1.9).
pub(crate) fn nearest_of_segments([p, q]: [Vec3; 2], [r, s]: [Vec3; 2]) -> [f32; 2] {
    let (d, e, apart) = (q - p, s - r, p - r);
    let (dd, ee, de) = (d.length_squared(), e.length_squared(), d.dot(e));
    let (da, ea) = (d.dot(apart), e.dot(apart));
    let clamp = |x: f32| {
        if x > 0.0 {
            if x < 1.0 { x } else { 1.0 }
        } else {
            0.0
        }
    };
    let over = |a: f32, b: f32| if b > f32::MIN_POSITIVE { a / b } else { 0.0 };
    let sine2 = dd * ee - de * de;
    let mut t = if sine2 > 1e-6 * dd * ee {
        clamp((de * ea - da * ee) / sine2)
    } else {
        0.0
    };
    let u = clamp(over(de * t + ea, ee));
    t = clamp(over(de * u - da, dd));
    [t, u]
}

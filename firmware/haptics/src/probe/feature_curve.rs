//! Curves of a shape in the frame of another: pieces of sharp edges, apexes of cones, and the points, circles and lines about which bulging faces lie.

use glam::{DMat3, DQuat, DVec3};
use mortise_protocol::image::{EdgeRecord, FaceRecord, Shape, surface_kind};

use crate::collision::exact_surface::edge_foot;
use crate::math::pose::Pose;
use crate::probe::face_distance::wide;

/// A curve p(t) for |t| ≤ 1: center + t·half + t²·bend, or an arc center + cos(t·angle)·half + sin(t·angle)·bend.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve {
    pub center: DVec3,
    pub half: DVec3,
    pub bend: DVec3,
    /// Half of the arc's angle, rad; zero for a quadratic.
    pub angle: f64,
    /// Distance from the curve to the surface that it stands for at t = 0, m, zero for an edge; and its derivative.
    pub radius: f64,
    pub taper: f64,
    /// Largest distance of the curve from the true one, m; infinite where it is not known.
    pub error: f64,
}

impl Curve {
    /// A point about which a ball of `radius` lies.
    pub fn point(center: DVec3, radius: f64) -> Self {
        Self {
            center,
            half: DVec3::ZERO,
            bend: DVec3::ZERO,
            angle: 0.0,
            radius,
            taper: 0.0,
            error: 0.0,
        }
    }

    pub fn at(&self, t: f64) -> DVec3 {
        if self.angle == 0.0 {
            self.center + (self.half + self.bend * t) * t
        } else {
            let (sin, cos) = libm::sincos(t * self.angle);
            self.center + self.half * cos + self.bend * sin
        }
    }

    /// First and second derivative.
    pub fn derivatives(&self, t: f64) -> (DVec3, DVec3) {
        if self.angle == 0.0 {
            return (self.half + self.bend * (2.0 * t), self.bend * 2.0);
        }
        let a = self.angle;
        let (sin, cos) = libm::sincos(t * a);
        let second = (self.half * cos + self.bend * sin) * (-a * a);
        ((self.bend * cos - self.half * sin) * a, second)
    }

    /// Largest first, second and third derivative.
    pub fn most(&self) -> [f64; 3] {
        if self.angle == 0.0 {
            let (half, bend) = (self.half.length(), self.bend.length());
            return [half + 2.0 * bend, 2.0 * bend, 0.0];
        }
        let first = self.half.length() * self.angle;
        [first, first * self.angle, first * self.angle * self.angle]
    }

    /// Largest speed along the direction `n`.
    pub fn speed_along(&self, n: DVec3) -> f64 {
        let (half, bend) = (self.half.dot(n), self.bend.dot(n));
        if self.angle == 0.0 {
            half.abs() + 2.0 * bend.abs()
        } else {
            libm::hypot(half, bend) * self.angle
        }
    }

    /// Largest distance from the chord of t ± h.
    pub fn bulge(&self, h: f64) -> f64 {
        0.5 * self.most()[1] * h * h
    }
}

/// One of the two shapes, seen from the other.
pub(crate) struct Side<'s, 'i> {
    pub shape: &'s Shape<'i>,
    /// Its frame to the other's.
    pub rotation: DMat3,
    pub offset: DVec3,
}

impl<'s, 'i> Side<'s, 'i> {
    /// The shapes of the held part, placed at `pose`, and of the other part, each in the other's frame.
    pub fn both(held: &'s Shape<'i>, other: &'s Shape<'i>, pose: &Pose) -> [Self; 2] {
        let orientation = DQuat::from_array(pose.orientation.to_array().map(f64::from)).normalize();
        let rotation = DMat3::from_quat(orientation);
        let offset = pose.position.as_dvec3();
        let back = rotation.transpose();
        [
            Self {
                shape: held,
                rotation,
                offset,
            },
            Self {
                shape: other,
                rotation: back,
                offset: -(back * offset),
            },
        ]
    }

    pub fn to_other(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.offset
    }

    pub fn bring_back(&self, p: DVec3) -> DVec3 {
        self.rotation.transpose() * (p - self.offset)
    }

    /// The curve in the other shape's frame.
    pub fn placed(&self, curve: &Curve) -> Curve {
        Curve {
            center: self.to_other(curve.center),
            half: self.rotation * curve.half,
            bend: self.rotation * curve.bend,
            ..*curve
        }
    }
}

/// Past its ends an arc is longer by this, m: the ends of pieces are rounded to single precision.
const PAST_END_M: f64 = 0.02e-6;
/// Sine below which directions count as parallel.
const PARALLEL: f64 = 1e-6;
/// Largest distance of an arc's ends from the piece that it replaces, m: the coarsest tolerance that the baker uses, doubled.
const ARC_OFF_M: f64 = 300e-6;

/// The exact curve of a piece of an edge in its shape's frame, in one or two parts.
pub(crate) fn exact_curve(shape: &Shape<'_>, edge: &EdgeRecord) -> heapless::Vec<Curve, 2> {
    let piece = Curve {
        center: wide(edge.center),
        half: wide(edge.half),
        bend: wide(edge.bend),
        angle: 0.0,
        radius: 0.0,
        taper: 0.0,
        error: if edge.is_straight() { 0.0 } else { f64::INFINITY },
    };
    let mut parts = heapless::Vec::new();
    let faces = edge.faces.map(|face| shape.faces.get(usize::from(face)));
    let ([Some(a), Some(b)], false) = (faces, edge.is_straight()) else {
        let _ = parts.push(piece);
        return parts;
    };
    if let Some(arc) = arc(a, b, &piece) {
        let _ = parts.push(arc);
        return parts;
    }
    for middle in [-0.5, 0.5] {
        let _ = parts.push(through_exact_points(a, b, &piece, middle));
    }
    parts
}

/// Radius of the circle in which a plane across the axis cuts a surface of revolution, m: `height` of the plane over the surface's origin along the
/// plane's normal, `along` its height along the axis. A torus is cut in two circles: the one on whose side `outer`, a distance from the axis, is. NaN
/// where the plane misses.
fn ring_radius(round: &FaceRecord, height: f64, along: f64, outer: f64) -> f64 {
    let (radius, second) = (f64::from(round.radius), f64::from(round.second));
    match round.kind {
        surface_kind::CYLINDER => radius,
        surface_kind::CONE => radius + along * libm::tan(second),
        surface_kind::SPHERE => libm::sqrt(radius * radius - height * height),
        _ => {
            let off = libm::sqrt(second * second - height * height);
            if outer < radius {
                radius - off
            } else {
                radius + off
            }
        }
    }
}

/// The arc in which a plane cuts a surface of revolution across its axis, over the piece.
fn arc(a: &FaceRecord, b: &FaceRecord, piece: &Curve) -> Option<Curve> {
    let (plane, round) = match (a.kind, b.kind) {
        (surface_kind::PLANE, _) => (a, b),
        (_, surface_kind::PLANE) => (b, a),
        _ => return None,
    };
    let normal = wide(plane.axis).normalize();
    let axis = match round.kind {
        surface_kind::SPHERE => normal,
        surface_kind::CYLINDER | surface_kind::CONE | surface_kind::TORUS => wide(round.axis).normalize(),
        _ => return None,
    };
    if axis.cross(normal).length() > PARALLEL {
        return None;
    }
    let origin = wide(round.origin);
    let height = (wide(plane.origin) - origin).dot(normal);
    let center = origin + normal * height;
    let outer = (piece.center - center).length();
    let ring = ring_radius(round, height, height * axis.dot(normal), outer);
    let flat = |p: DVec3| {
        let from = p - center;
        from - normal * from.dot(normal)
    };
    let ends = [-1.0, 0.0, 1.0].map(|t| piece.at(t));
    // False for NaN too: the plane misses the sphere or torus.
    let near = |p: DVec3| {
        (flat(p).length() - ring).abs() <= ARC_OFF_M && (p - center).dot(normal).abs() <= ARC_OFF_M
    };
    if !ends.into_iter().all(near) {
        return None;
    }
    let [x, middle, y] = ends.map(|p| flat(p).normalize());
    let sideways = middle.cross(y).dot(normal);
    let turn = if sideways < 0.0 { -normal } else { normal };
    let half_angle = |p: DVec3| libm::atan2(middle.cross(p).length(), middle.dot(p));
    let angle = half_angle(x).max(half_angle(y)) + PAST_END_M / ring;
    Some(Curve {
        center,
        half: middle * ring,
        bend: turn.cross(middle) * ring,
        angle,
        radius: 0.0,
        taper: 0.0,
        error: 0.0,
    })
}

/// Places at which a quadratic that meets a smooth curve at its middle and ends is farthest off.
const FARTHEST_OFF: f64 = 0.577;
/// Factor by which an error measured there is enlarged, and the least error, m: single precision.
const OFF_FACTOR: f64 = 1.5;
const LEAST_OFF_M: f64 = 0.02e-6;

/// A quadratic through exact points of the edge about `middle` of a piece, half as long, with its error measured.
fn through_exact_points(a: &FaceRecord, b: &FaceRecord, piece: &Curve, middle: f64) -> Curve {
    let exact = |p: DVec3| edge_foot(a, b, p.as_vec3()).map(|q| q.as_dvec3());
    let points = [middle - 0.5, middle, middle + 0.5].map(|t| exact(piece.at(t)));
    let [Some(x), Some(center), Some(y)] = points else {
        return Curve {
            center: piece.at(middle),
            half: piece.derivatives(middle).0 * 0.5,
            bend: piece.bend * 0.25,
            ..*piece
        };
    };
    let mut part = Curve {
        center,
        half: (y - x) * 0.5,
        bend: (x + y) * 0.5 - center,
        ..*piece
    };
    let off = |t: f64| {
        let p = part.at(t);
        exact(p).map_or(f64::INFINITY, |q| (q - p).length())
    };
    part.error = OFF_FACTOR * off(-FARTHEST_OFF).max(off(FARTHEST_OFF)) + LEAST_OFF_M;
    part
}

/// Apex of a cone, in its shape's frame, m.
pub(crate) fn apex(cone: &FaceRecord) -> DVec3 {
    wide(cone.origin) - wide(cone.axis) * (f64::from(cone.radius) / libm::tan(f64::from(cone.second)))
}

/// Whether a face is curved and bulges outward everywhere but along its generators.
pub(crate) fn bulges(face: &FaceRecord) -> bool {
    face.kind != surface_kind::PLANE && face.kind != surface_kind::OTHER && face.sense > 0.0
}

/// The point, circle or line about which a bulging face of a shape lies, in its frame; `None` for other faces.
pub(crate) fn spine(shape: &Shape<'_>, face: &FaceRecord) -> Option<Curve> {
    if !bulges(face) {
        return None;
    }
    let (origin, axis) = (wide(face.origin), wide(face.axis));
    let (radius, second) = (f64::from(face.radius), f64::from(face.second));
    match face.kind {
        surface_kind::SPHERE => Some(Curve::point(origin, radius)),
        surface_kind::TORUS => {
            let x = axis.any_orthonormal_vector();
            Some(Curve {
                half: x * radius,
                bend: axis.cross(x) * radius,
                angle: core::f64::consts::PI,
                ..Curve::point(origin, second)
            })
        }
        surface_kind::CYLINDER | surface_kind::CONE => {
            let along = (wide(shape.record.center) - origin).dot(axis);
            let reach = f64::from(shape.record.radius);
            let (sin, cos) = if face.kind == surface_kind::CONE {
                libm::sincos(second)
            } else {
                (0.0, 1.0)
            };
            Some(Curve {
                half: axis * reach,
                taper: reach * sin,
                ..Curve::point(origin + axis * along, radius * cos + along * sin)
            })
        }
        _ => None,
    }
}

/// Where two segments are nearest to each other, as shares of their lengths (Ericson, "Real-Time Collision Detection", 5.1.9).
pub(crate) fn nearest_of_segments([p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> [f64; 2] {
    let (d, e, apart) = (q - p, s - r, p - r);
    let (dd, ee, de) = (d.length_squared(), e.length_squared(), d.dot(e));
    let (da, ea) = (d.dot(apart), e.dot(apart));
    let share = |a: f64, b: f64| {
        if b > f64::MIN_POSITIVE {
            (a / b).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let sine2 = dd * ee - de * de;
    let mut t = if sine2 > 1e-14 * dd * ee {
        share(de * ea - da * ee, sine2)
    } else {
        0.0
    };
    let u = share(de * t + ea, ee);
    t = share(de * u - da, dd);
    // The foot of the clamped end may lie inside the other segment.
    let u = share(de * t + ea, ee);
    [t, u]
}

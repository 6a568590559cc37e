//! Support mapping of a convex shape: its point farthest in a direction.
//!
//! The faces of a shape that the baker marks as convex are planes, cylinders and cones that meet in sharp edges, or one sphere. The former are
//! farthest at an edge, the latter is a point with a radius. A piece of an edge is within half a micrometre of the edge; its farthest point is moved
//! onto the edge's exact surfaces. Double precision: for measurement only. Cost: three dot products per piece of an edge.

use glam::{DMat3, DQuat, DVec3, Vec3};
use mortise_protocol::image::{EdgeRecord, FaceRecord, SHAPE_CONVEX, Shape, surface_kind};

use crate::collision::exact_surface::edge_foot;
use crate::math::pose::Pose;

/// Largest distance of a piece of an edge from the edge, m.
const PIECE_M: f64 = 0.5e-6;
/// Share of the positions' size that single precision rounds off: poses and records have 2⁻²⁴, summed a few times.
const ROUNDING: f64 = 3e-7;

/// A placed convex shape.
pub(crate) struct Support<'i> {
    edges: &'i [EdgeRecord],
    faces: &'i [FaceRecord],
    rotation: DMat3,
    offset: DVec3,
    /// Centre of the sphere, shape frame, m.
    ball: Option<DVec3>,
    /// Distance of the surface from the points that [`Self::farthest`] returns, m.
    pub radius: f64,
    /// Error bound of those points, m.
    pub error: f64,
}

impl<'i> Support<'i> {
    /// `shape` placed at `pose`, if it is marked as convex.
    pub fn new(shape: &Shape<'i>, pose: &Pose) -> Option<Self> {
        if shape.record.flags & SHAPE_CONVEX == 0 {
            return None;
        }
        let ball = shape.faces.first().filter(|f| f.kind == surface_kind::SPHERE);
        let rotation =
            DMat3::from_quat(DQuat::from_array(pose.orientation.to_array().map(f64::from)).normalize());
        let bent = shape.edges.iter().any(|edge| !edge.is_straight());
        let size = pose.position.as_dvec3().length()
            + Vec3::from_array(shape.record.center).as_dvec3().length()
            + f64::from(shape.record.radius);
        Some(Self {
            edges: shape.edges,
            faces: shape.faces,
            rotation,
            offset: pose.position.as_dvec3(),
            ball: ball.map(|f| Vec3::from_array(f.origin).as_dvec3()),
            radius: ball.map_or(0.0, |f| f64::from(f.radius)),
            error: ROUNDING * size + if bent { 0.1 * PIECE_M } else { 0.0 },
        })
    }

    /// The point farthest along `n`.
    pub fn farthest(&self, n: DVec3) -> DVec3 {
        let point = match self.ball {
            Some(center) => center,
            None => self.farthest_of_edges(self.rotation.transpose() * n),
        };
        self.rotation * point + self.offset
    }

    /// The same in the shape's frame.
    fn farthest_of_edges(&self, n: DVec3) -> DVec3 {
        let (mut best, mut most) = (None, f64::NEG_INFINITY);
        for edge in self.edges {
            let [center, half, bend] =
                [edge.center, edge.half, edge.bend].map(|v| Vec3::from_array(v).as_dvec3().dot(n));
            let (t, value) = if bend < 0.0 && half.abs() < -2.0 * bend {
                (-half / (2.0 * bend), center - half * half / (4.0 * bend))
            } else {
                (1f64.copysign(half), center + half.abs() + bend)
            };
            if value > most {
                (best, most) = (Some((edge, t)), value);
            }
        }
        let Some((edge, t)) = best else {
            return DVec3::ZERO;
        };
        let [center, half, bend] =
            [edge.center, edge.half, edge.bend].map(|v| Vec3::from_array(v).as_dvec3());
        let point = center + (half + bend * t) * t;
        if edge.is_straight() {
            return point;
        }
        let [a, b] = edge.faces.map(|face| self.faces.get(usize::from(face)));
        let exact = a.zip(b).and_then(|(a, b)| edge_foot(a, b, point.as_vec3()));
        exact.map_or(point, |exact| exact.as_dvec3())
    }
}

/// A point of the difference of two shapes, and the point of the first that it comes from, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Vertex {
    pub w: DVec3,
    pub a: DVec3,
}

/// The point of `a` − `b` farthest along `n`.
pub(crate) fn farthest(a: &Support<'_>, b: &Support<'_>, n: DVec3) -> Vertex {
    let point = a.farthest(n);
    Vertex {
        w: point - b.farthest(-n),
        a: point,
    }
}

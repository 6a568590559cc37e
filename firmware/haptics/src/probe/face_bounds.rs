//! Bounds of a face's distance along a curve, and of how its foot moves.

use glam::Vec3;
use mortise_protocol::image::{FaceRecord, surface_kind};

use crate::math::vector::length;

/// Second derivative of the distance from a face's surface at `p` along a line of velocity `v`, m; and a bound of the distance's curvature within
/// `reach` of `p`, 1/m: of its second derivative, and the root of half of that of its third. `n` is the normal.
pub(crate) fn bending(face: &FaceRecord, p: Vec3, n: Vec3, v: Vec3, reach: f32) -> (f32, f32) {
    let from = p - Vec3::from_array(face.origin);
    let axis = Vec3::from_array(face.axis);
    let radial = from - axis * from.dot(axis);
    let ring = length(radial);
    let around = |v: Vec3| axis.cross(radial).dot(v) / ring;
    let (bending, off) = match face.kind {
        surface_kind::PLANE => return (0.0, 0.0),
        surface_kind::SPHERE => {
            let across = v - n * v.dot(n);
            (across.length_squared() / length(from), length(from))
        }
        surface_kind::CYLINDER => (around(v) * around(v) / ring, ring),
        surface_kind::CONE => (around(v) * around(v) * libm::cosf(face.second) / ring, ring),
        _ => {
            let tube = libm::hypotf(ring - face.radius, from.dot(axis));
            let along = around(v);
            let outward = n.dot(radial) / ring * face.sense;
            let across = v.length_squared() - v.dot(n) * v.dot(n) - along * along;
            let bending = along * along * outward / ring + across / tube;
            (bending, if ring < tube { ring } else { tube })
        }
    };
    let curl = if off > 1.001 * reach {
        1.0 / (off - reach)
    } else {
        f32::MAX
    };
    (bending * face.sense, curl)
}

/// Distance of a face's surface from the points at which its foot is not unique, m.
pub(crate) fn radius_at_axis(face: &FaceRecord) -> f32 {
    let inner = face.radius - face.second;
    match face.kind {
        surface_kind::CYLINDER | surface_kind::SPHERE => face.radius,
        surface_kind::TORUS if inner < face.second => inner,
        surface_kind::TORUS => face.second,
        _ => 0.0,
    }
}

/// How much faster than a point its foot moves on a face, at most, for points within `reach` of one at distance `d`.
pub(crate) fn foot_speed(face: &FaceRecord, d: f32, reach: f32) -> f32 {
    let radius = match face.kind {
        surface_kind::PLANE => return 1.0,
        surface_kind::TORUS => face.second,
        surface_kind::CONE => return 4.0,
        _ => face.radius,
    };
    let off = radius + d * face.sense - reach;
    let ratio = if off > 0.0 { radius / off } else { f32::MAX };
    if ratio > 1.0 { ratio } else { 1.0 }
}

/// Way of the own foot relative to its curve, m: the radius times the turn of the normal.
pub(crate) fn turn_of_foot(face: &FaceRecord, d: f32, reach: f32, radius: f32) -> f32 {
    if face.kind == surface_kind::PLANE || radius == 0.0 {
        return 0.0;
    }
    let off = face.radius.min(if face.kind == surface_kind::TORUS {
        face.second
    } else {
        f32::MAX
    }) + d * face.sense
        - reach;
    if off > 0.0 {
        radius * reach / off
    } else {
        f32::INFINITY
    }
}

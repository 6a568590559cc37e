//! Projection onto the analytic surfaces under B-rep faces, in closed form.
//!
//! All lengths mm, all vectors in the shape's frame. A projection returns the nearest point of the *untrimmed* surface: each of the five
//! surfaces has one local minimum of the distance, so when it lies outside a face's trim the nearest point of that face is on its boundary.

use std::f64::consts::TAU;

use glam::DVec3;
use mortise_brep::{Frame, Surface};

/// Nearest point of an untrimmed surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projection {
    /// Position, mm.
    pub point: DVec3,
    /// The surface's natural unit normal there.
    pub normal: DVec3,
}

/// Coordinates of `p` in `frame`.
pub(crate) fn to_local(frame: &Frame, p: DVec3) -> DVec3 {
    let d = p - frame.origin;
    DVec3::new(d.dot(frame.x), d.dot(frame.y), d.dot(frame.z))
}

/// The vector with coordinates `v` in `frame`.
pub(crate) fn from_local(frame: &Frame, v: DVec3) -> DVec3 {
    frame.x * v.x + frame.y * v.y + frame.z * v.z
}

/// Nearest point of `surface` to `p`; `None` for a spline. Where all directions are equal (on an axis, at a centre) the one towards `hint`
/// is taken.
pub(crate) fn project(surface: &Surface, p: DVec3, hint: DVec3) -> Option<Projection> {
    match *surface {
        Surface::Plane { frame } => Some(Projection {
            point: p - frame.z * (p - frame.origin).dot(frame.z),
            normal: frame.z,
        }),
        Surface::Cylinder { frame, radius } => {
            let (radial, _, z) = radial(&frame, p, hint);
            Some(Projection {
                point: frame.origin + radial * radius + frame.z * z,
                normal: radial,
            })
        }
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } => {
            let (radial, rho, z) = radial(&frame, p, hint);
            let (sin, cos) = half_angle.sin_cos();
            let distance = (rho - radius) * cos - z * sin;
            let foot_rho = rho - distance * cos;
            if foot_rho < 0.0 {
                // Nearest to the tip; the mean of the natural normals around it points along ∓z.
                return Some(Projection {
                    point: frame.origin - frame.z * (radius * cos / sin),
                    normal: -frame.z * sin.signum(),
                });
            }
            Some(Projection {
                point: frame.origin + radial * foot_rho + frame.z * (z + distance * sin),
                normal: radial * cos - frame.z * sin,
            })
        }
        Surface::Sphere { frame, radius } => {
            let normal = direction(p - frame.origin, hint - frame.origin, radius, frame.z);
            Some(Projection {
                point: frame.origin + normal * radius,
                normal,
            })
        }
        Surface::Torus { frame, major, minor } => {
            let (radial, _, _) = radial(&frame, p, hint);
            let center = frame.origin + radial * major;
            let normal = direction(p - center, hint - center, minor, radial);
            Some(Projection {
                point: center + normal * minor,
                normal,
            })
        }
        Surface::Spline => None,
    }
}

/// Natural unit normal at a point on (or near) `surface`; `None` for a spline.
pub(crate) fn natural_normal(surface: &Surface, q: DVec3) -> Option<DVec3> {
    project(surface, q, q).map(|p| p.normal)
}

/// Unit radial direction, distance from the axis, height along it.
fn radial(frame: &Frame, p: DVec3, hint: DVec3) -> (DVec3, f64, f64) {
    let local = to_local(frame, p);
    let rho = local.x.hypot(local.y);
    let scale = local.z.abs().max(1.0);
    if rho > 1e-12 * scale {
        return (
            from_local(frame, DVec3::new(local.x / rho, local.y / rho, 0.0)),
            rho,
            local.z,
        );
    }
    let toward = to_local(frame, hint);
    let length = toward.x.hypot(toward.y);
    let radial = if length > 0.0 {
        from_local(frame, DVec3::new(toward.x / length, toward.y / length, 0.0))
    } else {
        frame.x
    };
    (radial, rho, local.z)
}

fn direction(v: DVec3, hint: DVec3, scale: f64, fallback: DVec3) -> DVec3 {
    if v.length() > 1e-12 * scale.abs().max(1.0) {
        return v.normalize();
    }
    hint.try_normalize().unwrap_or(fallback)
}

/// Parameters of a point on `surface`: (x, y) of a plane; angle about z and height along z (cylinder, cone), latitude (sphere) or tube
/// angle (torus). Angles in radians, −π..π. `None` for a spline.
pub(crate) fn parameters(surface: &Surface, q: DVec3) -> Option<[f64; 2]> {
    Some(match *surface {
        Surface::Plane { frame } => {
            let l = to_local(&frame, q);
            [l.x, l.y]
        }
        Surface::Cylinder { frame, .. } | Surface::Cone { frame, .. } => {
            let l = to_local(&frame, q);
            [l.y.atan2(l.x), l.z]
        }
        Surface::Sphere { frame, .. } => {
            let l = to_local(&frame, q);
            [l.y.atan2(l.x), l.z.atan2(l.x.hypot(l.y))]
        }
        Surface::Torus { frame, major, .. } => {
            let l = to_local(&frame, q);
            [l.y.atan2(l.x), l.z.atan2(l.x.hypot(l.y) - major)]
        }
        Surface::Spline => return None,
    })
}

/// The point with these parameters (see [`parameters`]); `None` for a spline.
pub(crate) fn at_parameters(surface: &Surface, [u, v]: [f64; 2]) -> Option<DVec3> {
    let (frame, local) = match *surface {
        Surface::Plane { frame } => (frame, DVec3::new(u, v, 0.0)),
        Surface::Cylinder { frame, radius } => (frame, DVec3::new(radius * u.cos(), radius * u.sin(), v)),
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } => {
            let r = radius + v * half_angle.tan();
            (frame, DVec3::new(r * u.cos(), r * u.sin(), v))
        }
        Surface::Sphere { frame, radius } => (
            frame,
            DVec3::new(u.cos() * v.cos(), u.sin() * v.cos(), v.sin()) * radius,
        ),
        Surface::Torus { frame, major, minor } => {
            let r = major + minor * v.cos();
            (frame, DVec3::new(r * u.cos(), r * u.sin(), minor * v.sin()))
        }
        Surface::Spline => return None,
    };
    Some(frame.origin + from_local(&frame, local))
}

/// Principal curvatures along the first and the second parameter at the second parameter `v` (see [`parameters`]), 1/mm, positive where the
/// surface bends away from its natural normal; 0 for a spline.
pub(crate) fn principal_curvatures(surface: &Surface, v: f64) -> [f64; 2] {
    match *surface {
        Surface::Plane { .. } | Surface::Spline => [0.0; 2],
        Surface::Cylinder { radius, .. } => [1.0 / radius, 0.0],
        Surface::Cone {
            radius, half_angle, ..
        } => {
            let r = (radius + v * half_angle.tan()).abs().max(1e-9);
            [half_angle.cos() / r, 0.0]
        }
        Surface::Sphere { radius, .. } => [1.0 / radius; 2],
        Surface::Torus { major, minor, .. } => {
            let r = (major + minor * v.cos()).abs().max(1e-9);
            [v.cos() / r, 1.0 / minor]
        }
    }
}

/// Smallest interval of angles that holds all of `angles` (radians): start and span, the span 2π when they leave no gap wider than `gap`.
pub(crate) fn angle_range(angles: &mut [f64], gap: f64) -> (f64, f64) {
    angles.sort_by(f64::total_cmp);
    let (Some(&first), Some(&last)) = (angles.first(), angles.last()) else {
        return (0.0, TAU);
    };
    let mut widest = first + TAU - last;
    let mut start = first;
    for pair in angles.windows(2) {
        if pair[1] - pair[0] > widest {
            widest = pair[1] - pair[0];
            start = pair[1];
        }
    }
    if widest <= gap {
        (start, TAU)
    } else {
        (start, TAU - widest)
    }
}

/// Signed distance to an unbounded surface, mm, outside of its natural normal positive; NaN where it has no closed form.
pub(crate) fn signed_distance(surface: &Surface, p: DVec3) -> f64 {
    match *surface {
        Surface::Plane { frame } => to_local(&frame, p).z,
        Surface::Cylinder { frame, radius } => to_local(&frame, p).truncate().length() - radius,
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } => {
            let q = to_local(&frame, p);
            (q.truncate().length() - radius) * half_angle.cos() - q.z * half_angle.sin()
        }
        Surface::Sphere { frame, radius } => p.distance(frame.origin) - radius,
        Surface::Torus { frame, major, minor } => {
            let q = to_local(&frame, p);
            (q.truncate().length() - major).hypot(q.z) - minor
        }
        Surface::Spline => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frame() -> Frame {
        let z = DVec3::new(0.3, -0.5, 0.8).normalize();
        let x = z.any_orthonormal_vector();
        Frame {
            origin: DVec3::new(3.0, -2.0, 5.0),
            x,
            y: z.cross(x),
            z,
        }
    }

    fn surfaces() -> [Surface; 5] {
        let frame = frame();
        [
            Surface::Plane { frame },
            Surface::Cylinder { frame, radius: 4.0 },
            Surface::Cone {
                frame,
                radius: 3.0,
                half_angle: 0.4,
            },
            Surface::Sphere { frame, radius: 6.0 },
            Surface::Torus {
                frame,
                major: 7.0,
                minor: 2.0,
            },
        ]
    }

    proptest! {
        /// The projection is at least as near as every sampled point of the surface, and the offset is along the normal.
        #[test]
        fn projection_is_the_nearest_point(
            p in prop::array::uniform3(-15.0f64..15.0),
            u in prop::collection::vec((-3.1f64..3.1, -1.5f64..1.5), 64),
        ) {
            let p = DVec3::from_array(p);
            for surface in surfaces() {
                let q = project(&surface, p, p).unwrap();
                let d = p.distance(q.point);
                for &(u, v) in &u {
                    let v = match surface { Surface::Cone { .. } => v * 4.0, Surface::Plane { .. } | Surface::Cylinder { .. } => v * 10.0, _ => v };
                    let u = if matches!(surface, Surface::Plane { .. }) { u * 5.0 } else { u };
                    let s = at_parameters(&surface, [u, v]).unwrap();
                    prop_assert!(d <= p.distance(s) + 1e-9, "{surface:?}");
                }
                prop_assert!((q.normal.length() - 1.0).abs() < 1e-12);
                if let Some(offset) = (p - q.point).try_normalize() && d > 1e-6 && !matches!(surface, Surface::Cone { .. }) {
                    prop_assert!(offset.dot(q.normal).abs() > 1.0 - 1e-9);
                }
            }
        }

        /// `at_parameters` inverts `parameters`.
        #[test]
        fn parameters_round_trip(u in -3.1f64..3.1, v in -1.5f64..1.5) {
            for surface in surfaces() {
                let q = at_parameters(&surface, [u, v]).unwrap();
                let back = at_parameters(&surface, parameters(&surface, q).unwrap()).unwrap();
                prop_assert!(q.distance(back) < 1e-9);
            }
        }
    }

    #[test]
    fn angle_range_finds_the_gap() {
        let mut quarter = [3.0, -3.0, 3.1, -2.8];
        let (start, span) = angle_range(&mut quarter, 1.0);
        assert!((start - 3.0).abs() < 1e-12 && (span - (TAU - 5.8)).abs() < 1e-12);
        let mut full: Vec<f64> = (0..20).map(|i| -3.0 + 0.3 * f64::from(i)).collect();
        assert_eq!(angle_range(&mut full, 1.0).1, TAU);
    }
}

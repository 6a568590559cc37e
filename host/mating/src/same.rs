//! Difference between two surfaces.

use glam::{DAffine3, DVec3};
use mortise_brep::{Frame, Surface};

/// Region in which two surfaces are compared: a ball, mm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    pub center: DVec3,
    pub radius: f64,
}

/// Difference between two surfaces of the same kind.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Difference {
    /// Bound on their distance within the ball, mm.
    pub linear: f64,
    /// Angle between their axes or normals, and between half angles, radians.
    pub angular: f64,
}

/// Bound on the difference of two surfaces of one kind within `ball`, regardless of their orientation. `None` for different
/// kinds, and for tori and splines.
pub(crate) fn difference(a: &Surface, b: &Surface, ball: Ball) -> Option<Difference> {
    let (linear, angular) = match (*a, *b) {
        (Surface::Plane { frame: f }, Surface::Plane { frame: g }) => {
            let angle = angle_between(f.z, g.z);
            let heights =
                (ball.center - f.origin).dot(f.z) * f.z.dot(g.z).signum() - (ball.center - g.origin).dot(g.z);
            (heights.abs() + angle * ball.radius, angle)
        }
        (Surface::Cylinder { frame: f, radius: r }, Surface::Cylinder { frame: g, radius: s }) => {
            let (offset, angle) = axes(&f, &g, ball);
            ((r - s).abs() + offset + angle * ball.radius, angle)
        }
        (
            Surface::Cone {
                frame: f,
                radius: r,
                half_angle: x,
            },
            Surface::Cone {
                frame: g,
                radius: s,
                half_angle: y,
            },
        ) => {
            let (offset, angle) = axes(&f, &g, ball);
            let y = y * f.z.dot(g.z).signum();
            let at = |frame: &Frame, radius: f64, half_angle: f64| {
                radius + (ball.center - frame.origin).dot(frame.z) * half_angle.tan()
            };
            let along = at(&f, r, x) - at(&g, s, y * f.z.dot(g.z).signum());
            let widening = (x.tan() - y.tan()).abs() * ball.radius;
            (
                along.abs() + offset + widening + angle * ball.radius,
                angle.max((x - y).abs()),
            )
        }
        (Surface::Sphere { frame: f, radius: r }, Surface::Sphere { frame: g, radius: s }) => {
            (f.origin.distance(g.origin) + (r - s).abs(), 0.0)
        }
        _ => return None,
    };
    Some(Difference { linear, angular })
}

/// Distance of two axes near the ball's centre, and the angle between them.
fn axes(f: &Frame, g: &Frame, ball: Ball) -> (f64, f64) {
    let foot = |frame: &Frame| frame.origin + frame.z * (ball.center - frame.origin).dot(frame.z);
    (foot(f).distance(foot(g)), angle_between(f.z, g.z))
}

/// Angle between two lines, 0 to π/2. Unlike the arc cosine it is accurate for small angles.
fn angle_between(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b).abs())
}

/// A rigidly moved surface.
pub(crate) fn moved(surface: &Surface, by: &DAffine3) -> Surface {
    let turn = |f: Frame| Frame {
        origin: by.transform_point3(f.origin),
        x: by.transform_vector3(f.x),
        y: by.transform_vector3(f.y),
        z: by.transform_vector3(f.z),
    };
    let mut surface = *surface;
    match &mut surface {
        Surface::Plane { frame }
        | Surface::Cylinder { frame, .. }
        | Surface::Cone { frame, .. }
        | Surface::Sphere { frame, .. }
        | Surface::Torus { frame, .. } => *frame = turn(*frame),
        Surface::Spline => {}
    }
    surface
}

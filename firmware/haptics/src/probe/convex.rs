//! Gap or separating translation of two convex shapes, with proven bounds.

use glam::{DVec3, Vec3};
use mortise_protocol::image::{NO_FACE, Shape};

use crate::collision::exact_surface::on_surface_of;
use crate::math::pose::Pose;
use crate::probe::epa::Epa;
use crate::probe::gjk::{Gjk, gjk};
use crate::probe::nearest::{Measure, Nearest};
use crate::probe::support::Support;

/// Error below which a distance counts as exact, m.
const EXACT_M: f64 = 1e-6;
/// Distance from a face within which a nearest point lies on it, m.
const ON_FACE_M: f32 = 2e-6;
/// Distance of two shapes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Separation {
    /// Signed distance, m: a gap, or less the smallest translation that separates.
    pub distance: f64,
    /// Error bound, m.
    pub error: f64,
    /// Unit direction from the second shape to the first, along which they part.
    pub normal: DVec3,
    /// Nearest or deepest point of the first shape, m.
    pub a: DVec3,
    /// What a negative distance is.
    pub measure: Measure,
}

/// Separation of `a` from `b`.
pub(crate) fn separation(a: &Support<'_>, b: &Support<'_>, epa: &mut Epa) -> Separation {
    let radius = a.radius + b.radius;
    let fixed = a.error + b.error;
    match gjk(a, b) {
        Gjk::Apart { a: point, v, lower } => {
            let length = v.length();
            let normal = v / length;
            let lower = lower.clamp(0.0, length);
            Separation {
                distance: 0.5 * (length + lower) - radius,
                error: 0.5 * (length - lower) + fixed,
                normal,
                a: point - normal * a.radius,
                measure: Measure::Translation,
            }
        }
        Gjk::Together(simplex) => {
            let depth = epa.depth(a, b, &simplex);
            let lower = depth.lower.min(depth.upper);
            Separation {
                distance: -0.5 * (depth.upper + lower) - radius,
                error: 0.5 * (depth.upper - lower) + fixed,
                normal: depth.out,
                a: depth.a - depth.out * a.radius,
                measure: Measure::Translation,
            }
        }
    }
}

impl Separation {
    /// The same as a result of the probe: `center` is the held part's centre of mass, `shapes` the held part and the other one with their placements.
    pub fn nearest(&self, by_field: &Nearest, shapes: [(&Shape<'_>, &Pose); 2], center: Vec3) -> Nearest {
        let b = self.a - self.normal * self.distance;
        let [held, other] = shapes;
        Nearest {
            distance_m: self.distance as f32,
            field_distance_m: by_field.field_distance_m,
            error_m: self.error as f32,
            exact: self.error <= EXACT_M,
            measure: self.measure,
            in_band: true,
            arm: (self.a - center.as_dvec3()).as_vec3(),
            moving_face: face_at(held, self.a, -self.normal),
            fixed_face: face_at(other, b, self.normal),
        }
    }
}

/// The face of a shape through the point `p` whose normal is nearest to `out`, or [`NO_FACE`].
fn face_at((shape, pose): (&Shape<'_>, &Pose), p: DVec3, out: DVec3) -> u16 {
    let back = pose.inverse();
    let p = back.transform_point(p.as_vec3());
    let out = back.transform_vector(out.as_vec3());
    let (mut found, mut most) = (NO_FACE, f32::NEG_INFINITY);
    for face in 0..shape.faces.len().min(usize::from(NO_FACE)) {
        if let Some(on) = on_surface_of(shape.surfaces(), face as u16, p)
            && on.distance.abs() <= ON_FACE_M
            && on.normal.dot(out) > most
        {
            (found, most) = (face as u16, on.normal.dot(out));
        }
    }
    found
}

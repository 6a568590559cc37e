//! Signed distance from a face's unbounded surface along a curve, with its derivatives and their bounds, in double precision.

use glam::{DVec3, Vec3};
use mortise_protocol::image::{FaceRecord, surface_kind};

/// A vector of a record.
pub(crate) fn wide(v: [f32; 3]) -> DVec3 {
    Vec3::from_array(v).as_dvec3()
}

/// Signed distance, outside positive, and its derivatives at a point.
#[derive(Clone, Copy)]
pub(crate) struct FaceDistance {
    /// m.
    pub distance: f64,
    /// Outward unit normal: the gradient.
    pub normal: DVec3,
    /// Unit directions of the two principal curvatures of the distance, and these curvatures, 1/m: the Hessian is Σ κ·e·eᵀ.
    bends: [(DVec3, f64); 2],
    /// Distance of the point from where the distance is not smooth, m.
    pub smooth: f64,
}

impl FaceDistance {
    /// At `p`; `None` for a face without closed form, or where the nearest point is not unique.
    pub fn at(face: &FaceRecord, p: DVec3) -> Option<Self> {
        let axis = wide(face.axis);
        let from = p - wide(face.origin);
        let sense = f64::from(face.sense);
        let (radius, second) = (f64::from(face.radius), f64::from(face.second));
        let flat = (DVec3::ZERO, 0.0);
        if face.kind == surface_kind::PLANE {
            return Some(Self {
                distance: from.dot(axis) * sense,
                normal: axis * sense,
                bends: [flat; 2],
                smooth: f64::INFINITY,
            });
        }
        if face.kind == surface_kind::SPHERE {
            let (r, out) = polar(from)?;
            let e = out.any_orthonormal_vector();
            let bend = sense / r;
            return Some(Self {
                distance: (r - radius) * sense,
                normal: out * sense,
                bends: [(e, bend), (out.cross(e), bend)],
                smooth: r,
            });
        }
        let along = from.dot(axis);
        let (ring, out) = polar(from - axis * along)?;
        let around = axis.cross(out);
        let (natural, normal, bends, smooth) = match face.kind {
            surface_kind::CYLINDER => (ring - radius, out, [(around, 1.0 / ring), flat], ring),
            surface_kind::CONE => {
                let (sin, cos) = libm::sincos(second);
                let natural = (ring - radius) * cos - along * sin;
                (
                    natural,
                    out * cos - axis * sin,
                    [(around, cos / ring), flat],
                    ring,
                )
            }
            surface_kind::TORUS => {
                let (tube, n) = polar(from - out * radius)?;
                let bends = [(around, n.dot(out) / ring), (around.cross(n), 1.0 / tube)];
                (tube - second, n, bends, if ring < tube { ring } else { tube })
            }
            _ => return None,
        };
        Some(Self {
            distance: natural * sense,
            normal: normal * sense,
            bends: bends.map(|(e, bend)| (e, bend * sense)),
            smooth,
        })
    }

    /// Second derivative along a line of velocity `v`.
    pub fn second_along(&self, v: DVec3) -> f64 {
        let [(e, k), (f, l)] = self.bends;
        let (a, b) = (e.dot(v), f.dot(v));
        k * a * a + l * b * b
    }

    /// Bound of the curvature of the distance within `reach` of the point, 1/m; infinite where it is not smooth there.
    pub fn bend_within(&self, reach: f64) -> f64 {
        if self.smooth > 1.001 * reach {
            1.0 / (self.smooth - reach)
        } else {
            f64::INFINITY
        }
    }
}

/// Signed distance alone, outside positive, m; `None` for a face without closed form.
pub(crate) fn face_distance(face: &FaceRecord, p: DVec3) -> Option<f64> {
    let axis = wide(face.axis);
    let from = p - wide(face.origin);
    let (radius, second) = (f64::from(face.radius), f64::from(face.second));
    let along = from.dot(axis);
    let ring = || (from - axis * along).length();
    let natural = match face.kind {
        surface_kind::PLANE => along,
        surface_kind::SPHERE => from.length() - radius,
        surface_kind::CYLINDER => ring() - radius,
        surface_kind::CONE => {
            let (sin, cos) = libm::sincos(second);
            (ring() - radius) * cos - along * sin
        }
        surface_kind::TORUS => libm::hypot(ring() - radius, along) - second,
        _ => return None,
    };
    Some(natural * f64::from(face.sense))
}

/// Bound of the third derivative of the distance along a line of unit speed, over the squared bound of its curvature: 2/√3 about an axis or a point,
/// and three times the change of each curvature, at most its square, where a torus' curvatures turn with the point.
pub(crate) const THIRD: f64 = 6.0;

/// Length and direction of `v`, unless it is zero.
fn polar(v: DVec3) -> Option<(f64, DVec3)> {
    let length = v.length();
    (length > 1e-9).then(|| (length, v / length))
}

#[cfg(test)]
mod tests {
    extern crate std;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// The derivatives are those of the distance, by differences.
        #[test]
        fn derivatives_are_those_of_the_distance(
            kind in prop::sample::select(std::vec![
                surface_kind::PLANE, surface_kind::CYLINDER, surface_kind::SPHERE, surface_kind::CONE,
                surface_kind::TORUS,
            ]),
            p in prop::array::uniform3(0.004f64..0.03),
            v in prop::array::uniform3(-1.0f64..1.0),
            sense in prop::sample::select(std::vec![-1.0f32, 1.0]),
        ) {
            let face = FaceRecord {
                kind,
                sense,
                origin: [0.001, -0.002, 0.0],
                axis: [0.0, 0.6, 0.8],
                radius: 0.01,
                second: if kind == surface_kind::CONE { 0.4 } else { 0.003 },
            };
            let (p, v) = (DVec3::from_array(p), DVec3::from_array(v));
            let here = FaceDistance::at(&face, p).expect("away from the axis");
            prop_assume!(here.smooth > 1e-3);
            let at = |t: f64| face_distance(&face, p + v * t).expect("a formula");
            prop_assert!((here.distance - at(0.0)).abs() < 1e-8);
            let step = 1e-5;
            let slope = (at(step) - at(-step)) / (2.0 * step);
            prop_assert!((here.normal.dot(v) - slope).abs() < 1e-4, "{slope}");
            let bend = (at(step) + at(-step) - 2.0 * at(0.0)) / (step * step);
            // Curvatures reach 1000 per metre; the axis is of unit length to single precision.
            prop_assert!((here.second_along(v) - bend).abs() < 0.5 + 1e-3 * bend.abs(), "{bend}");
        }
    }
}

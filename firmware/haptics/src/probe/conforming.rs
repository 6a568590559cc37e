//! Lower bounds for curves that conform to a surface, such as the rim of a peg in its bore.
//!
//! Along a line or an arc the squared distance from an axis or a centre is a polynomial or a trigonometric polynomial of second degree, whose third
//! derivative is small where the curve conforms. So few pieces of a rim are enough where bounds from the curvature of both need hundreds.

use glam::DVec3;
use mortise_protocol::image::{FaceRecord, surface_kind};

use crate::probe::face_distance::wide;
use crate::probe::feature_curve::Curve;

/// Bounds of a function over t ± h: to second order, plus and less a bound of the third.
fn range([value, first, second, third]: [f64; 4], h: f64) -> [f64; 2] {
    let (slope, curving) = (first.abs() * h, second * h * h);
    let off = third * h * h * h / 6.0;
    let extreme = |curving: f64| {
        if curving > slope {
            -0.5 * slope * slope / curving
        } else {
            0.5 * curving - slope
        }
    };
    [value + extreme(curving) - off, value - extreme(-curving) + off]
}

/// Lower bound of a face's distance, m, along the part t ± h of a line or an arc; −∞ for other curves and faces.
pub(crate) fn least_conforming(face: &FaceRecord, curve: &Curve, (t, h): (f64, f64)) -> f64 {
    if curve.angle == 0.0 && curve.bend != DVec3::ZERO {
        return f64::NEG_INFINITY;
    }
    let (origin, axis) = (wide(face.origin), wide(face.axis));
    let across = |v: DVec3| match face.kind {
        surface_kind::SPHERE => v,
        _ => v - axis * v.dot(axis),
    };
    let p = curve.at(t) - origin;
    let (first, second) = curve.derivatives(t);
    let (q, v, a) = (across(p), across(first), across(second));
    let (mut third, mut twist) = (0.0, 0.0);
    if curve.angle > 0.0 {
        let [c, x, y] = [curve.center - origin, curve.half, curve.bend].map(across);
        let once = libm::hypot(c.dot(x), c.dot(y));
        let twice = libm::hypot(0.5 * (x.length_squared() - y.length_squared()), x.dot(y));
        let cubed = curve.angle * curve.angle * curve.angle;
        third = (2.0 * once + 8.0 * twice) * cubed;
        twist = libm::hypot(curve.half.dot(axis), curve.bend.dot(axis)) * cubed;
    }
    let squared = [
        q.length_squared(),
        2.0 * q.dot(v),
        2.0 * (v.length_squared() + q.dot(a)),
        third,
    ];
    let [low, high] = range(squared, h).map(|x| libm::sqrt(x.max(0.0)));
    let [below, above] = range([p.dot(axis), first.dot(axis), second.dot(axis), twist], h);
    let (radius, second) = (f64::from(face.radius), f64::from(face.second));
    let outward = face.sense > 0.0;
    match face.kind {
        surface_kind::CYLINDER | surface_kind::SPHERE if outward => low - radius,
        surface_kind::CYLINDER | surface_kind::SPHERE => radius - high,
        surface_kind::CONE => {
            let (sin, cos) = libm::sincos(second);
            let most_along = (above * sin).max(below * sin);
            let least_along = (above * sin).min(below * sin);
            if outward {
                (low - radius) * cos - most_along
            } else {
                least_along - (high - radius) * cos
            }
        }
        surface_kind::TORUS => {
            let [inner, outer] = [low - radius, high - radius];
            let nearest = |a: f64, b: f64| if a > 0.0 { a } else { (-b).max(0.0) };
            let farthest = |a: f64, b: f64| a.abs().max(b.abs());
            if outward {
                libm::hypot(nearest(inner, outer), nearest(below, above)) - second
            } else {
                second - libm::hypot(farthest(inner, outer), farthest(below, above))
            }
        }
        _ => f64::NEG_INFINITY,
    }
}

/// Lower bound of the distance, m, of the part t ± h of a curve from the whole circle of an arc: that from a ring of no thickness; −∞ for other curves.
pub(crate) fn least_to_circle(circle: &Curve, curve: &Curve, part: (f64, f64)) -> f64 {
    if circle.angle == 0.0 {
        return f64::NEG_INFINITY;
    }
    let ring = FaceRecord {
        kind: surface_kind::TORUS,
        sense: 1.0,
        origin: circle.center.as_vec3().to_array(),
        axis: circle.half.cross(circle.bend).normalize().as_vec3().to_array(),
        radius: circle.half.length() as f32,
        second: 0.0,
    };
    least_conforming(&ring, curve, part)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use proptest::prelude::*;

    use super::*;
    use crate::probe::face_distance::face_distance;

    fn vector() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-0.02f64..0.02).prop_map(DVec3::from_array)
    }

    fn direction() -> impl Strategy<Value = DVec3> {
        (vector().prop_filter("long enough", |v| v.length() > 1e-3)).prop_map(DVec3::normalize)
    }

    prop_compose! {
        fn face()(
            kind in prop::sample::select(std::vec![
                surface_kind::CYLINDER, surface_kind::SPHERE, surface_kind::CONE, surface_kind::TORUS,
            ]),
            axis in direction(),
            origin in vector(),
            radius in 0.005f32..0.02,
            second in 0.1f32..0.9,
            outward in any::<bool>(),
        ) -> FaceRecord {
            FaceRecord {
                kind,
                sense: if outward { 1.0 } else { -1.0 },
                origin: origin.as_vec3().to_array(),
                axis: axis.as_vec3().to_array(),
                radius,
                second: if kind == surface_kind::TORUS { radius * second } else { second },
            }
        }
    }

    prop_compose! {
        fn arc()(center in vector(), n in direction(), radius in 0.001f64..0.02, angle in 0.0f64..3.0) -> Curve {
            let x = n.any_orthonormal_vector();
            Curve {
                half: x * radius,
                bend: if angle > 0.3 { n.cross(x) * radius } else { DVec3::ZERO },
                angle: if angle > 0.3 { angle } else { 0.0 },
                ..Curve::point(center, 0.0)
            }
        }
    }

    proptest! {
        /// No point of the part is nearer than the bound, and for a point the bound is its distance.
        #[test]
        fn is_a_lower_bound(face in face(), curve in arc(), t in -1.0f64..1.0, share in 0.0f64..1.0) {
            let h = share * (1.0 - t.abs());
            let bound = least_conforming(&face, &curve, (t, h));
            for i in 0..=40 {
                let p = curve.at(t + h * (f64::from(i) / 20.0 - 1.0));
                let distance = face_distance(&face, p).expect("a formula");
                prop_assert!(distance >= bound - 1e-9, "{distance} {bound}");
            }
            let at = least_conforming(&face, &curve, (t, 0.0));
            let distance = face_distance(&face, curve.at(t)).expect("a formula");
            // The records' axes are of unit length to single precision.
            prop_assert!((at - distance).abs() < 1e-8, "{at} {distance}");
        }

        /// No point of an arc's part is nearer to a circle than the bound, and for a point the bound is its distance.
        #[test]
        fn circles_have_a_lower_bound(
            circle in arc(), n in direction(), curve in arc(), t in -1.0f64..1.0, share in 0.0f64..1.0,
        ) {
            prop_assume!(circle.angle > 0.0);
            let to_circle = |p: DVec3| {
                let n = circle.half.cross(circle.bend).normalize();
                let from = p - circle.center;
                let height = from.dot(n);
                libm::hypot(height, (from - n * height).length() - circle.half.length())
            };
            let h = share * (1.0 - t.abs());
            let bound = least_to_circle(&circle, &curve, (t, h));
            for i in 0..=40 {
                let distance = to_circle(curve.at(t + h * (f64::from(i) / 20.0 - 1.0)));
                prop_assert!(distance >= bound - 1e-8, "{distance} {bound}");
            }
            let point = Curve::point(curve.center + n * 0.01, 0.0);
            let at = least_to_circle(&circle, &point, (0.0, 0.0));
            prop_assert!((at - to_circle(point.center)).abs() < 1e-8, "{at}");
        }
    }
}

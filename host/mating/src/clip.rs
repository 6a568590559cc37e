//! Clipping of convex polygons against each other.
//!
//! A vertex is a ray from the origin: (u, v, 1) in a plane, a unit vector on a sphere. A side then spans a plane through
//! the origin, and the same clipping (Sutherland & Hodgman 1974) works for straight sides in the plane and great circles on
//! the sphere. The common area of convex polygons is a continuous function of their corners, so coincident sides and
//! corners need no special treatment.

use glam::{DVec2, DVec3};

/// The part of convex `subject` inside convex `window`; both anticlockwise, seen from outside. `scratch` is overwritten.
pub(crate) fn clip(subject: &[DVec3], window: &[DVec3], out: &mut Vec<DVec3>, scratch: &mut Vec<DVec3>) {
    out.clear();
    out.extend_from_slice(subject);
    for (i, &a) in window.iter().enumerate() {
        let inward = a.cross(window[(i + 1) % window.len()]);
        std::mem::swap(out, scratch);
        out.clear();
        for (j, &p) in scratch.iter().enumerate() {
            let q = scratch[(j + 1) % scratch.len()];
            let (dp, dq) = (inward.dot(p), inward.dot(q));
            if dp >= 0.0 {
                out.push(p);
            }
            if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
                out.push(p + (q - p) * (dp / (dp - dq)));
            }
        }
        if out.len() < 3 {
            out.clear();
            return;
        }
    }
}

/// Area and centroid of a polygon with corners (u, v, 1); positive when anticlockwise.
pub(crate) fn area_and_centroid(polygon: &[DVec3]) -> (f64, DVec2) {
    let Some((first, rest)) = polygon.split_first() else {
        return (0.0, DVec2::ZERO);
    };
    let origin = first.truncate();
    let (mut area, mut moment) = (0.0, DVec2::ZERO);
    for pair in rest.windows(2) {
        let (a, b) = (pair[0].truncate() - origin, pair[1].truncate() - origin);
        let twice = a.perp_dot(b);
        area += twice / 2.0;
        moment += (a + b) * (twice / 6.0);
    }
    let offset = if area == 0.0 { DVec2::ZERO } else { moment / area };
    (area, origin + offset)
}

/// Solid angle of a spherical polygon, steradian (van Oosterom & Strackee 1983); corners need not be unit vectors.
pub(crate) fn solid_angle(polygon: &[DVec3]) -> f64 {
    let Some((first, rest)) = polygon.split_first() else {
        return 0.0;
    };
    let a = first.normalize_or_zero();
    let mut sum = 0.0;
    for pair in rest.windows(2) {
        let (b, c) = (pair[0].normalize_or_zero(), pair[1].normalize_or_zero());
        sum += 2.0 * a.dot(b.cross(c)).atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn square(low: f64, high: f64) -> Vec<DVec3> {
        [(low, low), (high, low), (high, high), (low, high)]
            .map(|(u, v)| DVec3::new(u, v, 1.0))
            .to_vec()
    }

    fn common(a: &[DVec3], b: &[DVec3]) -> Vec<DVec3> {
        let (mut out, mut scratch) = (Vec::new(), Vec::new());
        clip(a, b, &mut out, &mut scratch);
        out
    }

    #[test]
    fn squares_share_what_arithmetic_says() {
        let share = |a: &[DVec3], b: &[DVec3]| area_and_centroid(&common(a, b)).0;
        let unit = square(0.0, 1.0);
        assert!((share(&unit, &square(0.5, 2.0)) - 0.25).abs() < 1e-15);
        assert!((share(&unit, &unit) - 1.0).abs() < 1e-15);
        assert_eq!(share(&unit, &square(1.0, 2.0)), 0.0);
        assert_eq!(share(&unit, &square(3.0, 4.0)), 0.0);
    }

    #[test]
    fn octants_are_an_eighth_of_a_sphere() {
        let octant = [DVec3::X, DVec3::Y, DVec3::Z];
        assert!((solid_angle(&octant) - PI / 2.0).abs() < 1e-14);
        // Rotated by an eighth turn about z, the octants share half.
        let (east, north) = (DVec3::new(1.0, 1.0, 0.0), DVec3::new(-1.0, 1.0, 0.0));
        let turned = [east, north, DVec3::Z];
        assert!((solid_angle(&common(&octant, &turned)) - PI / 4.0).abs() < 1e-14);
    }

    proptest! {
        /// The common area is independent of which polygon is the window, and the whole is the sum of its parts.
        #[test]
        fn clipping_is_symmetric_and_additive(
            t in prop::array::uniform6(-1.0f64..1.0),
            s in prop::array::uniform6(-1.0f64..1.0),
        ) {
            let triangle = |t: [f64; 6]| {
                let mut points = vec![DVec3::new(t[0], t[1], 1.0), DVec3::new(t[2], t[3], 1.0), DVec3::new(t[4], t[5], 1.0)];
                if area_and_centroid(&points).0 < 0.0 { points.reverse(); }
                points
            };
            let (a, b) = (triangle(t), triangle(s));
            let share = |a: &[DVec3], b: &[DVec3]| area_and_centroid(&common(a, b)).0;
            prop_assert!((share(&a, &b) - share(&b, &a)).abs() < 1e-12);
            let middle = (b[0] + b[1] + b[2]) / 3.0;
            let parts: f64 = (0..3).map(|i| share(&a, &[b[i], b[(i + 1) % 3], middle])).sum();
            prop_assert!((share(&a, &b) - parts).abs() < 1e-12);
        }
    }
}

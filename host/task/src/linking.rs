//! Closed curves, how often they are linked, and where a curve crosses a flat opening.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Corners of a circle as a polygon.
const CORNERS: usize = 96;
/// Deviation from a plane up to which a curve is flat, as a share of its size.
const FLAT: f64 = 1e-6;

/// A closed polygon inside the material of a part or on its surface.
#[derive(Clone, Debug)]
pub(crate) struct Loop {
    pub corners: Vec<DVec3>,
    /// Middle of the corners, and unit normal of its plane where it is flat.
    pub middle: DVec3,
    pub normal: Option<DVec3>,
    /// How far the polygon is from the curve that it stands for, at most, mm.
    pub deviation: f64,
    /// How far a point of the curve is from the material at most, mm.
    pub gap: f64,
    /// Upper bound of the distance of a point of the plane region within a flat curve from the curve, mm.
    pub inner_radius: f64,
}

impl Loop {
    /// A circle.
    pub fn circle(center: DVec3, normal: DVec3, radius: f64) -> Self {
        let x = normal.any_orthonormal_vector();
        let y = normal.cross(x);
        let corner = |i: usize| {
            let (s, c) = (TAU * i as f64 / CORNERS as f64).sin_cos();
            center + (x * c + y * s) * radius
        };
        Self {
            corners: (0..CORNERS).map(corner).collect(),
            middle: center,
            normal: Some(normal),
            deviation: radius * (1.0 - (PI / CORNERS as f64).cos()),
            gap: 0.0,
            inner_radius: radius,
        }
    }

    /// Points of a circle as near to each other as `step` mm.
    pub fn fine(&self, step: f64) -> Vec<DVec3> {
        let Some(normal) = self.normal else {
            return self.corners.clone();
        };
        let x = normal.any_orthonormal_vector();
        let y = normal.cross(x);
        let count = (TAU * self.inner_radius / step).ceil().clamp(8.0, 1e5) as usize;
        (0..count)
            .map(|i| {
                let (s, c) = (TAU * i as f64 / count as f64).sin_cos();
                self.middle + (x * c + y * s) * self.inner_radius
            })
            .collect()
    }

    /// A polygon, which stands for itself.
    pub fn polygon(corners: Vec<DVec3>) -> Self {
        let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
        let area: DVec3 = pairs(&corners).map(|(p, q)| (p - middle).cross(q - middle)).sum();
        let size = corners.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let normal = area
            .try_normalize()
            .filter(|n| corners.iter().all(|p| (*p - middle).dot(*n).abs() <= FLAT * size));
        Self {
            corners,
            middle,
            normal,
            deviation: 0.0,
            gap: 0.0,
            // The farthest corner from the middle is a bound: a region of this plane lies within that circle, whose every point is nearer to its rim.
            inner_radius: size,
        }
    }

    /// Signed number of times that the segment crosses the region that the curve encloses: its plane region where it is flat, else a fan about its middle.
    pub fn crossings(&self, p: DVec3, q: DVec3) -> i32 {
        if let Some(normal) = self.normal {
            let (a, b) = ((p - self.middle).dot(normal), (q - self.middle).dot(normal));
            if (a >= 0.0) == (b >= 0.0) {
                return 0;
            }
            let at = p.lerp(q, a / (a - b));
            return self.winding(at, normal) * if b >= 0.0 { 1 } else { -1 };
        }
        pairs(&self.corners)
            .map(|(u, v)| crosses(p, q, [self.middle, u, v]))
            .sum()
    }

    /// How often a flat curve runs around a point of its plane.
    fn winding(&self, at: DVec3, normal: DVec3) -> i32 {
        let angle: f64 = pairs(&self.corners)
            .map(|(u, v)| {
                let (u, v) = (u - at, v - at);
                u.cross(v).dot(normal).atan2(u.dot(v))
            })
            .sum();
        (angle / TAU).round() as i32
    }

    /// Linking number with another closed polygon, before rounding.
    pub fn linking(&self, other: &[DVec3]) -> f64 {
        pairs(&self.corners)
            .map(|(a, b)| pairs(other).map(|(c, d)| gauss(a, b, c, d)).sum::<f64>())
            .sum()
    }
}

fn pairs(corners: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| (*a, *b))
}

/// Signed crossing of a segment through a triangle.
fn crosses(p: DVec3, q: DVec3, [a, b, c]: [DVec3; 3]) -> i32 {
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
    let (from, to) = (volume(a, b, c, p), volume(a, b, c, q));
    if (from >= 0.0) == (to >= 0.0) {
        return 0;
    }
    let sides = [
        volume(p, q, a, b) >= 0.0,
        volume(p, q, b, c) >= 0.0,
        volume(p, q, c, a) >= 0.0,
    ];
    if sides[0] != sides[1] || sides[1] != sides[2] {
        return 0;
    }
    if to >= 0.0 { 1 } else { -1 }
}

/// Gauss' integral of two segments a–b and c–d over 4π: their share of a linking number (Klenin & Langowski 2000, method 1a).
fn gauss(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let (ac, ad, bc, bd) = (c - a, d - a, c - b, d - b);
    let normals = [ac.cross(ad), ad.cross(bd), bd.cross(bc), bc.cross(ac)];
    let Some(n) = normals
        .map(|n| n.try_normalize())
        .into_iter()
        .collect::<Option<Vec<_>>>()
    else {
        return 0.0;
    };
    let angle: f64 = (0..4)
        .map(|i| n[i].dot(n[(i + 1) % 4]).clamp(-1.0, 1.0).asin())
        .sum();
    let sign = (d - c).cross(b - a).dot(ac);
    if sign == 0.0 {
        0.0
    } else {
        angle * sign.signum() / (4.0 * PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Two circles of radius 1 in planes at right angles, the second moved along the first's radius: linked while their circles interlace.
        #[test]
        fn circles_are_linked_where_they_interlace(d in 0.0..3.0f64, around in 0.0..TAU, tilt in -0.3..0.3f64) {
            let first = Loop::circle(DVec3::ZERO, DVec3::Z, 1.0);
            let x = DVec3::new(around.cos(), around.sin(), 0.0);
            let y = DVec3::Z.cross(x);
            let second = Loop::circle(x * d, (y + tilt * x).normalize(), 1.0);
            // Away from touching.
            prop_assume!(d > 0.2 && (d - 2.0).abs() > 0.2);
            let number = first.linking(&second.corners);
            let want = if d < 2.0 { 1.0 } else { 0.0 };
            prop_assert!((number.abs() - want).abs() < 1e-9, "{number} at {d}");
            // The crossings of one through the other's region are the same number.
            let crossed: i32 = pairs(&second.corners).map(|(p, q)| first.crossings(p, q)).sum();
            prop_assert_eq!(f64::from(crossed.abs()), want);
            let fan = Loop { normal: None, ..first.clone() };
            let crossed: i32 = pairs(&second.corners).map(|(p, q)| fan.crossings(p, q)).sum();
            prop_assert_eq!(f64::from(crossed.abs()), want);
        }
    }
}

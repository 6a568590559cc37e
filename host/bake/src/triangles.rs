//! Bounding-volume hierarchy over the tessellation: nearest triangle, and all triangles within a distance.

use std::cell::Cell;

use glam::DVec3;
use mortise_brep::Mesh;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

/// Nearest point of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnTriangle {
    /// Position, mm.
    pub point: DVec3,
    /// Part of the triangle that contains the point.
    pub feature: TriangleFeature,
}

/// Part of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TriangleFeature {
    /// Inside.
    Interior,
    /// On side `i`, from corner `i` to corner `i + 1`.
    Side(usize),
    /// Corner `i`.
    Corner(usize),
}

/// Triangles in a bounding-volume hierarchy.
pub(crate) struct TriangleTree {
    bvh: Bvh,
    corners: Vec<[DVec3; 3]>,
}

impl TriangleTree {
    /// Over all triangles of `mesh`, numbered as there.
    pub fn new(mesh: &Mesh) -> Self {
        let corners: Vec<[DVec3; 3]> = mesh
            .triangles
            .iter()
            .map(|t| t.map(|v| mesh.vertices[v as usize]))
            .collect();
        let boxes: Vec<Aabb> = corners
            .iter()
            .map(|&[a, b, c]| {
                Aabb::new(
                    a.min(b).min(c).to_array().into(),
                    a.max(b).max(c).to_array().into(),
                )
            })
            .collect();
        Self {
            bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
            corners,
        }
    }

    /// Corners of triangle `t`.
    pub fn corners(&self, t: u32) -> [DVec3; 3] {
        self.corners[t as usize]
    }

    /// Distance from `p` to the nearest triangle and its number; `None` when the distance exceeds `within`.
    pub fn nearest(&self, p: DVec3, within: f64) -> Option<(f64, u32)> {
        let limit2 = if within.is_finite() {
            within * within * (1.0 + 1e-12) + 1e-24
        } else {
            f64::MAX
        };
        self.bvh
            .find_best(
                limit2,
                |node, _| box_distance2(node, p),
                |t, _| Some(nearest_on_triangle(self.corners(t), p).point.distance_squared(p)),
            )
            .map(|(t, d2)| (d2.sqrt(), t))
    }

    /// Calls `visit` with each triangle that is at most `margin` farther from `p` than the nearest one, and with some that are farther; returns the
    /// distance of the nearest one, infinite when it exceeds `most`. One descent instead of [`Self::nearest`] and [`Self::within`]: the smaller
    /// `most`, the cheaper.
    pub fn near(&self, p: DVec3, most: f64, margin: f64, mut visit: impl FnMut(u32, OnTriangle, f64)) -> f64 {
        let mut nearest = f64::INFINITY;
        let radius2 = Cell::new((most + margin) * (most + margin));
        for t in self.bvh.leaves(|node| box_distance2(node, p) <= radius2.get()) {
            let on = nearest_on_triangle(self.corners(t), p);
            let d2 = on.point.distance_squared(p);
            if d2 > radius2.get() {
                continue;
            }
            let distance = d2.sqrt();
            visit(t, on, distance);
            if distance < nearest.min(most) {
                nearest = distance;
                radius2.set((nearest + margin) * (nearest + margin));
            }
        }
        nearest
    }

    /// Calls `visit` with each triangle within `radius` of `p`, its nearest point and its distance.
    pub fn within(&self, p: DVec3, radius: f64, mut visit: impl FnMut(u32, OnTriangle, f64)) {
        let radius2 = radius * radius;
        for t in self.bvh.leaves(|node| box_distance2(node, p) <= radius2) {
            let on = nearest_on_triangle(self.corners(t), p);
            let d2 = on.point.distance_squared(p);
            if d2 <= radius2 {
                visit(t, on, d2.sqrt());
            }
        }
    }
}

fn box_distance2(node: &BvhNode, p: DVec3) -> f64 {
    let lo = DVec3::from_array(node.mins().into());
    let hi = DVec3::from_array(node.maxs().into());
    (lo - p).max(p - hi).max(DVec3::ZERO).length_squared()
}

/// Nearest point of a triangle to `p` (Ericson, "Real-Time Collision Detection", 5.1.5).
pub(crate) fn nearest_on_triangle([a, b, c]: [DVec3; 3], p: DVec3) -> OnTriangle {
    let corner = |i: usize, point: DVec3| OnTriangle {
        point,
        feature: TriangleFeature::Corner(i),
    };
    let side = |i: usize, point: DVec3| OnTriangle {
        point,
        feature: TriangleFeature::Side(i),
    };
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return corner(0, a);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return corner(1, b);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return side(0, a + ab * (d1 / (d1 - d3)));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return corner(2, c);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return side(2, a + ac * (d2 / (d2 - d6)));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return side(1, b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))));
    }
    let denominator = 1.0 / (va + vb + vc);
    OnTriangle {
        point: a + ab * (vb * denominator) + ac * (vc * denominator),
        feature: TriangleFeature::Interior,
    }
}

/// A triangle near a query, and its nearest point.
pub(crate) struct NearTriangle {
    pub triangle: u32,
    pub face: u32,
    pub on: OnTriangle,
    pub distance: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The tree returns the same results as an exhaustive search.
        #[test]
        fn nearest_equals_brute_force(
            soup in prop::collection::vec(prop::array::uniform9(-10.0f64..10.0), 1..60),
            p in prop::array::uniform3(-20.0f64..20.0),
            radius in 0.1f64..15.0,
        ) {
            let mut mesh = Mesh::default();
            for s in &soup {
                let n = mesh.vertices.len() as u32;
                mesh.vertices.extend([DVec3::new(s[0], s[1], s[2]), DVec3::new(s[3], s[4], s[5]), DVec3::new(s[6], s[7], s[8])]);
                mesh.triangles.push([n, n + 1, n + 2]);
                mesh.triangle_face.push(0);
            }
            let tree = TriangleTree::new(&mesh);
            let p = DVec3::from_array(p);
            let all: Vec<f64> = (0..soup.len() as u32)
                .map(|t| nearest_on_triangle(tree.corners(t), p).point.distance(p))
                .collect();
            let brute = all.iter().copied().fold(f64::INFINITY, f64::min);
            prop_assert!((tree.nearest(p, f64::INFINITY).unwrap().0 - brute).abs() < 1e-12);
            prop_assert!(tree.nearest(p, brute + 1e-9).is_some());
            prop_assert!(tree.nearest(p, brute * 0.999 - 1e-9).is_none());
            let mut found = Vec::new();
            tree.within(p, radius, |t, _, _| found.push(t));
            found.sort_unstable();
            let expected: Vec<u32> = (0..soup.len() as u32).filter(|&t| all[t as usize] <= radius).collect();
            prop_assert_eq!(found, expected);
            // One descent finds the same, whatever bound it begins with.
            for most in [brute * (1.0 + 1e-12) + 1e-12, brute + 1.0, 1e6] {
                let mut near = Vec::new();
                let nearest = tree.near(p, most, radius, |t, _, distance| near.push((t, distance)));
                prop_assert!((nearest - brute).abs() < 1e-12);
                near.retain(|near| near.1 <= nearest + radius);
                near.sort_by_key(|near| near.0);
                let near: Vec<u32> = near.into_iter().map(|near| near.0).collect();
                let expected: Vec<u32> = (0..soup.len() as u32).filter(|&t| all[t as usize] <= nearest + radius).collect();
                prop_assert_eq!(near, expected);
            }
            prop_assert_eq!(tree.near(p, (brute * 0.999 - 1e-9).max(0.0), 0.0, |_, _, _| ()), f64::INFINITY);
        }
    }
}

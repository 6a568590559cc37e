//! Nearest point of a tessellation: quick, and off the exact surface by at most [`Facets::error_mm`].

use glam::DVec3;
use mortise_brep::Shape;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use parry3d_f64::query::PointQuery as _;
use parry3d_f64::shape::Triangle;

use crate::solid::Hit;

/// Triangles of a shape in a tree of boxes. Cost: about a microsecond a query.
pub(crate) struct Facets {
    tree: Bvh,
    triangles: Vec<Triangle>,
    normals: Vec<DVec3>,
    faces: Vec<u32>,
    error: f64,
}

impl Facets {
    /// The facets of `shape`, which differ from its exact surface by at most `error` mm.
    pub fn new(shape: &Shape, error: f64) -> Self {
        let mut out = Self {
            tree: Bvh::default(),
            triangles: Vec::new(),
            normals: Vec::new(),
            faces: Vec::new(),
            error,
        };
        let mut boxes = Vec::new();
        for (triangle, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
            let [a, b, c] = triangle.map(|v| shape.mesh.vertices[v as usize]);
            let Some(normal) = (b - a).cross(c - a).try_normalize() else {
                continue;
            };
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            boxes.push(Aabb::new(low.to_array().into(), high.to_array().into()));
            let [a, b, c] = [a, b, c].map(|p| p.to_array().into());
            out.triangles.push(Triangle::new(a, b, c));
            out.normals.push(normal);
            out.faces.push(face);
        }
        out.tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        out
    }

    /// Largest distance between facets and exact surface, mm.
    pub fn error_mm(&self) -> f64 {
        self.error
    }

    /// Nearest facet's point to `p` when it is nearer than `within` mm. The sign is that facet's: at sharp edges it can be wrong.
    pub fn hit(&self, p: DVec3, within: f64) -> Option<Hit> {
        let point = p.to_array().into();
        let foot = |k: u32| -> DVec3 {
            let foot = self.triangles[k as usize].project_local_point(point, false).point;
            DVec3::from_array(foot.into())
        };
        let (k, distance) = self.tree.find_best(
            within,
            |node, _| node.aabb().distance_to_local_point(point, true),
            |k, _| Some(foot(k).distance(p)),
        )?;
        let (foot, facet) = (foot(k), self.normals[k as usize]);
        let side = if (p - foot).dot(facet) < 0.0 { -1.0 } else { 1.0 };
        // Beyond the error the direction to the foot is the better normal: it tells an edge from a face.
        let normal = if distance > 4.0 * self.error + 1e-6 {
            side * (p - foot) / distance
        } else {
            facet
        };
        Some(Hit {
            distance: side * distance,
            foot,
            normal,
            face: self.faces[k as usize],
        })
    }
}

//! Nearest point of a tessellation: quick, and off the exact surface by at most [`Facets::error_mm`].

use glam::DVec3;
use mortise_brep::Shape;
use parry3d_f64::query::PointQueryWithLocation as _;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use crate::hit::Hit;

/// Triangles of a shape in a tree of boxes. Cost: about a microsecond a query.
pub(crate) struct Facets {
    /// `None` without triangles.
    mesh: Option<TriMesh>,
    faces: Vec<u32>,
    error: f64,
}

impl Facets {
    /// The facets of `shape`, which differ from its exact surface by at most `error` mm.
    pub fn new(shape: &Shape, error: f64) -> Self {
        let vertices = shape.mesh.vertices.iter().map(|p| p.to_array().into());
        let triangles = shape.mesh.triangles.clone();
        Self {
            mesh: TriMesh::with_flags(vertices.collect(), triangles, TriMeshFlags::ORIENTED).ok(),
            faces: shape.mesh.triangle_face.clone(),
            error,
        }
    }

    /// Largest distance between facets and exact surface, mm.
    pub fn error_mm(&self) -> f64 {
        self.error
    }

    /// Nearest facet's point to `p` when it is nearer than `within` mm. The sign is that of the angle-weighted normal there (Bærentzen & Aanæs 2005).
    pub fn hit(&self, p: DVec3, within: f64) -> Option<Hit> {
        let mesh = self.mesh.as_ref()?;
        let point = p.to_array().into();
        let (near, (triangle, _)) =
            mesh.project_local_point_and_get_location_with_max_dist(point, false, within)?;
        let foot = DVec3::from_array(near.point.into());
        let distance = p.distance(foot);
        let side = if near.is_inside { -1.0 } else { 1.0 };
        // Beyond the error the direction to the foot is the better normal: it tells an edge from a face.
        let normal = if distance > 4.0 * self.error + 1e-6 {
            side * (p - foot) / distance
        } else {
            DVec3::from_array(mesh.triangle(triangle).normal()?.into())
        };
        Some(Hit {
            distance: side * distance,
            foot,
            normal,
            face: *self.faces.get(triangle as usize)?,
        })
    }
}

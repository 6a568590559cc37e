//! Whether a shape is convex and its edges give its support mapping.

use glam::DVec3;
use mortise_brep::Surface;

use crate::distance::ExactSurface;
use crate::edges::EdgePiece;
use crate::surface::signed_distance;

/// Tolerance of vertices on faces, mm: rounding, and vertices off their curves.
const SAME_MM: f64 = 2e-4;
/// Tolerance of the edges' support mapping, mm: the tolerance of their pieces, twice.
const SUPPORT_MM: f64 = 2e-3;
/// Most directions in which the support mapping is compared.
const DIRECTIONS: usize = 2000;

/// Whether the shape is the intersection of the convex sets that its faces bound, and a sphere or spanned by its sharp edges.
///
/// Planes, cylinders, cones and spheres with the outward normal away from the axis bound convex sets. If every vertex of the tessellation lies in all
/// of them, the shape does; its surface lies on their intersection's, so it is that intersection.
pub(crate) fn is_convex(surface: &ExactSurface, edges: &[EdgePiece]) -> bool {
    let shape = surface.shape();
    let faces: Vec<(Surface, f64)> = (shape.faces.iter())
        .map(|face| (face.surface, if face.reversed { -1.0 } else { 1.0 }))
        .collect();
    let sphere = |surface: &Surface| matches!(surface, Surface::Sphere { .. });
    let kinds = faces.iter().all(|(surface, sense)| match surface {
        Surface::Plane { .. } => true,
        Surface::Cylinder { .. } | Surface::Cone { .. } => *sense > 0.0,
        Surface::Sphere { .. } => *sense > 0.0 && faces.len() == 1,
        Surface::Torus { .. } | Surface::Spline => false,
    });
    if !shape.closed || surface.sign_by_winding() || !kinds {
        return false;
    }
    let inside =
        |p: &DVec3| (faces.iter()).all(|(surface, sense)| signed_distance(surface, *p) * sense <= SAME_MM);
    let used: Vec<DVec3> = (shape.mesh.triangles.iter().flatten())
        .map(|&v| shape.mesh.vertices[v as usize])
        .collect();
    if !used.iter().all(inside) {
        return false;
    }
    if faces.iter().any(|(surface, _)| sphere(surface)) {
        return edges.is_empty();
    }
    let normals = &surface.topology.facet_normals;
    let step = normals.len().div_ceil(DIRECTIONS).max(1);
    (normals.iter().step_by(step)).all(|&n| {
        let spanned = edges
            .iter()
            .map(|piece| piece.support(n))
            .fold(f64::NEG_INFINITY, f64::max);
        used.iter().all(|p| p.dot(n) <= spanned + SUPPORT_MM)
    })
}

//! Curvature of spline faces by their tessellation: from how the normals turn between the corners of each triangle (Rusinkiewicz 2004, "Estimating
//! Curvatures and Their Derivatives on Triangle Meshes").

use std::collections::HashMap;

use glam::{DMat3, DVec3};

use crate::distance::ExactSurface;

/// Angle-weighted normals of the face's own vertices, from its own triangles only: a sharp border stays sharp.
pub(crate) fn vertex_normals(surface: &ExactSurface, own: &[usize]) -> HashMap<u32, DVec3> {
    let mesh = &surface.shape().mesh;
    let mut normals: HashMap<u32, DVec3> = HashMap::new();
    for &t in own {
        let corners = surface.triangles.corners(t as u32);
        for i in 0..3 {
            let angle = (corners[(i + 1) % 3] - corners[i]).angle_between(corners[(i + 2) % 3] - corners[i]);
            if angle.is_finite() {
                *normals.entry(mesh.triangles[t][i]).or_default() +=
                    surface.topology.facet_normals[t] * angle;
            }
        }
    }
    normals.retain(|_, n| {
        *n = n.normalize_or_zero();
        *n != DVec3::ZERO
    });
    normals
}

/// Area (mm²) and largest principal curvature (1/mm, convex positive) of each triangle of spline face `face`.
pub(crate) fn area_curvatures(surface: &ExactSurface, face: u32) -> Vec<(f64, f64)> {
    let mesh = &surface.shape().mesh;
    let own: Vec<usize> = (0..mesh.triangles.len())
        .filter(|&t| mesh.triangle_face[t] == face)
        .collect();
    let normals = vertex_normals(surface, &own);
    let of = |&t: &usize| {
        let corners = surface.triangles.corners(t as u32);
        let facet = surface.topology.facet_normals[t];
        let at_corners = mesh.triangles[t].map(|v| normals.get(&v).copied().unwrap_or(facet));
        let [p, q] = principal_curvatures(facet, corners, at_corners);
        let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length() / 2.0;
        (area > 0.0 && facet != DVec3::ZERO).then_some((area, p.max(q)))
    };
    own.iter().filter_map(of).collect()
}

/// Principal curvatures of a triangle, 1/mm, convex positive, the larger absolute one first: those of the symmetric 2×2 operator that is the
/// least-squares fit to the change of the normal along its sides.
pub(crate) fn principal_curvatures(facet: DVec3, corners: [DVec3; 3], normals: [DVec3; 3]) -> [f64; 2] {
    let x = facet.any_orthonormal_vector();
    let y = facet.cross(x);
    let mut matrix = DMat3::ZERO;
    let mut right = DVec3::ZERO;
    for i in 0..3 {
        let side = corners[(i + 1) % 3] - corners[i];
        let turn = normals[(i + 1) % 3] - normals[i];
        let (u, v) = (side.dot(x), side.dot(y));
        // (e f; f g)·(u, v) = (turn·x, turn·y), unknowns e, f, g.
        for (row, value) in [
            (DVec3::new(u, v, 0.0), turn.dot(x)),
            (DVec3::new(0.0, u, v), turn.dot(y)),
        ] {
            matrix += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
            right += row * value;
        }
    }
    if matrix.determinant().abs() < 1e-30 {
        return [0.0; 2];
    }
    let s = matrix.inverse() * right;
    let mean = (s.x + s.z) / 2.0;
    let half = ((s.x - s.z) / 2.0).hypot(s.y);
    let (p, q) = (mean + half, mean - half);
    if p.is_finite() && q.is_finite() {
        if p.abs() >= q.abs() { [p, q] } else { [q, p] }
    } else {
        [0.0; 2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cylinder_facet_has_one_curvature() {
        let on = |a: f64, z: f64| DVec3::new(5.0 * a.cos(), 5.0 * a.sin(), z);
        let corners = [on(-0.1, 0.0), on(0.1, 0.0), on(0.1, 40.0)];
        let normals = corners.map(|p| DVec3::new(p.x, p.y, 0.0).normalize());
        let facet = (corners[1] - corners[0])
            .cross(corners[2] - corners[0])
            .normalize();
        let [most, least] = principal_curvatures(facet, corners, normals);
        // Chords are shorter than arcs by a factor 1 − 0.1²/6.
        assert!((most - 0.2).abs() < 2e-3, "{most}");
        assert!(least.abs() < 1e-6, "{least}");
    }
}

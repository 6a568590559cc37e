//! Closedness and volume of a welded triangle mesh.

use crate::Mesh;
use glam::DVec3;
use std::collections::HashMap;

/// Number of mesh edges that are not used exactly twice, once in each direction. Cost: one hash entry per edge.
pub fn open_edges(mesh: &Mesh) -> usize {
    // (uses from the smaller to the larger vertex, uses in the other direction)
    let mut uses: HashMap<(u32, u32), (u32, u32)> = HashMap::with_capacity(mesh.triangles.len() * 3 / 2);
    for t in &mesh.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let entry = uses.entry((a.min(b), a.max(b))).or_default();
            if a < b { entry.0 += 1 } else { entry.1 += 1 }
        }
    }
    uses.values().filter(|&&count| count != (1, 1)).count()
}

/// Signed volume by the divergence theorem, Σ a·(b×c)/6, relative to the first vertex to keep digits; positive when the triangles of a closed mesh
/// wind outward.
pub fn signed_volume(mesh: &Mesh) -> f64 {
    let origin = mesh.vertices.first().copied().unwrap_or(DVec3::ZERO);
    let corner = |i: u32| mesh.vertices[i as usize] - origin;
    mesh.triangles
        .iter()
        .map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))))
        .sum::<f64>()
        / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        Mesh {
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            triangle_face: vec![0; 4],
        }
    }

    #[test]
    fn a_tetrahedron_is_closed_and_has_a_sixth() {
        let mesh = tetrahedron();
        assert_eq!(open_edges(&mesh), 0);
        assert!((signed_volume(&mesh) - 1.0 / 6.0).abs() < 1e-15);
    }

    #[test]
    fn a_missing_or_turned_triangle_opens_three_edges() {
        let mut mesh = tetrahedron();
        mesh.triangles[1].swap(0, 1);
        assert_eq!(open_edges(&mesh), 3);
        mesh.triangles.remove(1);
        assert_eq!(open_edges(&mesh), 3);
    }
}

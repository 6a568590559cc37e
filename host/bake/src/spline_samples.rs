//! Points inside spline faces: placed on the tessellation as densely as its own curvature requires in each direction, then moved onto the exact
//! surface where that is known.
//!
//! The curvature of each triangle comes from how the normals turn between its corners (Rusinkiewicz 2004, "Estimating Curvatures and Their
//! Derivatives on Triangle Meshes"): a cylinder written as a spline gets few points along its generators, as a true one does.

use glam::DVec3;
use mortise_protocol::image::NO_FACE;

use crate::area_curvatures::{principal_curvatures, vertex_normals};
use crate::distance::ExactSurface;
use crate::shell::{PointshellOptions, ShellPoint};

/// Most points of one triangle: a face that would need more is sampled more sparsely.
const MAX_POINTS: f64 = 4000.0;

/// Appends the points inside spline face `face`.
pub(crate) fn sample_spline(
    surface: &ExactSurface,
    face: u32,
    options: &PointshellOptions,
    out: &mut Vec<ShellPoint>,
) {
    let mesh = &surface.shape().mesh;
    let own: Vec<usize> = (0..mesh.triangles.len())
        .filter(|&t| mesh.triangle_face[t] == face)
        .collect();
    let normals = vertex_normals(surface, &own);
    // Accumulated fraction of a point: small triangles share one.
    let mut owed = 0.5;
    for t in own {
        let corners = surface.triangles.corners(t as u32);
        let [a, b, c] = corners;
        let facet = surface.topology.facet_normals[t];
        let area = (b - a).cross(c - a).length() / 2.0;
        if area <= 0.0 || facet == DVec3::ZERO {
            continue;
        }
        let at_corners = mesh.triangles[t].map(|v| normals.get(&v).copied().unwrap_or(facet));
        let [most, least] = principal_curvatures(facet, corners, at_corners).map(f64::abs);
        owed += area / (options.spacing(most) * options.spacing(least));
        let due = owed.floor().min(MAX_POINTS);
        if due < 1.0 {
            continue;
        }
        owed = (owed - due).fract();
        for i in 1..=due as usize {
            let (x, y) = if due < 2.0 {
                (1.0 / 3.0, 1.0 / 3.0)
            } else {
                cover(i)
            };
            let flat = a + (b - a) * x + (c - a) * y;
            let foot = surface.topology.free_forms.beside(face, t as u32, flat);
            // A foot farther away than the facets' deviation belongs to another facet.
            let chord = surface.topology.chord[face as usize];
            let foot = foot.filter(|on| on.normal != DVec3::ZERO && on.point.distance(flat) <= chord + 1e-6);
            let (position, normal) = match foot {
                Some(on) => (on.point, on.normal * surface.topology.sense[face as usize]),
                None => {
                    let normal = at_corners[0] * (1.0 - x - y) + at_corners[1] * x + at_corners[2] * y;
                    (flat, normal.try_normalize().unwrap_or(facet))
                }
            };
            out.push(ShellPoint {
                position,
                normal,
                face: face as u16,
                edge_face: NO_FACE,
                span: None,
            });
        }
    }
}

/// Point `i` of the R2 low-discrepancy sequence (Roberts 2018), folded into the triangle: even coverage for any count.
fn cover(i: usize) -> (f64, f64) {
    let x = (0.5 + i as f64 * 0.754_877_666_246_692_7).fract();
    let y = (0.5 + i as f64 * 0.569_840_290_998_053_2).fract();
    if x + y > 1.0 { (1.0 - x, 1.0 - y) } else { (x, y) }
}

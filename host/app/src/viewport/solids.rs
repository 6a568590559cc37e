//! Built-in meshes: the arrow's cylinder and cone, diameter 1, along +z from 0 to 1.

use std::f32::consts::TAU;

use crate::display::mesh::{ShapeMesh, Vertex};

const SIDES: u32 = 24;

/// Closed cylinder.
pub fn cylinder() -> ShapeMesh {
    revolved(0.5)
}

/// Closed cone, tip at z = 1.
pub fn cone() -> ShapeMesh {
    revolved(0.0)
}

/// A frustum with radius 0.5 at the bottom and `top` at the top, with its end faces; a cone (`top` 0) has only the bottom.
fn revolved(top: f32) -> ShapeMesh {
    let mut mesh = ShapeMesh::default();
    // The wall is inclined inward by 0.5 − top over a height of 1.
    let lean = 0.5 - top;
    let scale = 1.0 / (1.0 + lean * lean).sqrt();
    let ring = |mesh: &mut ShapeMesh, radius: f32, z: f32, normal: &dyn Fn(f32, f32) -> [f32; 3]| -> u32 {
        let first = mesh.vertices.len() as u32;
        for i in 0..SIDES {
            let (s, c) = (TAU * i as f32 / SIDES as f32).sin_cos();
            mesh.vertices.push(Vertex {
                position: [radius * c, radius * s, z],
                normal: normal(c, s),
                color: [0; 4],
                face: 0,
            });
        }
        first
    };
    let wall = |c: f32, s: f32| [c * scale, s * scale, lean * scale];
    let low = ring(&mut mesh, 0.5, 0.0, &wall);
    let high = ring(&mut mesh, top, 1.0, &wall);
    let bottom = ring(&mut mesh, 0.5, 0.0, &|_, _| [0.0, 0.0, -1.0]);
    for i in 0..SIDES {
        let next = (i + 1) % SIDES;
        mesh.indices.extend([low + i, low + next, high + next]);
        mesh.indices.extend([low + i, high + next, high + i]);
        mesh.indices.extend([bottom, bottom + next, bottom + i]);
    }
    if top > 0.0 {
        let lid = ring(&mut mesh, top, 1.0, &|_, _| [0.0, 0.0, 1.0]);
        for i in 0..SIDES {
            mesh.indices.extend([lid, lid + i, lid + (i + 1) % SIDES]);
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn triangles_wind_with_their_normals() {
        for mesh in [cylinder(), cone()] {
            for t in mesh.indices.chunks_exact(3) {
                let v = |k: usize| mesh.vertices[t[k] as usize];
                let p = |k: usize| Vec3::from(v(k).position);
                let area = (p(1) - p(0)).cross(p(2) - p(0));
                // Degenerate triangles (the cone's tip, the first of each fan) have no area to check.
                assert!(area.length() < 1e-9 || area.dot(Vec3::from(v(0).normal)) > 0.0);
            }
        }
    }
}

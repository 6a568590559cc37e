//! Unreachable faces: closed hollows inside a solid that contain no other part.
//!
//! A hollow is a closed piece of the surface, connected to the rest by no edge, with the solid outside it: its own signed volume is negative. A part
//! can enter it only through the solid, so removing it changes nothing that can be felt. It is filled.

use glam::DVec3;
use mortise_brep::{CadModel, Shape};

use crate::winding::WindingTree;

/// `shape` without its hollows, and the removed faces; `None` when there is nothing to remove. `others` gives points (mm, shape frame) of all other
/// parts; a hollow that contains one of them, or a piece of the shape itself, is kept.
pub(crate) fn without_hollows(
    shape: &Shape,
    others: impl FnOnce() -> Vec<DVec3>,
) -> Option<(Shape, Vec<u32>)> {
    if !shape.closed {
        return None;
    }
    let group = groups(shape);
    let count = group.iter().max().map_or(0, |&g| g as usize + 1);
    if count < 2 {
        return None;
    }
    let mesh = &shape.mesh;
    let mut volume = vec![0.0; count];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize]);
        volume[group[t] as usize] += a.dot(b.cross(c)) / 6.0;
    }
    // An inside-out model is reversed later; its largest piece is its outer boundary.
    let sense = volume
        .iter()
        .copied()
        .max_by(|a, b| a.abs().total_cmp(&b.abs()))?
        .signum();
    if volume.iter().all(|v| v * sense >= 0.0) {
        return None;
    }
    let others = others();
    let mut dropped = vec![false; count];
    for (g, dropped) in dropped.iter_mut().enumerate() {
        if volume[g] * sense >= 0.0 {
            continue;
        }
        let mut own = mesh.clone();
        let mut keep = group.iter().map(|&of| of as usize == g);
        own.triangles.retain(|_| keep.next().unwrap_or(false));
        let tree = WindingTree::new(&own);
        let own = (0..mesh.triangles.len())
            .filter(|&t| group[t] as usize != g)
            .map(|t| mesh.vertices[mesh.triangles[t][0] as usize]);
        *dropped = !others.iter().copied().chain(own).any(|p| tree.at(p).abs() > 0.5);
    }
    let mut faces: Vec<u32> = (0..mesh.triangles.len())
        .filter(|&t| dropped[group[t] as usize])
        .map(|t| mesh.triangle_face[t])
        .collect();
    faces.sort_unstable();
    faces.dedup();
    if faces.is_empty() {
        return None;
    }
    let mut filled = shape.clone();
    let kept: Vec<usize> = (0..mesh.triangles.len())
        .filter(|&t| !dropped[group[t] as usize])
        .collect();
    filled.mesh.triangles = kept.iter().map(|&t| mesh.triangles[t]).collect();
    filled.mesh.triangle_face = kept.iter().map(|&t| mesh.triangle_face[t]).collect();
    Some((filled, faces))
}

/// Mesh vertices of all parts but `part`, in `part`'s shape frame.
pub(crate) fn others(model: &CadModel, part: usize) -> Vec<DVec3> {
    let back = model.parts[part].placement.inverse();
    let of = |(i, other): (usize, &mortise_brep::Part)| {
        let to = back * other.placement;
        let vertices = if i == part {
            &[][..]
        } else {
            &model.shapes[other.shape].mesh.vertices
        };
        vertices
            .iter()
            .map(move |&v| to.transform_point3(v))
            .collect::<Vec<_>>()
    };
    model.parts.iter().enumerate().flat_map(of).collect()
}

/// For each triangle the piece of the surface it belongs to: triangles that share vertices belong to the same piece.
fn groups(shape: &Shape) -> Vec<u32> {
    let mesh = &shape.mesh;
    let mut parent: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for &[a, b, c] in &mesh.triangles {
        let r = root(&mut parent, a);
        for v in [b, c] {
            let s = root(&mut parent, v);
            parent[s as usize] = r;
        }
    }
    let mut numbers = std::collections::BTreeMap::new();
    mesh.triangles
        .iter()
        .map(|t| {
            let next = numbers.len() as u32;
            *numbers.entry(root(&mut parent, t[0])).or_insert(next)
        })
        .collect()
}

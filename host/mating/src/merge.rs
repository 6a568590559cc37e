//! Merging of a shape's faces that lie on one surface.

use glam::DVec3;
use mortise_brep::{Face, Frame, Shape, Surface};

use crate::same::{Ball, difference};
use crate::tolerances::Tolerances;

/// Side of a surface on which the material is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// A plane: its frame's z points out of the material.
    Flat,
    /// Material inside: shaft, taper, ball.
    Convex,
    /// Material outside: bore, tapered hole, socket.
    Concave,
}

/// The faces of a shape that share a surface and the side of the material, merged.
#[derive(Clone, Debug)]
pub struct MergedSurface {
    /// Surface of the largest face; plane, cylinder, cone or sphere, in the shape's frame.
    pub surface: Surface,
    /// Side of the material.
    pub side: Side,
    /// Face ids, largest face first.
    pub faces: Vec<u32>,
    /// Patch number of each face: faces joined by an edge belong to one patch.
    pub patches: Vec<u32>,
    /// Sum of the faces' areas, mm².
    pub area_mm2: f64,
    /// Largest fit error of a face recognised in a spline, mm.
    pub fit_mm: f64,
}

/// Merges the faces of `shape`: same kind, same side, and within `tolerances` of each other over the smaller face. Tori and
/// splines are excluded. Large faces come first, so that noise in small faces does not affect the result.
///
/// Cost: one comparison of a few dot products per pair of face and merged surface.
pub fn merge(shape: &Shape, tolerances: &Tolerances) -> Vec<MergedSurface> {
    let balls = balls(shape);
    let mut order: Vec<usize> = (0..shape.faces.len()).collect();
    order.sort_by(|&a, &b| shape.faces[b].area_mm2.total_cmp(&shape.faces[a].area_mm2));
    let mut merged: Vec<MergedSurface> = Vec::new();
    for id in order {
        let face = &shape.faces[id];
        let (Some((surface, side)), Some(ball)) = (turned_out(face), balls[id]) else {
            continue;
        };
        let home = merged.iter_mut().find(|m| {
            m.side == side
                && difference(&m.surface, &surface, ball).is_some_and(|d| {
                    let sense = match (m.surface, surface) {
                        (Surface::Plane { frame: f }, Surface::Plane { frame: g }) => f.z.dot(g.z) > 0.0,
                        _ => true,
                    };
                    sense && d.linear <= tolerances.linear_mm && d.angular <= tolerances.angular_rad
                })
        });
        let fit = face.fit_mm.unwrap_or(0.0);
        match home {
            Some(home) => {
                home.faces.push(id as u32);
                home.area_mm2 += face.area_mm2;
                home.fit_mm = home.fit_mm.max(fit);
            }
            None => merged.push(MergedSurface {
                surface,
                side,
                faces: vec![id as u32],
                patches: Vec::new(),
                area_mm2: face.area_mm2,
                fit_mm: fit,
            }),
        }
    }
    for surface in &mut merged {
        surface.patches = patches(shape, &surface.faces);
    }
    merged
}

/// Surface and side of a face; a plane's frame is oriented with z outward.
fn turned_out(face: &Face) -> Option<(Surface, Side)> {
    let side = if face.reversed {
        Side::Concave
    } else {
        Side::Convex
    };
    match face.surface {
        Surface::Plane { frame } if face.reversed => {
            let frame = Frame {
                y: -frame.y,
                z: -frame.z,
                ..frame
            };
            Some((Surface::Plane { frame }, Side::Flat))
        }
        Surface::Plane { .. } => Some((face.surface, Side::Flat)),
        Surface::Cylinder { .. } | Surface::Cone { .. } | Surface::Sphere { .. } => {
            Some((face.surface, side))
        }
        Surface::Torus { .. } | Surface::Spline => None,
    }
}

/// A bounding ball of each face's mesh; `None` without a mesh.
fn balls(shape: &Shape) -> Vec<Option<Ball>> {
    let mut boxes = vec![(DVec3::INFINITY, DVec3::NEG_INFINITY); shape.faces.len()];
    for (triangle, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        let (low, high) = &mut boxes[face as usize];
        for &v in triangle {
            *low = low.min(shape.mesh.vertices[v as usize]);
            *high = high.max(shape.mesh.vertices[v as usize]);
        }
    }
    let ball = |(low, high): (DVec3, DVec3)| {
        low.x.is_finite().then(|| Ball {
            center: (low + high) / 2.0,
            radius: low.distance(high) / 2.0,
        })
    };
    boxes.into_iter().map(ball).collect()
}

/// Patch number of each of `faces`, assigned in order of first occurrence.
fn patches(shape: &Shape, faces: &[u32]) -> Vec<u32> {
    let mut patch = vec![u32::MAX; faces.len()];
    let mut next = 0;
    for start in 0..faces.len() {
        if patch[start] != u32::MAX {
            continue;
        }
        let mut queue = vec![start];
        while let Some(i) = queue.pop() {
            if std::mem::replace(&mut patch[i], next) == next {
                continue;
            }
            let edges = &shape.faces[faces[i] as usize].edges;
            let beyond = edges.iter().flat_map(|&e| &shape.edges[e as usize].faces);
            queue.extend(
                beyond
                    .filter_map(|f| faces.iter().position(|g| g == f))
                    .filter(|&j| patch[j] != next),
            );
        }
        next += 1;
    }
    patch
}

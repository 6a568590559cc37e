//! Queries of the parts' meshes: faces across an edge, and extents of surfaces along an axis.

use glam::{DAffine3, DVec3};
use mortise_brep::{CadModel, Shape, Surface};

/// Data of one shape, indexed by face.
struct Faces {
    /// The curved faces across each face's edges.
    neighbours: Vec<Vec<u32>>,
    /// Each face's mesh vertices without duplicates, shape frame, mm.
    corners: Vec<Vec<DVec3>>,
}

/// Data of every part of a model.
pub struct Nearby<'a> {
    model: &'a CadModel,
    shapes: Vec<Faces>,
}

impl<'a> Nearby<'a> {
    /// Builds the data in one pass over every mesh.
    pub fn new(model: &'a CadModel) -> Self {
        let faces = |shape: &Shape| Faces {
            neighbours: neighbours(shape),
            corners: corners(shape),
        };
        Self {
            model,
            shapes: model.shapes.iter().map(faces).collect(),
        }
    }

    /// A face and the curved faces across its edges; only the face itself if it does not exist.
    pub fn with_neighbours(&self, part: usize, face: u16) -> Vec<u32> {
        let mut faces = vec![u32::from(face)];
        let more = self.faces(part).and_then(|f| f.neighbours.get(usize::from(face)));
        faces.extend(more.into_iter().flatten());
        faces
    }

    /// Overlap of two groups of faces along `axis`, mm; each group is (part, faces, pose). Negative: gap.
    pub fn overlap(&self, a: (usize, &[u32], &DAffine3), b: (usize, &[u32], &DAffine3), axis: DVec3) -> f64 {
        let (low, high) = self.extent(a, axis);
        let (from, to) = self.extent(b, axis);
        high.min(to) - low.max(from)
    }

    fn faces(&self, part: usize) -> Option<&Faces> {
        self.shapes.get(self.model.parts.get(part)?.shape)
    }

    /// Extent of faces along `axis`, from and to.
    fn extent(&self, (part, faces, at): (usize, &[u32], &DAffine3), axis: DVec3) -> (f64, f64) {
        let all = self.faces(part).map_or(&[][..], |f| f.corners.as_slice());
        (faces.iter().filter_map(|&face| all.get(face as usize)).flatten())
            .map(|&corner| at.transform_point3(corner).dot(axis))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            })
    }
}

fn neighbours(shape: &Shape) -> Vec<Vec<u32>> {
    let mut all = vec![Vec::new(); shape.faces.len()];
    let curved = |face: u32| {
        let surface = shape.faces.get(face as usize).map(|f| f.surface);
        !matches!(surface, None | Some(Surface::Plane { .. } | Surface::Spline))
    };
    for edge in &shape.edges {
        for &a in &edge.faces {
            for &b in edge.faces.iter().filter(|&&b| b != a && curved(b)) {
                if let Some(list) = all.get_mut(a as usize)
                    && !list.contains(&b)
                {
                    list.push(b);
                }
            }
        }
    }
    all
}

fn corners(shape: &Shape) -> Vec<Vec<DVec3>> {
    let mut all = vec![Vec::new(); shape.faces.len()];
    for (triangle, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        if let Some(list) = all.get_mut(face as usize) {
            list.extend(triangle);
        }
    }
    let placed = |mut list: Vec<u32>| {
        list.sort_unstable();
        list.dedup();
        let at = |v: u32| shape.mesh.vertices.get(v as usize).copied();
        list.into_iter().filter_map(at).collect()
    };
    all.into_iter().map(placed).collect()
}

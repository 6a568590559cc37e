//! Conversion of a shape for the graphics card: triangles with exact normals, and edges as segments. Pure.
//!
//! The kernel's mesh shares vertices across faces; shading must not. Each face gets its own vertices. Their normals come from the face's
//! exact surface where it has a closed form, else from the area-weighted triangles around the vertex.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use mortise_brep::{Face, Frame, Shape, Surface};

/// A corner of a triangle, shape frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// Position, mm.
    pub position: [f32; 3],
    /// Outward unit normal.
    pub normal: [f32; 3],
    /// sRGB; alpha 0 selects the part's colour.
    pub color: [u8; 4],
    /// Face id.
    pub face: u32,
}

/// One straight piece of an edge, shape frame, mm.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Segment {
    /// Start point.
    pub a: [f32; 3],
    /// End point.
    pub b: [f32; 3],
    /// The faces that meet in the edge, smaller id first; the same face twice at a seam.
    pub faces: [u32; 2],
}

/// A shape in the graphics card's format.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShapeMesh {
    /// Corners.
    pub vertices: Vec<Vertex>,
    /// Three indices per triangle.
    pub indices: Vec<u32>,
    /// Edges.
    pub segments: Vec<Segment>,
    /// Whether the triangles enclose a volume and wind outward: then no back of one is seen from outside.
    pub closed: bool,
}

impl ShapeMesh {
    /// The mesh of `shape`. Triangles that name no vertex or face of the shape are skipped.
    pub fn of(shape: &Shape) -> Self {
        let mut mesh = Self::default();
        let mut corner_of: HashMap<(u32, u32), u32> = HashMap::new();
        let mut gathered: Vec<DVec3> = Vec::new();
        for (corners, &face_id) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
            let Some(face) = shape.faces.get(face_id as usize) else {
                continue;
            };
            let Some(points) = points_of(shape, corners) else {
                continue;
            };
            let area = (points[1] - points[0]).cross(points[2] - points[0]);
            for (&corner, point) in corners.iter().zip(points) {
                let index = *corner_of.entry((corner, face_id)).or_insert_with(|| {
                    mesh.vertices.push(Vertex {
                        position: point.as_vec3().to_array(),
                        normal: [0.0; 3],
                        color: face.color.map_or([0; 4], shown),
                        face: face_id,
                    });
                    gathered.push(DVec3::ZERO);
                    mesh.vertices.len() as u32 - 1
                });
                gathered[index as usize] += area;
                mesh.indices.push(index);
            }
        }
        for (vertex, gathered) in mesh.vertices.iter_mut().zip(gathered) {
            let face = &shape.faces[vertex.face as usize];
            let point = DVec3::from(vertex.position.map(f64::from));
            let normal = normal(face, point).unwrap_or_else(|| gathered.normalize_or_zero());
            vertex.normal = normal.as_vec3().to_array();
        }
        for edge in &shape.edges {
            let faces = meeting(&edge.faces);
            mesh.segments.extend(edge.polyline.windows(2).map(|ends| Segment {
                a: ends[0].as_vec3().to_array(),
                b: ends[1].as_vec3().to_array(),
                faces,
            }));
        }
        mesh.closed = shape.closed && mesh.indices.len() == 3 * shape.mesh.triangles.len();
        mesh
    }
}

/// The two faces that meet in an edge, in the order that identifies edges; [`u32::MAX`] for a missing face.
pub fn meeting(faces: &[u32]) -> [u32; 2] {
    let a = faces.first().copied().unwrap_or(u32::MAX);
    let b = faces.get(1).copied().unwrap_or(a);
    [a.min(b), a.max(b)]
}

/// Linear RGB in 0..1 to 8-bit sRGB, opaque.
pub fn srgb(linear: [f32; 3]) -> [u8; 4] {
    let encode = |x: f32| {
        let x = x.clamp(0.0, 1.0);
        let s = if x <= 0.003_130_8 {
            12.92 * x
        } else {
            1.055 * x.powf(1.0 / 2.4) - 0.055
        };
        (255.0 * s + 0.5) as u8
    };
    [encode(linear[0]), encode(linear[1]), encode(linear[2]), 255]
}

/// Displayed colour for a file's colour, moved an eighth of the way to a middle grey: pure red and green, common in files, are glaring.
pub fn shown(linear: [f32; 3]) -> [u8; 4] {
    let [r, g, b, a] = srgb(linear);
    let soften = |c: u8| ((7 * u32::from(c) + 128) / 8) as u8;
    [soften(r), soften(g), soften(b), a]
}

fn points_of(shape: &Shape, corners: &[u32; 3]) -> Option<[DVec3; 3]> {
    let at = |i: u32| shape.mesh.vertices.get(i as usize).copied();
    Some([at(corners[0])?, at(corners[1])?, at(corners[2])?])
}

/// Outward unit normal of `face` at `point`; `None` for a spline, and where the surface has no normal (apex, centre).
fn normal(face: &Face, point: DVec3) -> Option<DVec3> {
    let natural = match face.surface {
        Surface::Plane { frame } => frame.z,
        Surface::Cylinder { frame, .. } => radial(&frame, point)?,
        Surface::Cone {
            frame, half_angle, ..
        } => {
            // Below the apex the radius is negative and the axis is on the other side of the wall.
            let outward = radial(&frame, point)?;
            half_angle.cos() * outward - half_angle.sin() * frame.z
        }
        Surface::Sphere { frame, .. } => (point - frame.origin).try_normalize()?,
        Surface::Torus { frame, major, .. } => {
            let centre = frame.origin + major * radial(&frame, point)?;
            (point - centre).try_normalize()?
        }
        Surface::Spline => return None,
    };
    Some(if face.reversed { -natural } else { natural })
}

/// Unit vector away from the frame's axis.
fn radial(frame: &Frame, point: DVec3) -> Option<DVec3> {
    let from = point - frame.origin;
    let across = from - from.dot(frame.z) * frame.z;
    // Within 1e-9 mm of the axis the direction is noise.
    (across.length() > 1e-9).then(|| across.normalize())
}

#[cfg(test)]
mod tests {
    use mortise_brep::{Edge, Mesh};

    use super::*;

    fn frame() -> Frame {
        Frame {
            origin: DVec3::ZERO,
            x: DVec3::X,
            y: DVec3::Y,
            z: DVec3::Z,
        }
    }

    fn face(surface: Surface, reversed: bool) -> Face {
        Face {
            surface,
            fit_mm: None,
            reversed,
            area_mm2: 1.0,
            edges: vec![0],
            color: None,
        }
    }

    /// A quarter of a disc's sector: one triangle on a plane, one on the wall of a hole, sharing an edge.
    fn shape() -> Shape {
        Shape {
            faces: vec![
                face(Surface::Plane { frame: frame() }, false),
                face(
                    Surface::Cylinder {
                        frame: frame(),
                        radius: 1.0,
                    },
                    true,
                ),
            ],
            edges: vec![Edge {
                curve: mortise_brep::Curve::Other,
                length_mm: 1.0,
                faces: vec![0, 1],
                polyline: vec![DVec3::X, DVec3::new(0.7, 0.7, 0.0), DVec3::Y],
            }],
            mesh: Mesh {
                vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 0.0, -1.0)],
                triangles: vec![[0, 1, 2], [1, 3, 2], [0, 1, 9]],
                triangle_face: vec![0, 1, 0],
            },
            ..Shape::default()
        }
    }

    #[test]
    fn shared_vertices_get_one_normal_a_face() {
        let mesh = ShapeMesh::of(&shape());
        assert_eq!(mesh.vertices.len(), 6);
        assert_eq!(
            mesh.indices.len(),
            6,
            "the triangle with an invalid vertex is skipped"
        );
        assert!(
            mesh.vertices
                .iter()
                .filter(|v| v.face == 0)
                .all(|v| v.normal == [0.0, 0.0, 1.0])
        );
        for v in mesh.vertices.iter().filter(|v| v.face == 1) {
            // The wall of a hole has normals towards the axis.
            let expected = [-v.position[0], -v.position[1], 0.0];
            let error = (0..3)
                .map(|i| (v.normal[i] - expected[i]).abs())
                .fold(0.0, f32::max);
            assert!(error < 1e-6);
        }
    }

    #[test]
    fn edges_become_segments_end_to_end() {
        let segments = ShapeMesh::of(&shape()).segments;
        assert_eq!(segments.len(), 2);
        assert_eq!(segments[0].b, segments[1].a);
        assert!(segments.iter().all(|segment| segment.faces == [0, 1]));
    }

    #[test]
    fn an_edge_is_known_by_its_faces_in_either_order() {
        assert_eq!(meeting(&[4, 2]), meeting(&[2, 4]));
        assert_eq!(meeting(&[3]), [3, 3]);
        assert_eq!(meeting(&[]), [u32::MAX; 2]);
    }

    #[test]
    fn splines_take_the_triangles_normal() {
        let mut shape = shape();
        shape.faces[0].surface = Surface::Spline;
        let mesh = ShapeMesh::of(&shape);
        assert!(
            mesh.vertices
                .iter()
                .filter(|v| v.face == 0)
                .all(|v| v.normal == [0.0, 0.0, 1.0])
        );
    }

    #[test]
    fn srgb_ends_are_exact() {
        assert_eq!(srgb([0.0, 1.0, 0.5]), [0, 255, 188, 255]);
    }
}

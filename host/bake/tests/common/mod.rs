//! Hand-made shapes: exact surfaces with a coarse tessellation, so that facets alone would give wrong results.
#![allow(dead_code)]

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DMat3, DVec3};
use mortise_brep::{CadModel, Curve, Edge, Face, Frame, Mesh, Part, Shape, Surface};

pub fn world() -> Frame {
    Frame {
        origin: DVec3::ZERO,
        x: DVec3::X,
        y: DVec3::Y,
        z: DVec3::Z,
    }
}

pub fn frame_at(origin: DVec3, z: DVec3) -> Frame {
    let x = z.any_orthonormal_vector();
    Frame {
        origin,
        x,
        y: z.cross(x),
        z,
    }
}

fn face(surface: Surface, reversed: bool) -> Face {
    Face {
        surface,
        fit_mm: None,
        reversed,
        area_mm2: 1.0,
        edges: Vec::new(),
        color: None,
    }
}

/// A point of a profile to be revolved about z: radius, height, and the face of the segment that starts here.
pub type ProfilePoint = (f64, f64, u32);

/// Revolves a profile about z in `n` steps; the solid lies on the profile's left in the (r, z) half-plane. `closed`: the last point joins the first.
pub fn revolve(profile: &[ProfilePoint], closed: bool, surfaces: &[(Surface, bool)], n: usize) -> Shape {
    let mut mesh = Mesh::default();
    let mut rings: Vec<Vec<u32>> = Vec::new();
    for &(r, z, _) in profile {
        let first = mesh.vertices.len() as u32;
        if r == 0.0 {
            mesh.vertices.push(DVec3::new(0.0, 0.0, z));
            rings.push(vec![first; n]);
        } else {
            mesh.vertices.extend((0..n).map(|i| {
                let a = TAU * i as f64 / n as f64;
                DVec3::new(r * a.cos(), r * a.sin(), z)
            }));
            rings.push((0..n as u32).map(|i| first + i).collect());
        }
    }
    let mut faces: Vec<Face> = surfaces.iter().map(|&(s, reversed)| face(s, reversed)).collect();
    let segments = if closed { profile.len() } else { profile.len() - 1 };
    for s in 0..segments {
        let (low, high) = (&rings[s], &rings[(s + 1) % profile.len()]);
        for i in 0..n {
            let j = (i + 1) % n;
            for t in [[low[i], low[j], high[j]], [low[i], high[j], high[i]]] {
                if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] {
                    mesh.triangles.push(t);
                    mesh.triangle_face.push(profile[s].2);
                }
            }
        }
    }
    let mut edges = Vec::new();
    for (k, &(r, z, own)) in profile.iter().enumerate() {
        let before = if k > 0 {
            profile[k - 1].2
        } else if closed {
            profile[profile.len() - 1].2
        } else {
            continue;
        };
        let last = !closed && k + 1 == profile.len();
        if before == own || last || r == 0.0 {
            continue;
        }
        let mut polyline: Vec<DVec3> = rings[k].iter().map(|&v| mesh.vertices[v as usize]).collect();
        polyline.push(polyline[0]);
        for f in [before, own] {
            faces[f as usize].edges.push(edges.len() as u32);
        }
        edges.push(Edge {
            curve: Curve::Circle {
                frame: Frame {
                    origin: DVec3::new(0.0, 0.0, z),
                    ..world()
                },
                radius: r,
            },
            length_mm: TAU * r,
            faces: vec![before, own],
            polyline,
        });
    }
    finish(Shape {
        faces,
        edges,
        mesh,
        ..Shape::default()
    })
}

/// Adds mesh volume and closedness, as the CAD kernel would.
pub fn finish(mut shape: Shape) -> Shape {
    let mut uses = std::collections::HashMap::new();
    for t in &shape.mesh.triangles {
        for i in 0..3 {
            *uses.entry((t[i], t[(i + 1) % 3])).or_insert(0) += 1;
        }
    }
    shape.open_edges = uses
        .iter()
        .filter(|&(&(a, b), &n)| n != 1 || uses.get(&(b, a)) != Some(&1))
        .count();
    shape.closed = shape.open_edges == 0;
    shape.volume_mm3 = shape
        .mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| shape.mesh.vertices[v as usize]);
            a.dot(b.cross(c)) / 6.0
        })
        .sum();
    shape
}

pub fn peg(radius: f64, height: f64, n: usize) -> Shape {
    let top = Frame {
        origin: DVec3::Z * height,
        ..world()
    };
    revolve(
        &[
            (0.0, 0.0, 0),
            (radius, 0.0, 1),
            (radius, height, 2),
            (0.0, height, 2),
        ],
        false,
        &[
            (Surface::Plane { frame: world() }, true),
            (
                Surface::Cylinder {
                    frame: world(),
                    radius,
                },
                false,
            ),
            (Surface::Plane { frame: top }, false),
        ],
        n,
    )
}

pub fn sphere(radius: f64, n: usize) -> Shape {
    let m = n / 2;
    let profile: Vec<ProfilePoint> = (0..=m)
        .map(|i| {
            let a = -PI / 2.0 + PI * i as f64 / m as f64;
            let r = if i == 0 || i == m { 0.0 } else { radius * a.cos() };
            (r, radius * a.sin(), 0)
        })
        .collect();
    revolve(
        &profile,
        false,
        &[(
            Surface::Sphere {
                frame: world(),
                radius,
            },
            false,
        )],
        n,
    )
}

pub fn torus(major: f64, minor: f64, n: usize) -> Shape {
    let profile: Vec<ProfilePoint> = (0..n)
        .map(|i| {
            let a = TAU * i as f64 / n as f64;
            (major + minor * a.cos(), minor * a.sin(), 0)
        })
        .collect();
    revolve(
        &profile,
        true,
        &[(
            Surface::Torus {
                frame: world(),
                major,
                minor,
            },
            false,
        )],
        n,
    )
}

/// A full cone: base of `radius` at z = 0, tip at `height`.
pub fn cone(radius: f64, height: f64, n: usize) -> Shape {
    revolve(
        &[(0.0, 0.0, 0), (radius, 0.0, 1), (0.0, height, 1)],
        false,
        &[
            (Surface::Plane { frame: world() }, true),
            (
                Surface::Cone {
                    frame: world(),
                    radius,
                    half_angle: -(radius / height).atan(),
                },
                false,
            ),
        ],
        n,
    )
}

/// A block `half.x` × … about the origin in x and y, from z = 0 to `height`, with a through hole of `radius` about z.
/// Faces: 0 bottom, 1 top, 2 −y, 3 +x, 4 +y, 5 −x, 6 hole. `n` is a multiple of 4.
pub fn block_with_hole(half: [f64; 2], height: f64, radius: f64, n: usize) -> Shape {
    assert!(n.is_multiple_of(4));
    let mut mesh = Mesh::default();
    // Corners: quadrant q lies between the angles q·90° and (q+1)·90°.
    let corners: Vec<[f64; 2]> = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
        .iter()
        .map(|(x, y)| [x * half[0], y * half[1]])
        .collect();
    for z in [0.0, height] {
        mesh.vertices
            .extend(corners.iter().map(|c| DVec3::new(c[0], c[1], z)));
        mesh.vertices.extend((0..n).map(|i| {
            let a = TAU * i as f64 / n as f64;
            DVec3::new(radius * a.cos(), radius * a.sin(), z)
        }));
    }
    let layer = (4 + n) as u32;
    let corner = |level: u32, q: usize| level * layer + (q % 4) as u32;
    let hole = |level: u32, i: usize| level * layer + 4 + (i % n) as u32;
    let mut add = |t: [u32; 3], face: u32| {
        mesh.triangles.push(t);
        mesh.triangle_face.push(face);
    };
    for i in 0..n {
        let q = i * 4 / n;
        add([hole(1, i), corner(1, q), hole(1, i + 1)], 1);
        add([hole(0, i), hole(0, i + 1), corner(0, q)], 0);
        if (i + 1) % (n / 4) == 0 {
            add([hole(1, i + 1), corner(1, q), corner(1, q + 1)], 1);
            add([hole(0, i + 1), corner(0, q + 1), corner(0, q)], 0);
        }
        // The hole's wall faces the axis.
        add([hole(0, i), hole(1, i), hole(1, i + 1)], 6);
        add([hole(0, i), hole(1, i + 1), hole(0, i + 1)], 6);
    }
    // Side between quadrant corners q and q+1: +y, −x, −y, +x.
    for (q, f) in [(0, 4), (1, 5), (2, 2), (3, 3)] {
        add([corner(0, q), corner(0, q + 1), corner(1, q + 1)], f);
        add([corner(0, q), corner(1, q + 1), corner(1, q)], f);
    }
    let plane = |origin: DVec3, z: DVec3| {
        face(
            Surface::Plane {
                frame: frame_at(origin, z),
            },
            false,
        )
    };
    let mut faces = vec![
        plane(DVec3::ZERO, -DVec3::Z),
        plane(DVec3::Z * height, DVec3::Z),
        plane(-DVec3::Y * half[1], -DVec3::Y),
        plane(DVec3::X * half[0], DVec3::X),
        plane(DVec3::Y * half[1], DVec3::Y),
        plane(-DVec3::X * half[0], -DVec3::X),
        face(
            Surface::Cylinder {
                frame: world(),
                radius,
            },
            true,
        ),
    ];
    let mut edges = Vec::new();
    let mut edge = |curve: Curve, of: [u32; 2], polyline: Vec<DVec3>, faces: &mut Vec<Face>| {
        for f in of {
            faces[f as usize].edges.push(edges.len() as u32);
        }
        edges.push(Edge {
            curve,
            length_mm: polyline.windows(2).map(|w| w[0].distance(w[1])).sum(),
            faces: of.to_vec(),
            polyline,
        });
    };
    for level in 0..2u32 {
        let ring: Vec<DVec3> = (0..=n).map(|i| mesh.vertices[hole(level, i) as usize]).collect();
        let at = DVec3::Z * height * f64::from(level);
        let frame = Frame {
            origin: at,
            ..world()
        };
        edge(Curve::Circle { frame, radius }, [level, 6], ring, &mut faces);
        for (q, f) in [(0, 4), (1, 5), (2, 2), (3, 3)] {
            let (a, b) = (
                mesh.vertices[corner(level, q) as usize],
                mesh.vertices[corner(level, q + 1) as usize],
            );
            let direction = (b - a).normalize();
            edge(
                Curve::Line { origin: a, direction },
                [level, f],
                vec![a, b],
                &mut faces,
            );
        }
    }
    for (q, of) in [(0, [3, 4]), (1, [4, 5]), (2, [5, 2]), (3, [2, 3])] {
        let (a, b) = (
            mesh.vertices[corner(0, q) as usize],
            mesh.vertices[corner(1, q) as usize],
        );
        edge(
            Curve::Line {
                origin: a,
                direction: DVec3::Z,
            },
            of,
            vec![a, b],
            &mut faces,
        );
    }
    finish(Shape {
        faces,
        edges,
        mesh,
        ..Shape::default()
    })
}

/// The same shape, moved by `to`.
pub fn moved(shape: &Shape, to: DAffine3) -> Shape {
    let mut shape = shape.clone();
    let rotation: DMat3 = to.matrix3;
    let frame = |f: &Frame| Frame {
        origin: to.transform_point3(f.origin),
        x: rotation * f.x,
        y: rotation * f.y,
        z: rotation * f.z,
    };
    for v in &mut shape.mesh.vertices {
        *v = to.transform_point3(*v);
    }
    for face in &mut shape.faces {
        match &mut face.surface {
            Surface::Plane { frame: f }
            | Surface::Cylinder { frame: f, .. }
            | Surface::Cone { frame: f, .. }
            | Surface::Sphere { frame: f, .. }
            | Surface::Torus { frame: f, .. } => *f = frame(f),
            Surface::Spline => {}
        }
    }
    for edge in &mut shape.edges {
        for p in &mut edge.polyline {
            *p = to.transform_point3(*p);
        }
        match &mut edge.curve {
            Curve::Line { origin, direction } => {
                *origin = to.transform_point3(*origin);
                *direction = rotation * *direction;
            }
            Curve::Circle { frame: f, .. } => *f = frame(f),
            Curve::Other => {}
        }
    }
    shape
}

pub fn model(parts: Vec<(&str, Shape, DAffine3)>) -> CadModel {
    let mut model = CadModel {
        unit: "millimetre".to_owned(),
        ..CadModel::default()
    };
    for (name, shape, placement) in parts {
        model.parts.push(Part {
            name: name.to_owned(),
            path: Vec::new(),
            shape: model.shapes.len(),
            placement,
            color: None,
        });
        model.shapes.push(shape);
    }
    model
}

/// Signed distance to the axis-aligned box `lo`..`hi`.
pub fn box_distance(lo: DVec3, hi: DVec3, p: DVec3) -> f64 {
    let d = (lo - p).max(p - hi);
    d.max(DVec3::ZERO).length() + d.max_element().min(0.0)
}

/// Signed distance to [`peg`].
pub fn peg_distance(radius: f64, height: f64, p: DVec3) -> f64 {
    let d = glam::DVec2::new(p.x.hypot(p.y) - radius, (p.z - height / 2.0).abs() - height / 2.0);
    d.max(glam::DVec2::ZERO).length() + d.max_element().min(0.0)
}

/// Signed distance to [`block_with_hole`].
pub fn block_distance(half: [f64; 2], height: f64, radius: f64, p: DVec3) -> f64 {
    let outer = box_distance(
        DVec3::new(-half[0], -half[1], 0.0),
        DVec3::new(half[0], half[1], height),
        p,
    );
    let rho = p.x.hypot(p.y);
    let in_hole = rho < radius;
    if !in_hole && outer <= 0.0 {
        return -(-outer).min(rho - radius);
    }
    if in_hole {
        // Outside the solid: nearest is the wall, or above and below it the rim.
        let dz = (p.z - height).max(-p.z).max(0.0);
        return (radius - rho).hypot(dz);
    }
    outer
}

/// An image in memory aligned to 4 bytes, as flash is.
pub struct AlignedBytes {
    words: Vec<u32>,
    length: usize,
}

impl AlignedBytes {
    pub fn new(bytes: &[u8]) -> Self {
        let mut words = vec![0u32; bytes.len().div_ceil(4)];
        bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self {
            words,
            length: bytes.len(),
        }
    }

    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.length]
    }
}

/// `outer` with a cavity of the shape `void`.
pub fn with_void(outer: &Shape, void: &Shape) -> Shape {
    let mut shape = outer.clone();
    let vertices = shape.mesh.vertices.len() as u32;
    let faces = shape.faces.len() as u32;
    let edges = shape.edges.len() as u32;
    shape.mesh.vertices.extend(&void.mesh.vertices);
    shape.mesh.triangles.extend(
        void.mesh
            .triangles
            .iter()
            .map(|t| [t[0], t[2], t[1]].map(|v| v + vertices)),
    );
    shape
        .mesh
        .triangle_face
        .extend(void.mesh.triangle_face.iter().map(|f| f + faces));
    shape.faces.extend(void.faces.iter().map(|f| Face {
        reversed: !f.reversed,
        edges: f.edges.iter().map(|e| e + edges).collect(),
        ..f.clone()
    }));
    shape.edges.extend(void.edges.iter().map(|e| Edge {
        faces: e.faces.iter().map(|f| f + faces).collect(),
        ..e.clone()
    }));
    finish(shape)
}

/// A box about the origin with these half sizes, mm, its faces in the order −x, +x, −y, +y, −z, +z.
pub fn block(half: DVec3) -> Shape {
    let corner =
        |i: usize| DVec3::from_array([0, 1, 2].map(|a| if i >> a & 1 == 1 { half[a] } else { -half[a] }));
    let vertices: Vec<DVec3> = (0..8).map(corner).collect();
    let mut mesh = Mesh {
        vertices: vertices.clone(),
        ..Mesh::default()
    };
    let mut faces = Vec::new();
    for axis in 0..3 {
        for side in [0, 1] {
            let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            let first = side << axis;
            let ring = [first, first | u, first | u | v, first | v].map(|i: usize| i as u32);
            let [a, b, c, d] = if side == 1 {
                ring
            } else {
                [ring[0], ring[3], ring[2], ring[1]]
            };
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
            mesh.triangle_face.extend([faces.len() as u32; 2]);
            let normal = DVec3::AXES[axis] * if side == 1 { 1.0 } else { -1.0 };
            let frame = frame_at(normal * half[axis], normal);
            faces.push(face(Surface::Plane { frame }, false));
        }
    }
    let mut edges = Vec::new();
    for axis in 0..3 {
        for k in 0..4usize {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let from = ((k & 1) << u) | ((k >> 1) << v);
            let ends = [from, from | 1 << axis].map(|i| vertices[i]);
            let own = [2 * u + (k & 1), 2 * v + (k >> 1)].map(|f| f as u32);
            for f in own {
                faces[f as usize].edges.push(edges.len() as u32);
            }
            edges.push(Edge {
                curve: Curve::Line {
                    origin: ends[0],
                    direction: DVec3::AXES[axis],
                },
                length_mm: ends[0].distance(ends[1]),
                faces: own.to_vec(),
                polyline: ends.to_vec(),
            });
        }
    }
    let mut shape = finish(Shape {
        faces,
        edges,
        mesh,
        ..Shape::default()
    });
    let square = half * half;
    for axis in 0..3 {
        shape.inertia_mm5[axis][axis] = shape.volume_mm3 / 3.0 * (square.element_sum() - square[axis]);
    }
    shape
}

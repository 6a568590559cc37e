//! Open shapes of one surface, cut into a given number of faces.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use mortise_brep::{CadModel, Curve, Edge, Face, Frame, Part, Shape, Surface};

const WORLD: Frame = Frame {
    origin: DVec3::ZERO,
    x: DVec3::X,
    y: DVec3::Y,
    z: DVec3::Z,
};

/// A model of two parts, the second moved by `place`.
pub fn model(shapes: [Shape; 2], place: DAffine3) -> CadModel {
    let part = |shape: usize, placement: DAffine3| Part {
        name: ["first", "second"][shape].into(),
        path: vec![],
        shape,
        placement,
        color: None,
    };
    CadModel {
        parts: vec![part(0, DAffine3::IDENTITY), part(1, place)],
        shapes: shapes.into(),
        ..CadModel::default()
    }
}

fn face(surface: Surface, reversed: bool) -> Face {
    Face {
        surface,
        fit_mm: None,
        reversed,
        area_mm2: 1.0,
        edges: vec![],
        color: None,
    }
}

/// Adds `edge` to the shape and to the faces that it joins.
fn add_edge(shape: &mut Shape, edge: Edge) {
    let id = shape.edges.len() as u32;
    for &f in &edge.faces {
        shape.faces[f as usize].edges.push(id);
    }
    shape.edges.push(edge);
}

/// The wall of a cylinder from z = 0 to `height`, cut into `sectors` × `rows` faces; material outside when `bore`.
pub fn wall(radius: f64, height: f64, sectors: u32, rows: u32, bore: bool) -> Shape {
    const STEPS: u32 = 12;
    let surface = Surface::Cylinder { frame: WORLD, radius };
    let mut shape = Shape {
        faces: vec![face(surface, bore); (sectors * rows) as usize],
        ..Shape::default()
    };
    let columns = sectors * STEPS;
    for row in 0..=rows {
        for column in 0..columns {
            let angle = TAU * f64::from(column) / f64::from(columns);
            let z = height * f64::from(row) / f64::from(rows);
            shape
                .mesh
                .vertices
                .push(DVec3::new(radius * angle.cos(), radius * angle.sin(), z));
        }
    }
    let at = |column: u32, row: u32| row * columns + column % columns;
    let of = |sector: u32, row: u32| row * sectors + sector % sectors;
    for row in 0..rows {
        for column in 0..columns {
            let [a, b, c, d] = [
                at(column, row),
                at(column + 1, row),
                at(column + 1, row + 1),
                at(column, row + 1),
            ];
            for mut t in [[a, b, c], [a, c, d]] {
                if bore {
                    t.swap(1, 2);
                }
                shape.mesh.triangles.push(t);
                shape.mesh.triangle_face.push(of(column / STEPS, row));
            }
        }
    }
    for row in 0..rows {
        for sector in 0..sectors {
            let foot = shape.mesh.vertices[at(sector * STEPS, row) as usize];
            let top = shape.mesh.vertices[at(sector * STEPS, row + 1) as usize];
            let seam = Edge {
                curve: Curve::Line {
                    origin: foot,
                    direction: DVec3::Z,
                },
                length_mm: foot.distance(top),
                faces: vec![of(sector + sectors - 1, row), of(sector, row)],
                polyline: vec![foot, top],
            };
            add_edge(&mut shape, seam);
            if row + 1 < rows {
                let points =
                    (0..=STEPS).map(|i| shape.mesh.vertices[at(sector * STEPS + i, row + 1) as usize]);
                let frame = Frame {
                    origin: DVec3::Z * top.z,
                    ..WORLD
                };
                let arc = Edge {
                    curve: Curve::Circle { frame, radius },
                    length_mm: TAU * radius / f64::from(sectors),
                    faces: vec![of(sector, row), of(sector, row + 1)],
                    polyline: points.collect(),
                };
                add_edge(&mut shape, arc);
            }
        }
    }
    shape
}

/// A plane ring in z = 0 (a disc when `inner` is 0) that faces up or down.
pub fn ring(inner: f64, outer: f64, steps: u32, up: bool) -> Shape {
    let mut shape = Shape {
        faces: vec![face(Surface::Plane { frame: WORLD }, !up)],
        ..Shape::default()
    };
    for radius in [inner, outer] {
        let circle: Vec<DVec3> = (0..steps)
            .map(|i| DVec3::new(radius, 0.0, 0.0).rotate_z(TAU * f64::from(i) / f64::from(steps)))
            .collect();
        shape.mesh.vertices.extend(&circle);
        if radius > 0.0 {
            let rim = Edge {
                curve: Curve::Circle { frame: WORLD, radius },
                length_mm: TAU * radius,
                faces: vec![0],
                polyline: circle.iter().chain(&circle[..1]).copied().collect(),
            };
            add_edge(&mut shape, rim);
        }
    }
    for i in 0..steps {
        let j = (i + 1) % steps;
        let mut triangles = vec![[i, steps + i, steps + j]];
        if inner > 0.0 {
            triangles.push([i, steps + j, j]);
        }
        for mut t in triangles {
            if !up {
                t.swap(1, 2);
            }
            shape.mesh.triangles.push(t);
            shape.mesh.triangle_face.push(0);
        }
    }
    shape
}

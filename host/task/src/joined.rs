//! Parts that move as one, as one shape: their faces, edges and triangles side by side, in the frame of the first part.
//!
//! Nothing is cut away: faces with which the parts touch stay inside, where nothing else comes. Outside, the distance from the joined shape is the least of those from
//! its parts. Inside, it is that from the nearest face, which may be one between two parts; where that is the same face of both, its sign is that of either part, so that
//! such a shape is for contact from outside, not for questions about its inside.

use glam::{DAffine3, DMat3, DVec3};
use mortise_brep::{CadModel, Curve, Frame, Shape, Surface};

/// The shape of `parts` as placed, in the frame of the first one. Cost: a copy of their geometry.
pub fn joined(model: &CadModel, parts: &[usize]) -> Shape {
    let mut whole = Shape {
        closed: true,
        ..Shape::default()
    };
    let Some(first) = parts.first().and_then(|part| model.parts.get(*part)) else {
        return whole;
    };
    let back = first.placement.inverse();
    let placed = parts.iter().filter_map(|part| model.parts.get(*part));
    for part in placed {
        if let Some(shape) = model.shapes.get(part.shape) {
            add(&mut whole, shape, &(back * part.placement));
        }
    }
    whole
}

fn add(whole: &mut Shape, shape: &Shape, by: &DAffine3) {
    let [faces, edges] = [whole.faces.len() as u32, whole.edges.len() as u32];
    let vertices = whole.mesh.vertices.len() as u32;
    let point = |p: &DVec3| by.transform_point3(*p);
    whole.faces.extend(shape.faces.iter().cloned().map(|mut face| {
        face.surface = surface(face.surface, by);
        face.edges.iter_mut().for_each(|edge| *edge += edges);
        face
    }));
    whole.edges.extend(shape.edges.iter().cloned().map(|mut edge| {
        edge.curve = curve(edge.curve, by);
        edge.faces.iter_mut().for_each(|face| *face += faces);
        edge.polyline = edge.polyline.iter().map(point).collect();
        edge
    }));
    let mesh = &shape.mesh;
    whole.mesh.vertices.extend(mesh.vertices.iter().map(point));
    (whole.mesh.triangles).extend(mesh.triangles.iter().map(|t| t.map(|v| v + vertices)));
    (whole.mesh.triangle_face).extend(mesh.triangle_face.iter().map(|face| face + faces));
    whole
        .splines
        .extend(shape.splines.iter().cloned().map(|mut spline| {
            spline.face += faces;
            for pole in &mut spline.poles {
                let [x, y, z, weight] = *pole;
                let [x, y, z] = by.transform_point3(DVec3::new(x, y, z)).to_array();
                *pole = [x, y, z, weight];
            }
            spline
        }));
    whole.curves.extend(shape.curves.iter().cloned().map(|mut fine| {
        fine.edge += edges;
        for side in &mut fine.between {
            *side = side.iter().map(point).collect();
        }
        fine
    }));
    whole.deflection_mm = whole.deflection_mm.max(shape.deflection_mm);
    whole.area_mm2 += shape.area_mm2;
    whole.closed &= shape.closed;
    whole.open_edges += shape.open_edges;
    add_mass(whole, shape, by);
}

/// Adds mass, centre of mass, and inertia about the common centre (parallel axes).
fn add_mass(whole: &mut Shape, shape: &Shape, by: &DAffine3) {
    let turned = by.matrix3 * matrix(&shape.inertia_mm5) * by.matrix3.transpose();
    let at = by.transform_point3(shape.center_of_mass);
    let volume = whole.volume_mm3 + shape.volume_mm3;
    let share = if volume == 0.0 {
        0.0
    } else {
        shape.volume_mm3 / volume
    };
    let center = whole.center_of_mass.lerp(at, share);
    let moved = |mass: f64, from: DVec3| {
        let d = from - center;
        let outer = DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        (DMat3::from_diagonal(DVec3::splat(d.length_squared())) - outer) * mass
    };
    let inertia = matrix(&whole.inertia_mm5)
        + moved(whole.volume_mm3, whole.center_of_mass)
        + turned
        + moved(shape.volume_mm3, at);
    whole.inertia_mm5 = inertia.transpose().to_cols_array_2d();
    (whole.volume_mm3, whole.center_of_mass) = (volume, center);
}

/// A matrix given row by row.
fn matrix(rows: &[[f64; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(rows).transpose()
}

fn frame(frame: Frame, by: &DAffine3) -> Frame {
    Frame {
        origin: by.transform_point3(frame.origin),
        x: by.transform_vector3(frame.x),
        y: by.transform_vector3(frame.y),
        z: by.transform_vector3(frame.z),
    }
}

fn surface(surface: Surface, by: &DAffine3) -> Surface {
    let mut moved = surface;
    match &mut moved {
        Surface::Plane { frame: f }
        | Surface::Cylinder { frame: f, .. }
        | Surface::Cone { frame: f, .. }
        | Surface::Sphere { frame: f, .. }
        | Surface::Torus { frame: f, .. } => *f = frame(*f, by),
        Surface::Spline => {}
    }
    moved
}

fn curve(curve: Curve, by: &DAffine3) -> Curve {
    match curve {
        Curve::Line { origin, direction } => Curve::Line {
            origin: by.transform_point3(origin),
            direction: by.transform_vector3(direction),
        },
        Curve::Circle { frame: f, radius } => Curve::Circle {
            frame: frame(f, by),
            radius,
        },
        Curve::Other => Curve::Other,
    }
}

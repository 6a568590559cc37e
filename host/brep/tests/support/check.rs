//! Checks that must hold for every model of any file.

use glam::DVec3;
use mortise_brep::{CadModel, Curve, Face, Frame, Shape, Surface};

/// Distance of a point from a surface, mm, and the surface's natural normal there; `None` for a spline.
pub fn distance_and_normal(surface: &Surface, point: DVec3) -> Option<(f64, DVec3)> {
    let split = |frame: &Frame| {
        let local = point - frame.origin;
        let radial = local.reject_from_normalized(frame.z);
        (local, radial, local.dot(frame.z))
    };
    Some(match surface {
        Surface::Plane { frame } => (split(frame).2, frame.z),
        Surface::Cylinder { frame, radius } => {
            let (_, radial, _) = split(frame);
            (radial.length() - radius, radial.normalize_or_zero())
        }
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } => {
            let (_, radial, z) = split(frame);
            let normal = radial.normalize_or_zero() * half_angle.cos() - frame.z * half_angle.sin();
            (
                (radial.length() - (radius + z * half_angle.tan())) * half_angle.cos(),
                normal,
            )
        }
        Surface::Sphere { frame, radius } => {
            let (local, ..) = split(frame);
            (local.length() - radius, local.normalize_or_zero())
        }
        Surface::Torus { frame, major, minor } => {
            let (local, radial, _) = split(frame);
            let tube = local - radial.normalize_or_zero() * *major;
            (tube.length() - minor, tube.normalize_or_zero())
        }
        Surface::Spline => return None,
    })
}

/// Outward normal of a face at a point on it.
pub fn outward(face: &Face, point: DVec3) -> Option<DVec3> {
    let (_, natural) = distance_and_normal(&face.surface, point)?;
    Some(if face.reversed { -natural } else { natural })
}

/// Indices, frames, orientation, areas. `tolerance_mm` is how far vertices may be off their analytic surface.
pub fn check(model: &CadModel, tolerance_mm: f64) {
    let mut names = std::collections::HashSet::new();
    for part in &model.parts {
        assert!(part.shape < model.shapes.len());
        assert!(names.insert(&part.name), "two parts are called {:?}", part.name);
        let m = part.placement.matrix3;
        assert!(
            (m * m.transpose() - glam::DMat3::IDENTITY)
                .to_cols_array()
                .iter()
                .all(|v| v.abs() < 1e-9)
        );
        assert!((m.determinant() - 1.0).abs() < 1e-9);
    }
    for (index, shape) in model.shapes.iter().enumerate() {
        let name = model
            .parts
            .iter()
            .find(|p| p.shape == index)
            .map(|p| p.name.as_str())
            .expect("every shape is placed");
        indices(shape);
        frames(shape);
        on_surface(shape, tolerance_mm, name);
        orientation(shape, name);
        let faces: f64 = shape.faces.iter().map(|f| f.area_mm2).sum();
        assert!(
            (faces - shape.area_mm2).abs() <= 1e-9 * shape.area_mm2,
            "{name}: {faces} {}",
            shape.area_mm2
        );
        assert_eq!(shape.closed, shape.open_edges == 0);
        if shape.closed {
            for edge in &shape.edges {
                assert!(
                    edge.faces.len() >= 2,
                    "{name}: an edge of a closed shape has {} faces",
                    edge.faces.len()
                );
            }
        }
    }
}

fn indices(shape: &Shape) {
    let mesh = &shape.mesh;
    assert_eq!(mesh.triangles.len(), mesh.triangle_face.len());
    let n = mesh.vertices.len() as u32;
    for t in &mesh.triangles {
        assert!(t.iter().all(|&i| i < n) && t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
    }
    assert!(
        mesh.triangle_face
            .iter()
            .all(|&f| (f as usize) < shape.faces.len())
    );
    assert!(mesh.vertices.iter().all(|v| v.is_finite()));
    for (id, face) in shape.faces.iter().enumerate() {
        for &edge in &face.edges {
            assert!(shape.edges[edge as usize].faces.contains(&(id as u32)));
        }
    }
    for (id, edge) in shape.edges.iter().enumerate() {
        for &face in &edge.faces {
            assert!(shape.faces[face as usize].edges.contains(&(id as u32)));
        }
        assert!(edge.polyline.len() >= 2 || edge.length_mm < 1e-6);
    }
}

fn frames(shape: &Shape) {
    let right_handed = |f: &Frame| {
        let e = 1e-12;
        assert!(
            f.x.is_normalized()
                && f.z.is_normalized()
                && (f.z.cross(f.x) - f.y).length() < e
                && f.x.dot(f.z).abs() < e
        );
    };
    for face in &shape.faces {
        match &face.surface {
            Surface::Plane { frame } => right_handed(frame),
            Surface::Cylinder { frame, radius } | Surface::Sphere { frame, radius } => {
                right_handed(frame);
                assert!(*radius > 0.0);
            }
            Surface::Cone { frame, .. } => right_handed(frame),
            Surface::Torus { frame, minor, .. } => {
                right_handed(frame);
                assert!(*minor > 0.0);
            }
            Surface::Spline => {}
        }
    }
    for edge in &shape.edges {
        match &edge.curve {
            Curve::Circle { frame, radius } => {
                right_handed(frame);
                for &p in &edge.polyline {
                    let local = p - frame.origin;
                    assert!((local.length() - radius).abs() < 1e-2 * radius + 1e-3);
                }
            }
            Curve::Line { direction, .. } => assert!(direction.is_normalized()),
            Curve::Other => {}
        }
    }
}

fn on_surface(shape: &Shape, tolerance: f64, name: &str) {
    for (t, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        let surface = &shape.faces[face as usize].surface;
        for &i in t {
            let Some((d, _)) = distance_and_normal(surface, shape.mesh.vertices[i as usize]) else {
                break;
            };
            assert!(
                d.abs() <= tolerance,
                "{name}: face {face} has a vertex {d} mm off {surface:?}"
            );
        }
    }
}

/// Checks that triangles point outward, face by face: their area-weighted normals agree with the face's.
fn orientation(shape: &Shape, name: &str) {
    let mut along = vec![0.0; shape.faces.len()];
    let mut area = vec![0.0; shape.faces.len()];
    for (t, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        let [a, b, c] = t.map(|i| shape.mesh.vertices[i as usize]);
        let normal = (b - a).cross(c - a) / 2.0;
        let Some(outward) = outward(&shape.faces[face as usize], (a + b + c) / 3.0) else {
            continue;
        };
        along[face as usize] += normal.dot(outward);
        area[face as usize] += normal.length();
    }
    for (face, (along, area)) in along.iter().zip(&area).enumerate() {
        // Chords of 0.2 rad tilt a triangle by at most 0.1 rad from its surface in each direction.
        assert!(
            *along >= 0.97 * area,
            "{name}: face {face} {:?}: {along} of {area}",
            shape.faces[face]
        );
    }
}

/// A closed mesh within `deflection_mm` of its surface differs from the exact volume by at most deflection × area.
pub fn check_volume(shape: &Shape, deflection_mm: f64, name: &str) {
    if !shape.closed {
        return;
    }
    let mesh = &shape.mesh;
    let origin = mesh.vertices[0];
    let corner = |i: u32| mesh.vertices[i as usize] - origin;
    let volume: f64 = mesh
        .triangles
        .iter()
        .map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))))
        .sum::<f64>()
        / 6.0;
    let bound = deflection_mm * shape.area_mm2 + 1e-9 * volume.abs();
    assert!(
        (volume - shape.volume_mm3).abs() <= bound,
        "{name}: mesh {volume}, exact {} ± {bound}",
        shape.volume_mm3
    );
}

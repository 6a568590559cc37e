//! Conversion of one shape from the kernel's numbers: right-handed frames, outward orientation, closedness.

use crate::kernel::{RawEdge, RawFace, RawShape};
use crate::recognise::{self, Sample};
use crate::recognise_curve;
use crate::{Curve, Edge, Face, Frame, Mesh, Shape, Surface, topology};
use glam::DVec3;

/// Converts a kernel shape into a [`Shape`]; spline faces within `recognise_mm` of a simpler surface are replaced by it. Notes are appended to
/// `notes`.
pub fn convert(raw: RawShape, recognise_mm: f64, notes: &mut Vec<String>) -> Shape {
    let triangles = raw.triangles.as_chunks().0.to_vec();
    let mut mesh = Mesh {
        vertices: points(&raw.vertices),
        triangles,
        triangle_face: raw.triangle_face,
    };
    let open_edges = topology::open_edges(&mesh);
    let closed = open_edges == 0 && !mesh.triangles.is_empty();
    // A closed shape whose triangles enclose a negative volume is inside out.
    let sign = if closed && topology::signed_volume(&mesh) < 0.0 {
        -1.0
    } else {
        1.0
    };
    if sign < 0.0 {
        notes.push("was inside out and has been turned".into());
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    if !raw.faces_without_mesh.is_empty() {
        notes.push(format!(
            "{} of {} faces could not be tessellated",
            raw.faces_without_mesh.len(),
            raw.faces.len()
        ));
    }
    // Twice the bound: smaller errors are not visible, and a seam or pole can legitimately measure slightly more.
    if raw.deflection > 2.0 * raw.deflection_asked {
        let (found, asked) = (raw.deflection, raw.deflection_asked);
        notes.push(format!(
            "the mesh is up to {found:.3} mm off the surface where {asked:.3} was asked"
        ));
    }
    if open_edges > 0 {
        notes.push(format!("is not closed: {open_edges} mesh edges are open"));
    }
    let i = raw.inertia.map(|v| v * sign);
    Shape {
        faces: raw
            .faces
            .into_iter()
            .map(|f| face(f, sign, recognise_mm))
            .collect(),
        edges: raw.edges.into_iter().map(|e| edge(e, recognise_mm)).collect(),
        mesh,
        splines: Vec::new(),
        curves: Vec::new(),
        deflection_mm: raw.deflection,
        volume_mm3: raw.volume * sign,
        area_mm2: raw.area,
        center_of_mass: raw.center.into(),
        inertia_mm5: [[i[0], i[1], i[2]], [i[3], i[4], i[5]], [i[6], i[7], i[8]]],
        closed,
        open_edges,
    }
}

fn points(coordinates: &[f64]) -> Vec<DVec3> {
    coordinates.as_chunks::<3>().0.iter().map(|&p| p.into()).collect()
}

fn face(raw: RawFace, sign: f64, recognise_mm: f64) -> Face {
    let point = DVec3::from(raw.point);
    let recognised = recognise::surface(&samples(&raw.samples), recognise_mm);
    let fit_mm = recognised.map(|(_, fit)| fit);
    let surface = recognised.map_or_else(|| surface(&raw, point), |(surface, _)| surface);
    let outward = DVec3::from(raw.normal) * sign;
    let reversed = match surface.distance(point) {
        Some((_, natural)) => natural.dot(outward) < 0.0,
        // A spline's natural normal is the kernel's own; only its sign relative to the face is known here.
        None => false,
    };
    let color = raw.has_color.then_some(raw.color);
    Face {
        surface,
        fit_mm,
        reversed,
        area_mm2: raw.area,
        edges: raw.edges,
        color,
    }
}

fn samples(numbers: &[f64]) -> Vec<Sample> {
    let vectors = points(numbers);
    let pairs = vectors.as_chunks::<2>().0.iter();
    pairs.map(|&[point, normal]| Sample { point, normal }).collect()
}

/// Right-handed for any frame of the kernel: y is z × x.
fn frame(origin: [f64; 3], x: [f64; 3], z: [f64; 3]) -> Frame {
    let z = DVec3::from(z).normalize();
    let x = DVec3::from(x).reject_from_normalized(z).normalize();
    Frame {
        origin: origin.into(),
        x,
        y: z.cross(x),
        z,
    }
}

fn surface(raw: &RawFace, point: DVec3) -> Surface {
    if raw.kind > 4 {
        return Surface::Spline;
    }
    let frame = frame(raw.origin, raw.x, raw.z);
    let [a, b] = raw.parameters;
    match raw.kind {
        0 => Surface::Plane { frame },
        1 => Surface::Cylinder { frame, radius: a },
        2 => cone(frame, a, b, point),
        3 => Surface::Sphere { frame, radius: a },
        _ => Surface::Torus {
            frame,
            major: a,
            minor: b,
        },
    }
}

/// A face beyond the apex lies on the other half of the double cone, where the radius grows in the other direction. The frame then moves to the
/// face's height so that the radius at z = 0 is positive.
fn cone(frame: Frame, radius: f64, half_angle: f64, point: DVec3) -> Surface {
    let z = (point - frame.origin).dot(frame.z);
    let there = radius + z * half_angle.tan();
    if there >= 0.0 {
        return Surface::Cone {
            frame,
            radius,
            half_angle,
        };
    }
    let frame = Frame {
        origin: frame.origin + z * frame.z,
        ..frame
    };
    Surface::Cone {
        frame,
        radius: -there,
        half_angle: -half_angle,
    }
}

fn edge(raw: RawEdge, recognise_mm: f64) -> Edge {
    let curve = match raw.kind {
        0 => Curve::Line {
            origin: raw.origin.into(),
            direction: DVec3::from(raw.z).normalize(),
        },
        1 => Curve::Circle {
            frame: frame(raw.origin, raw.x, raw.z),
            radius: raw.radius,
        },
        _ => recognise_curve::curve(&points(&raw.samples), recognise_mm).unwrap_or(Curve::Other),
    };
    Edge {
        curve,
        length_mm: raw.length,
        faces: raw.faces,
        polyline: points(&raw.polyline),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_left_handed_frame_comes_out_right_handed() {
        // Only x and z are used; a kernel frame with y = x × z instead of z × x makes no difference.
        let f = frame([1.0, 2.0, 3.0], [0.0, 1.0, 1e-9], [0.0, 0.0, 1.0]);
        assert!((f.x.cross(f.y) - f.z).length() < 1e-15);
        assert!(f.x.dot(f.z).abs() < 1e-15);
    }

    #[test]
    fn a_cone_seen_beyond_its_apex_keeps_its_points() {
        let base = frame([0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        // Radius 1 - z: apex at z = 1; a point at z = 3 is 2 from the axis.
        let Surface::Cone {
            frame,
            radius,
            half_angle,
        } = cone(base, 1.0, -std::f64::consts::FRAC_PI_4, DVec3::new(2.0, 0.0, 3.0))
        else {
            panic!("not a cone")
        };
        assert!((radius - 2.0).abs() < 1e-12 && (frame.origin.z - 3.0).abs() < 1e-12);
        assert!((half_angle - std::f64::consts::FRAC_PI_4).abs() < 1e-12);
    }
}

//! Picking: intersects a ray with every triangle of the parts whose bounding sphere it meets. Pure.
//!
//! Möller & Trumbore (1997). Cost: linear in the triangles of the parts met; runs on a click or a wheel step, not every frame.

use glam::{DAffine3, DVec3};
use mortise_brep::{CadModel, Mesh};

use crate::display::extent::Extent;

/// The nearest point of a part's surface on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Index of the part.
    pub part: usize,
    /// Face of the part.
    pub face: u32,
    /// The point, world, mm.
    pub point: DVec3,
    /// Distance from the ray's start, mm.
    pub distance: f64,
}

/// The nearest part along the ray from `origin` in the unit direction `direction`, with each part at `poses` (shape to world).
///
/// `extents` are the shapes' bounding spheres in their own frames; a part that is `hidden` is passed through.
pub fn pick(
    model: &CadModel,
    extents: &[Extent],
    poses: &[DAffine3],
    hidden: &[bool],
    origin: DVec3,
    direction: DVec3,
) -> Option<Pick> {
    let mut nearest: Option<Pick> = None;
    for (index, (part, pose)) in model.parts.iter().zip(poses).enumerate() {
        if hidden.get(index).is_some_and(|hidden| *hidden) {
            continue;
        }
        let (Some(shape), Some(extent)) = (model.shapes.get(part.shape), extents.get(part.shape)) else {
            continue;
        };
        // Placements are rigid, so lengths along the ray are equal in the shape's frame.
        let inverse = pose.inverse();
        let from = inverse.transform_point3(origin);
        let along = inverse.transform_vector3(direction);
        if !meets(extent, from, along) {
            continue;
        }
        if let Some((face, distance)) = nearest_triangle(&shape.mesh, from, along)
            && nearest.is_none_or(|n| distance < n.distance)
        {
            nearest = Some(Pick {
                part: index,
                face,
                point: origin + distance * direction,
                distance,
            });
        }
    }
    nearest
}

fn meets(extent: &Extent, from: DVec3, along: DVec3) -> bool {
    let to = extent.center - from;
    let nearest = (to - to.dot(along) * along).length_squared();
    nearest <= extent.radius * extent.radius
}

fn nearest_triangle(mesh: &Mesh, from: DVec3, along: DVec3) -> Option<(u32, f64)> {
    let mut nearest: Option<(u32, f64)> = None;
    for (corners, &face) in mesh.triangles.iter().zip(&mesh.triangle_face) {
        let at = |i: usize| mesh.vertices.get(corners[i] as usize).copied();
        let (Some(a), Some(b), Some(c)) = (at(0), at(1), at(2)) else {
            continue;
        };
        if let Some(distance) = ray_triangle(from, along, a, b, c)
            && nearest.is_none_or(|(_, d)| distance < d)
        {
            nearest = Some((face, distance));
        }
    }
    nearest
}

/// Distance along the ray to the triangle, from either side; `None` for a miss.
fn ray_triangle(from: DVec3, along: DVec3, a: DVec3, b: DVec3, c: DVec3) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = along.cross(ac);
    let det = ab.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = from - a;
    let u = s.dot(p) / det;
    let q = s.cross(ab);
    let v = along.dot(q) / det;
    let t = ac.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

#[cfg(test)]
mod tests {
    use mortise_brep::{Part, Shape};

    use super::*;

    fn model() -> CadModel {
        let square = Mesh {
            vertices: vec![
                DVec3::new(-1.0, -1.0, 0.0),
                DVec3::new(1.0, -1.0, 0.0),
                DVec3::new(1.0, 1.0, 0.0),
                DVec3::new(-1.0, 1.0, 0.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            triangle_face: vec![0, 1],
        };
        let part = |name: &str, z: f64| Part {
            name: name.into(),
            path: Vec::new(),
            shape: 0,
            placement: DAffine3::from_translation(DVec3::Z * z),
            color: None,
        };
        CadModel {
            shapes: vec![Shape {
                mesh: square,
                ..Shape::default()
            }],
            parts: vec![part("low", 0.0), part("high", 5.0)],
            ..CadModel::default()
        }
    }

    #[test]
    fn the_nearer_part_is_picked_and_misses_pick_nothing() {
        let model = model();
        let extents = [Extent::of_points(model.shapes[0].mesh.vertices.iter().copied())];
        let poses: Vec<_> = model.parts.iter().map(|p| p.placement).collect();
        let down = |x: f64, y: f64| pick(&model, &extents, &poses, &[], DVec3::new(x, y, 10.0), -DVec3::Z);
        let hit = down(0.5, -0.5).expect("above both");
        assert_eq!((hit.part, hit.face), (1, 0));
        assert!((hit.distance - 5.0).abs() < 1e-12 && (hit.point.z - 5.0).abs() < 1e-12);
        assert_eq!(down(-0.5, 0.5).map(|h| h.face), Some(1));
        assert_eq!(down(1.01, 0.0), None);
    }

    #[test]
    fn a_hidden_part_is_passed_through() {
        let model = model();
        let extents = [Extent::of_points(model.shapes[0].mesh.vertices.iter().copied())];
        let poses: Vec<_> = model.parts.iter().map(|p| p.placement).collect();
        let from = DVec3::new(0.5, -0.5, 10.0);
        for (hidden, part) in [
            ([false, true], Some(0)),
            ([true, false], Some(1)),
            ([true, true], None),
        ] {
            let hit = pick(&model, &extents, &poses, &hidden, from, -DVec3::Z);
            assert_eq!(hit.map(|hit| hit.part), part);
        }
    }

    #[test]
    fn what_lies_behind_is_not_picked() {
        let model = model();
        let extents = [Extent::of_points(model.shapes[0].mesh.vertices.iter().copied())];
        let poses: Vec<_> = model.parts.iter().map(|p| p.placement).collect();
        assert_eq!(
            pick(
                &model,
                &extents,
                &poses,
                &[],
                DVec3::new(0.1, 0.0, 10.0),
                DVec3::Z
            ),
            None
        );
    }
}

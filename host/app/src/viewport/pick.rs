//! Picking: intersects a ray with every triangle of the parts whose bounding sphere it meets. Pure.
//!
//! Möller & Trumbore (1997). Cost: linear in the triangles of the parts met; runs on a click or a wheel step, not every frame.

use glam::{DAffine3, DVec3};
use mortise_brep::{CadModel, Mesh};

use crate::cut::Shown;
use crate::display::extent::Extent;

/// The nearest point of a part's surface on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Index of the part.
    pub part: usize,
    /// Face of the part; `None`: the area in which a section cuts it.
    pub face: Option<u32>,
    /// The point, world, mm.
    pub point: DVec3,
    /// Distance from the ray's start, mm.
    pub distance: f64,
}

/// The nearest part along the ray from `origin` in the unit direction `direction`, with each part at `poses` (shape to world).
///
/// `extents` are the shapes' bounding spheres in their own frames; a part that is `hidden` is passed through. What a section cuts away is not met; its
/// areas are.
pub fn pick(
    model: &CadModel,
    extents: &[Extent],
    poses: &[DAffine3],
    hidden: &[bool],
    cut: Option<Shown<'_>>,
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
        let below = cut.map(|shown| shown.plane.seen_from(pose));
        let kept = |t: f64| below.is_none_or(|plane| plane.height(from + t * along) <= 0.0);
        if let Some((face, distance)) = nearest_triangle(&shape.mesh, from, along, kept)
            && nearest.is_none_or(|n| distance < n.distance)
        {
            nearest = Some(Pick {
                part: index,
                face: Some(face),
                point: origin + distance * direction,
                distance,
            });
        }
    }
    if let Some(hit) = cut.and_then(|shown| on_area(shown, hidden, origin, direction))
        && nearest.is_none_or(|n| hit.distance < n.distance)
    {
        nearest = Some(hit);
    }
    nearest
}

/// Where the ray meets an area of a section, those of hidden parts excluded.
fn on_area(shown: Shown<'_>, hidden: &[bool], origin: DVec3, direction: DVec3) -> Option<Pick> {
    let plane = shown.plane;
    let distance = -plane.height(origin) / direction.dot(plane.normal);
    // Not finite for a ray along the plane.
    if !(distance > 0.0 && distance.is_finite()) {
        return None;
    }
    let point = origin + distance * direction;
    Some(Pick {
        part: shown.cut?.part_at(plane.to_plane(point), hidden)?,
        face: None,
        point,
        distance,
    })
}

fn meets(extent: &Extent, from: DVec3, along: DVec3) -> bool {
    let to = extent.center - from;
    let nearest = (to - to.dot(along) * along).length_squared();
    nearest <= extent.radius * extent.radius
}

/// The nearest triangle that the ray meets at a distance which `kept` accepts.
fn nearest_triangle(
    mesh: &Mesh,
    from: DVec3,
    along: DVec3,
    kept: impl Fn(f64) -> bool,
) -> Option<(u32, f64)> {
    let mut nearest: Option<(u32, f64)> = None;
    for (corners, &face) in mesh.triangles.iter().zip(&mesh.triangle_face) {
        let at = |i: usize| mesh.vertices.get(corners[i] as usize).copied();
        let (Some(a), Some(b), Some(c)) = (at(0), at(1), at(2)) else {
            continue;
        };
        if let Some(distance) = ray_triangle(from, along, a, b, c)
            && nearest.is_none_or(|(_, d)| distance < d)
            && kept(distance)
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
        let down = |x: f64, y: f64| {
            pick(
                &model,
                &extents,
                &poses,
                &[],
                None,
                DVec3::new(x, y, 10.0),
                -DVec3::Z,
            )
        };
        let hit = down(0.5, -0.5).expect("above both");
        assert_eq!((hit.part, hit.face), (1, Some(0)));
        assert!((hit.distance - 5.0).abs() < 1e-12 && (hit.point.z - 5.0).abs() < 1e-12);
        assert_eq!(down(-0.5, 0.5).map(|h| h.face), Some(Some(1)));
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
            let hit = pick(&model, &extents, &poses, &hidden, None, from, -DVec3::Z);
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
                None,
                DVec3::new(0.1, 0.0, 10.0),
                DVec3::Z
            ),
            None
        );
    }

    #[test]
    fn what_is_cut_away_is_not_picked_and_areas_are() {
        use std::sync::Arc;

        use mortise_inspect::CutPlane;

        use crate::cut::areas::Cutter;
        use crate::session::document::Document;

        let document = Document::sample(1, &|_| std::ops::ControlFlow::Continue(())).expect("the sample");
        let plane = CutPlane::new(DVec3::ZERO, -DVec3::Y).expect("a plane");
        let cut = Arc::new(Cutter::default().cut(1, &document.model, &document.poses, plane, 1e-3));
        let picked = |hidden: &[bool], x: f64, z: f64, shown: Option<Shown<'_>>| {
            let from = DVec3::new(x, -200.0, z);
            pick(
                &document.model,
                &document.extents,
                &document.poses,
                hidden,
                shown,
                from,
                DVec3::Y,
            )
        };
        let from_front = |x: f64, z: f64, shown: Option<Shown<'_>>| picked(&[], x, z, shown);
        let shown = Some(Shown {
            plane,
            cut: Some(&cut),
        });
        // Beside the bore: the front of the block; where that is cut away, the area.
        let front = from_front(20.0, -20.0, None).expect("the front");
        assert!((front.point.y + 25.0).abs() < 1e-9 && front.face.is_some());
        let area = from_front(20.0, -20.0, shown).expect("the area");
        assert!(area.point.y.abs() < 1e-9 && area.face.is_none() && area.part == 0);
        // The area of a hidden part is passed through.
        assert_eq!(picked(&[true], 20.0, -20.0, shown), None);
        // In the bore: its wall behind the plane.
        let wall = from_front(0.0, -20.0, shown).expect("the bore's wall");
        assert!(
            (wall.point.y - 9.375).abs() < 0.1 && wall.face.is_some(),
            "{wall:?}"
        );
    }
}

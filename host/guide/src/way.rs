//! The target of a fit that was found for two whole shapes: from the fit finder's way in to the recogniser's target.

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::CadModel;
use mortise_fit::Fit;
use mortise_mating::Axis;
use mortise_mating::recognise::{Target, TargetId, Turn, Way};
use mortise_protocol::message::ConstraintKind;

/// The target that guides part `moving` of `model` along the way in to its `fit` with part `against`; `None` where no way in is known. Of two straight
/// lines the last one guides.
pub fn along(model: &CadModel, moving: usize, against: usize, fit: &Fit) -> Option<Target> {
    let path = fit.path.as_ref()?;
    let part = model.parts.get(moving)?;
    let other = model.parts.get(against)?.placement;
    // The moving part in the other part's frame.
    let seat = other.inverse() * fit.placement;
    let to_moving = fit.placement.inverse();
    let on_axis = path.screw.map(|(point, _)| point).or(path.spin);
    let mut moving_faces: Vec<u32> = fit.faces.iter().map(|faces| faces[0]).collect();
    let mut fixed_faces: Vec<u32> = fit.faces.iter().map(|faces| faces[1]).collect();
    for faces in [&mut moving_faces, &mut fixed_faces] {
        faces.sort_unstable();
        faces.dedup();
    }
    let middle = || middle_of(model, part.shape, &moving_faces);
    let origin = on_axis.map_or_else(middle, |point| to_moving.transform_point3(point));
    let direction = to_moving.transform_vector3(path.direction).normalize();
    let turn = match (path.screw, path.spin) {
        (Some((_, pitch_mm)), _) => Turn::Geared(TAU / pitch_mm),
        (None, Some(_)) => Turn::Free,
        (None, None) => Turn::Geared(0.0),
    };
    let last = match path.corners_mm.as_slice() {
        [.., from, to] => from.distance(*to),
        _ => path.length_mm,
    };
    Some(Target {
        id: TargetId {
            moving_part: moving,
            fixed_part: against,
            surfaces: None,
        },
        kind: ConstraintKind::Path,
        moving: Axis { origin, direction },
        fixed: Axis {
            origin: seat.transform_point3(origin),
            direction: seat.transform_vector3(direction).normalize(),
        },
        play_mm: fit.clearance.min_mm.max(0.0),
        radius_mm: 0.0,
        inner_moves: true,
        moving_faces,
        fixed_faces,
        way: Some(Way {
            orientation: rotation(&seat),
            turn,
            length_mm: last,
            ends: path.ends,
            sliding: path.sliding.clone(),
        }),
    })
}

fn rotation(at: &DAffine3) -> DQuat {
    DQuat::from_mat3(&at.matrix3).normalize()
}

/// Middle of the box around these faces of a shape, in its frame, mm.
fn middle_of(model: &CadModel, shape: usize, faces: &[u32]) -> DVec3 {
    let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let Some(shape) = model.shapes.get(shape) else {
        return DVec3::ZERO;
    };
    let mesh = &shape.mesh;
    let (low, high) = (mesh.triangles.iter().zip(&mesh.triangle_face))
        .filter(|(_, face)| faces.contains(face))
        .flat_map(|(triangle, _)| triangle)
        .filter_map(|&vertex| mesh.vertices.get(vertex as usize))
        .fold(nothing, |(low, high), &p| (low.min(p), high.max(p)));
    let middle = (low + high) / 2.0;
    if middle.is_finite() { middle } else { DVec3::ZERO }
}

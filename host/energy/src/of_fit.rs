//! The energy of a fit that was found for two whole shapes.

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::{CadModel, Shape};
use mortise_fit::{Fit, Path, PathKind};

use crate::bake::bake;
use crate::baked::{BakedEnergy, Way};
use crate::density::Density;
use crate::kernel::Kernel;

/// The energy that draws part `moving` of `model` along the way in to its `fit` with part `against`. `None` where no way in is known, a part has no
/// shape, or the shapes have no density for each other. Cost: that of [`bake()`].
pub fn of_fit(model: &CadModel, moving: usize, against: usize, fit: &Fit) -> Option<BakedEnergy> {
    let path = fit.path.as_ref()?;
    let part = |index: usize| {
        let part = model.parts.get(index)?;
        Some((part, model.shapes.get(part.shape)?))
    };
    let ((_, moving), (fixed, fixed_shape)) = (part(moving)?, part(against)?);
    let mating = box_of(moving, fit.faces.iter().map(|faces| faces[0]))?;
    let to_fixed = fixed.placement.inverse();
    let density = |shape| Density::new(shape, Kernel::default());
    let way = Way {
        length_mm: path.length_mm,
        mating,
        outward: to_fixed.transform_vector3(-path.direction).normalize(),
        pose: &|travel| to_fixed * placement(path, &fit.placement, travel),
    };
    bake(&density(moving), &density(fixed_shape), &way)
}

/// Corners of the box around these faces, mm.
fn box_of(shape: &Shape, faces: impl Iterator<Item = u32> + Clone) -> Option<[DVec3; 2]> {
    let mesh = &shape.mesh;
    (mesh.triangles.iter().zip(&mesh.triangle_face))
        .filter(|(_, face)| faces.clone().any(|mating| mating == **face))
        .flat_map(|(triangle, _)| triangle.map(|vertex| mesh.vertices[vertex as usize]))
        .fold(None, |found: Option<[DVec3; 2]>, p| {
            Some(found.map_or([p, p], |[low, high]| [low.min(p), high.max(p)]))
        })
}

/// Placement of the moving part at a travel from the fit, in the assembly's frame; beyond the way's begin it goes on straight, or on its screw.
fn placement(path: &Path, fit: &DAffine3, travel: f64) -> DAffine3 {
    match (path.kind, path.screw) {
        (PathKind::Screw, Some((point, pitch))) => {
            let turn = DQuat::from_axis_angle(path.direction, -TAU * travel / pitch);
            DAffine3::from_translation(point - path.direction * travel)
                * DAffine3::from_quat(turn)
                * DAffine3::from_translation(-point)
                * *fit
        }
        (PathKind::Polyline, _) => {
            let mut left = travel;
            let mut at = path.corners_mm.last().copied().unwrap_or_default();
            let mut outward = -path.direction;
            for corners in path.corners_mm.windows(2).rev() {
                let leg = corners[0] - corners[1];
                let Some(direction) = leg.try_normalize() else {
                    continue;
                };
                outward = direction;
                let part = left.min(leg.length());
                at += direction * part;
                left -= part;
                if left <= 0.0 {
                    break;
                }
            }
            DAffine3::from_translation(at + outward * left) * *fit
        }
        (PathKind::Line | PathKind::Screw, _) => DAffine3::from_translation(-path.direction * travel) * *fit,
    }
}

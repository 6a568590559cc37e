//! Fit of a target's faces when it is met: the gap between them, by the scene's own exact surfaces.

use glam::Vec3;
use mortise_protocol::image::{FaceRecord, Shape, surface_kind};
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Feature};

use crate::math::vector::length;

/// Fit of mating faces when their target is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    /// Bit mask of the target's face pairs that are kept apart.
    pub pairs: u8,
    /// The smallest gap of those pairs, m; negative for a press fit.
    pub gap_m: f32,
    /// Lever arm from the moving part's feature to its farthest point, upper bound, m.
    pub lever_m: f32,
}

impl Fit {
    /// Fit of a target's face pairs, by the exact surfaces of both shapes. About 150 instructions a pair, computed once per target.
    pub fn of(target: &ConstraintTarget, moving: &Shape<'_>, fixed: &Shape<'_>) -> Self {
        let lever = |shape: &Shape<'_>, feature: &Feature| {
            let center = Vec3::from_array(shape.record.center);
            length(Vec3::from_array(feature.point) - center) + shape.record.radius
        };
        let (own, other) = (lever(moving, &target.moving), lever(fixed, &target.fixed));
        let mut fit = Self {
            pairs: 0,
            gap_m: f32::INFINITY,
            lever_m: own,
        };
        for (i, &(m, s)) in target.faces.iter().enumerate() {
            let faces = (moving.faces.get(usize::from(m)), fixed.faces.get(usize::from(s)));
            let (Some(m), Some(s)) = faces else { continue };
            if !mate(target.kind, m, s) {
                continue;
            }
            let alignment_error =
                alignment_error(m, &target.moving, own) + alignment_error(s, &target.fixed, other);
            let gap = -(m.sense * m.radius + s.sense * s.radius) - alignment_error;
            fit.pairs |= 1 << i;
            if gap < fit.gap_m {
                fit.gap_m = gap;
            }
        }
        fit
    }
}

/// Whether a target of this kind keeps these surfaces apart: a convex round surface inside a concave one.
fn mate(kind: ConstraintKind, moving: &FaceRecord, fixed: &FaceRecord) -> bool {
    use surface_kind::{CYLINDER, SPHERE};
    let kinds = (moving.kind, fixed.kind);
    let round = match kind {
        ConstraintKind::Concentric => kinds == (CYLINDER, CYLINDER),
        ConstraintKind::Spherical => kinds == (SPHERE, SPHERE),
        ConstraintKind::Annular => kinds == (SPHERE, CYLINDER),
        ConstraintKind::AnnularBore => kinds == (CYLINDER, SPHERE),
        ConstraintKind::Conical | ConstraintKind::Coplanar | ConstraintKind::Path => false,
    };
    round && moving.sense * fixed.sense < 0.0
}

/// Distance of a surface from its nominal place by the feature, within `lever` of the feature's point, m.
fn alignment_error(face: &FaceRecord, feature: &Feature, lever: f32) -> f32 {
    let from = Vec3::from_array(face.origin) - Vec3::from_array(feature.point);
    if face.kind == surface_kind::SPHERE {
        return length(from);
    }
    let (axis, direction) = (Vec3::from_array(face.axis), Vec3::from_array(feature.direction));
    length(from.cross(axis)) + length(axis.cross(direction)) * lever
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cylinder(sense: f32, radius: f32) -> FaceRecord {
        FaceRecord {
            kind: surface_kind::CYLINDER,
            sense,
            origin: [0.0, 0.0, 0.01],
            axis: [0.0, 0.0, -1.0],
            radius,
            second: 0.0,
        }
    }

    #[test]
    fn only_a_shaft_in_a_bore_mates() {
        let (shaft, bore) = (cylinder(1.0, 0.01), cylinder(-1.0, 0.011));
        assert!(mate(ConstraintKind::Concentric, &shaft, &bore));
        assert!(mate(ConstraintKind::Concentric, &bore, &shaft));
        assert!(!mate(ConstraintKind::Concentric, &shaft, &shaft));
        assert!(!mate(ConstraintKind::Annular, &shaft, &bore));
        let plane = FaceRecord {
            kind: surface_kind::PLANE,
            ..bore
        };
        assert!(!mate(ConstraintKind::Concentric, &shaft, &plane));
    }

    #[test]
    fn alignment_error_is_the_offset_of_the_surface() {
        let feature = |point, direction| Feature { point, direction };
        let shaft = cylinder(1.0, 0.01);
        assert_eq!(
            alignment_error(&shaft, &feature([0.0; 3], [0.0, 0.0, 1.0]), 0.1),
            0.0
        );
        let offset = alignment_error(&shaft, &feature([3e-5, 0.0, 0.05], [0.0, 0.0, 1.0]), 0.1);
        assert!((offset - 3e-5).abs() < 1e-9);
        let tilted = alignment_error(&shaft, &feature([0.0; 3], [1e-3, 0.0, 1.0]), 0.1);
        assert!((tilted - 1e-4).abs() < 1e-6, "{tilted}");
    }
}

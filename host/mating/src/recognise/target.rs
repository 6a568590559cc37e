//! A constraint that two merged surfaces, or two whole shapes, could satisfy, with its geometry in both parts' frames.

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::Surface;
use mortise_protocol::message::ConstraintKind;

use crate::contact::Axis;
use crate::merge::{MergedSurface, Side};

/// Two merged surfaces, one of the moving part and one of a fixed part, or the two parts as wholes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TargetId {
    /// The moving part, an index into [`mortise_brep::CadModel::parts`].
    pub moving_part: usize,
    /// The other part.
    pub fixed_part: usize,
    /// Surface of the moving part and of the other, indices into [`crate::merge`] of their shapes; `None`: a fit of the whole shapes.
    pub surfaces: Option<[usize; 2]>,
}

/// The way on which two shapes of any form fit: of targets of kind [`ConstraintKind::Path`].
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// Orientation of the moving part in the other part's frame where both origins meet.
    pub orientation: DQuat,
    /// Rotation about the axis.
    pub turn: Turn,
    /// Length of the way before the origins meet, mm.
    pub length_mm: f64,
    /// Whether it ends where the origins meet.
    pub ends: bool,
    /// Faces of both parts that slide along each other, in pairs: the target accounts for contact between these.
    pub sliding: Vec<[u32; 2]>,
}

/// Rotation about the axis of a way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// Free.
    Free,
    /// In proportion to the travel, rad/mm, positive for a right-hand thread; 0: none.
    Geared(f64),
}

impl Way {
    /// Orientation of the moving part in the assembly that the way asks for after a travel along `axis` (mm; negative before the end), with the other
    /// part turned by `fixed`.
    pub(crate) fn goal(&self, fixed: DQuat, axis: DVec3, travel_mm: f64) -> DQuat {
        let rate = match self.turn {
            Turn::Free => 0.0,
            Turn::Geared(rate) => rate,
        };
        DQuat::from_axis_angle(axis.normalize(), rate * travel_mm) * fixed * self.orientation
    }
}

/// A constraint that two surfaces or shapes could satisfy.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The surfaces.
    pub id: TargetId,
    /// The kind of constraint.
    pub kind: ConstraintKind,
    /// Axis, outward normal, centre (with arbitrary direction), axis of a cone in the direction of its widening, or of a way in the direction in which
    /// the part goes in: in the moving part's frame. Where the surface does not determine the origin, it is in the middle of the moving surface.
    pub moving: Axis,
    /// The corresponding axis of the fixed surface, in the fixed part's frame.
    pub fixed: Axis,
    /// Radius of the hole minus that of the inner surface, mm: the play to either side. Of a way its smallest clearance; 0 for planes and cones.
    pub play_mm: f64,
    /// Radius of the inner surface, mm; 0 for planes, cones and ways.
    pub radius_mm: f64,
    /// Whether the inner surface (shaft, cone, ball) belongs to the moving part; `false` for planes.
    pub inner_moves: bool,
    /// Face ids of the moving part: the target accounts for contact between these faces and `fixed_faces`.
    pub moving_faces: Vec<u32>,
    /// Face ids of the fixed part.
    pub fixed_faces: Vec<u32>,
    /// Of a fit of whole shapes.
    pub way: Option<Way>,
}

/// Alignment error of a target. The letters are those of the notation page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentError {
    /// d, mm.
    pub distance_mm: f64,
    /// θ, radians.
    pub angle_rad: f64,
}

impl Target {
    /// The target of two surfaces; `None` when they do not mate, because their kinds do not match or they are not an inside
    /// and an outside. `middle` is a point in the middle of the moving surface, in its part's frame.
    pub(crate) fn between(
        id: TargetId,
        moving: &MergedSurface,
        fixed: &MergedSurface,
        middle: DVec3,
    ) -> Option<Self> {
        let in_bore = match (moving.side, fixed.side) {
            (Side::Convex, Side::Concave) => 1.0,
            (Side::Concave, Side::Convex) => -1.0,
            (Side::Flat, Side::Flat) => 0.0,
            _ => return None,
        };
        let on = |origin: DVec3, z: DVec3| Axis {
            origin: origin + z * (middle - origin).dot(z),
            direction: z,
        };
        let at = |origin: DVec3, z: DVec3| Axis { origin, direction: z };
        let (kind, a, b, radii) = match (moving.surface, fixed.surface) {
            (Surface::Plane { frame: f }, Surface::Plane { frame: g }) => {
                let foot = middle - f.z * (middle - f.origin).dot(f.z);
                (
                    ConstraintKind::Coplanar,
                    at(foot, f.z),
                    at(g.origin, g.z),
                    [0.0; 2],
                )
            }
            (Surface::Cylinder { frame: f, radius: r }, Surface::Cylinder { frame: g, radius: s }) => (
                ConstraintKind::Concentric,
                on(f.origin, f.z),
                at(g.origin, g.z),
                [r, s],
            ),
            (
                Surface::Cone {
                    frame: f,
                    radius: r,
                    half_angle: x,
                },
                Surface::Cone {
                    frame: g,
                    radius: s,
                    half_angle: y,
                },
            ) => {
                // Both axes point in the direction of widening, at the radius in the middle of the moving cone: the cones
                // are compared there and not at the apex, which may be far away.
                let here = r + (middle - f.origin).dot(f.z) * x.tan();
                let beside = |origin: DVec3, z: DVec3, radius: f64, angle: f64| {
                    at(origin + z * ((here - radius) / angle.tan()), z * angle.signum())
                };
                let same = (x.abs() - y.abs()).abs() < 1e-2;
                (
                    same.then_some(ConstraintKind::Conical)?,
                    beside(f.origin, f.z, r, x),
                    beside(g.origin, g.z, s, y),
                    [0.0; 2],
                )
            }
            (Surface::Sphere { frame: f, radius: r }, Surface::Sphere { frame: g, radius: s }) => (
                ConstraintKind::Spherical,
                at(f.origin, f.z),
                at(g.origin, g.z),
                [r, s],
            ),
            // The sphere may belong to either part.
            (Surface::Sphere { frame: f, radius: r }, Surface::Cylinder { frame: g, radius: s })
                if in_bore > 0.0 =>
            {
                (
                    ConstraintKind::Annular,
                    at(f.origin, f.z),
                    at(g.origin, g.z),
                    [r, s],
                )
            }
            (Surface::Cylinder { frame: f, radius: r }, Surface::Sphere { frame: g, radius: s })
                if in_bore < 0.0 =>
            {
                (
                    ConstraintKind::AnnularBore,
                    on(f.origin, f.z),
                    at(g.origin, g.z),
                    [r, s],
                )
            }
            _ => return None,
        };
        Some(Self {
            id,
            kind,
            moving: a,
            fixed: b,
            play_mm: in_bore * (radii[1] - radii[0]),
            radius_mm: radii[0].min(radii[1]),
            inner_moves: in_bore > 0.0,
            moving_faces: moving.faces.clone(),
            fixed_faces: fixed.faces.clone(),
            way: None,
        })
    }

    /// (d, θ) at the given placements of both parts.
    pub fn alignment_error(&self, moving: &DAffine3, fixed: &DAffine3) -> AlignmentError {
        let (a, b) = (placed(&self.moving, moving), placed(&self.fixed, fixed));
        let between = a.origin - b.origin;
        let lines = a.direction.cross(b.direction).length();
        let cos = a.direction.dot(b.direction);
        let (distance_mm, angle_rad) = match self.kind {
            ConstraintKind::Concentric => (between.reject_from(b.direction).length(), lines.atan2(cos.abs())),
            ConstraintKind::Coplanar => (between.dot(b.direction).abs(), lines.atan2(-cos)),
            ConstraintKind::Conical => (between.length(), lines.atan2(cos)),
            ConstraintKind::Spherical => (between.length(), 0.0),
            ConstraintKind::Annular | ConstraintKind::AnnularBore => {
                (between.reject_from(self.bore(&a, &b)).length(), 0.0)
            }
            ConstraintKind::Path => {
                let angle = match &self.way {
                    Some(way) if way.turn != Turn::Free => {
                        let goal = way.goal(rotation(fixed), b.direction, between.dot(b.direction));
                        goal.angle_between(rotation(moving))
                    }
                    _ => lines.atan2(cos),
                };
                (between.reject_from(b.direction).length(), angle)
            }
        };
        AlignmentError {
            distance_mm,
            angle_rad,
        }
    }

    /// Direction of the bore of an annular target.
    pub(crate) fn bore(&self, a: &Axis, b: &Axis) -> DVec3 {
        match self.kind {
            ConstraintKind::AnnularBore => a.direction,
            _ => b.direction,
        }
    }
}

/// Rotation of a placement.
pub(crate) fn rotation(at: &DAffine3) -> DQuat {
    DQuat::from_mat3(&at.matrix3).normalize()
}

/// An axis transformed by its part's placement.
pub(crate) fn placed(axis: &Axis, at: &DAffine3) -> Axis {
    Axis {
        origin: at.transform_point3(axis.origin),
        direction: at.transform_vector3(axis.direction),
    }
}

//! A constraint that two merged surfaces could keep, with its geometry in both parts' frames.

use glam::{DAffine3, DVec3};
use mortise_brep::Surface;

use crate::contact::Axis;
use crate::merge::{MergedSurface, Side};

/// What a target asks for. The letters are those of the notation page: d is a distance, θ an angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum TargetKind {
    /// Shaft in bore: axes coincide. Leaves a slide and a turn.
    Concentric,
    /// Planes meet face to face. Leaves two slides and a turn.
    Coplanar,
    /// Taper in taper: axes coincide, and so do circles of one radius. Leaves a turn.
    Conical,
    /// Ball in socket: centres coincide. Leaves three turns.
    Spherical,
    /// Ball in bore: the centre is on the axis. Leaves a slide and three turns.
    Annular,
}

impl TargetKind {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Concentric => "concentric",
            Self::Coplanar => "coplanar",
            Self::Conical => "conical",
            Self::Spherical => "spherical",
            Self::Annular => "annular",
        }
    }
}

/// Two merged surfaces: of the moving part, of a fixed part. Indices into [`crate::merge`] of the parts' shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TargetId {
    /// The moving part, an index into [`mortise_brep::CadModel::parts`].
    pub moving_part: usize,
    /// Its surface.
    pub moving_surface: usize,
    /// The other part.
    pub fixed_part: usize,
    /// Its surface.
    pub fixed_surface: usize,
}

/// A constraint two surfaces could keep.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Which surfaces.
    pub id: TargetId,
    /// What is asked.
    pub kind: TargetKind,
    /// Axis, outward normal, centre (any direction), or axis of a cone the way it widens: in the moving part's frame. Its origin is in the middle of
    /// the moving surface where the surface leaves a choice.
    pub moving: Axis,
    /// The same of the fixed surface, in the fixed part's frame.
    pub fixed: Axis,
    /// Radius of the hole less that of what goes in, mm: the play to either side. 0 of planes and cones.
    pub play_mm: f64,
    /// Radius of what goes in, mm; 0 of planes and cones.
    pub radius_mm: f64,
    /// Of a ball in a bore: the ball is the moving part's.
    pub ball_moves: bool,
    /// Face ids on both sides: contact between these is what the target explains.
    pub moving_faces: Vec<u32>,
    /// Of the fixed part.
    pub fixed_faces: Vec<u32>,
}

/// How far a target is from being kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misfit {
    /// d, mm.
    pub distance_mm: f64,
    /// θ, radians.
    pub angle_rad: f64,
}

impl Target {
    /// The target two surfaces could keep; `None` when they do not mate: of kinds that do not go together, or not an inside
    /// with an outside. `middle` is a point in the middle of the moving surface, in its part's frame.
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
                (TargetKind::Coplanar, at(foot, f.z), at(g.origin, g.z), [0.0; 2])
            }
            (Surface::Cylinder { frame: f, radius: r }, Surface::Cylinder { frame: g, radius: s }) => (
                TargetKind::Concentric,
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
                // Both along the way they widen, where the radius is that in the middle of the moving cone: there they are
                // compared, not at the apex, which may be far away.
                let here = r + (middle - f.origin).dot(f.z) * x.tan();
                let beside = |origin: DVec3, z: DVec3, radius: f64, angle: f64| {
                    at(origin + z * ((here - radius) / angle.tan()), z * angle.signum())
                };
                let same = (x.abs() - y.abs()).abs() < 1e-2;
                (
                    same.then_some(TargetKind::Conical)?,
                    beside(f.origin, f.z, r, x),
                    beside(g.origin, g.z, s, y),
                    [0.0; 2],
                )
            }
            (Surface::Sphere { frame: f, radius: r }, Surface::Sphere { frame: g, radius: s }) => (
                TargetKind::Spherical,
                at(f.origin, f.z),
                at(g.origin, g.z),
                [r, s],
            ),
            // Of either part.
            (Surface::Sphere { frame: f, radius: r }, Surface::Cylinder { frame: g, radius: s })
                if in_bore > 0.0 =>
            {
                (TargetKind::Annular, at(f.origin, f.z), at(g.origin, g.z), [r, s])
            }
            (Surface::Cylinder { frame: f, radius: r }, Surface::Sphere { frame: g, radius: s })
                if in_bore < 0.0 =>
            {
                (TargetKind::Annular, on(f.origin, f.z), at(g.origin, g.z), [r, s])
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
            ball_moves: in_bore > 0.0,
            moving_faces: moving.faces.clone(),
            fixed_faces: fixed.faces.clone(),
        })
    }

    /// (d, θ) at the given places of both parts.
    pub fn misfit(&self, moving: &DAffine3, fixed: &DAffine3) -> Misfit {
        let (a, b) = (placed(&self.moving, moving), placed(&self.fixed, fixed));
        let between = a.origin - b.origin;
        let lines = a.direction.cross(b.direction).length();
        let cos = a.direction.dot(b.direction);
        let (distance_mm, angle_rad) = match self.kind {
            TargetKind::Concentric => (between.reject_from(b.direction).length(), lines.atan2(cos.abs())),
            TargetKind::Coplanar => (between.dot(b.direction).abs(), lines.atan2(-cos)),
            TargetKind::Conical => (between.length(), lines.atan2(cos)),
            TargetKind::Spherical => (between.length(), 0.0),
            TargetKind::Annular => (between.reject_from(self.bore(&a, &b)).length(), 0.0),
        };
        Misfit {
            distance_mm,
            angle_rad,
        }
    }

    /// Direction of the bore of an annular target.
    pub(crate) fn bore(&self, a: &Axis, b: &Axis) -> DVec3 {
        if self.ball_moves { b.direction } else { a.direction }
    }
}

/// An axis where its part is.
pub(crate) fn placed(axis: &Axis, at: &DAffine3) -> Axis {
    Axis {
        origin: at.transform_point3(axis.origin),
        direction: at.transform_vector3(axis.direction),
    }
}

//! A contact between two parts.

use glam::DVec3;

/// Kind of a contact, by the surfaces that meet.
///
/// Not a [`ConstraintKind`](mortise_protocol::message::ConstraintKind): a contact states where two parts touch as placed in the file, without saying
/// which of them moves; a constraint states how a moving part could be held to a fixed one, also while they do not touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ContactKind {
    /// Plane on plane.
    Planar,
    /// Shaft in bore.
    Cylindrical,
    /// Taper in taper.
    Conical,
    /// Ball in socket.
    Spherical,
    /// Ball in bore: they touch along a circle (linear annular).
    Annular,
}

impl ContactKind {
    /// Name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Planar => "planar",
            Self::Cylindrical => "cylindrical",
            Self::Conical => "conical",
            Self::Spherical => "spherical",
            Self::Annular => "annular",
        }
    }
}

/// A point and a unit direction, in the assembly's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Point on the axis, mm.
    pub origin: DVec3,
    /// Unit vector.
    pub direction: DVec3,
}

/// Two merged surfaces of different parts that touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Kind of the contact.
    pub kind: ContactKind,
    /// Indices into [`mortise_brep::CadModel::parts`], smaller first.
    pub parts: [usize; 2],
    /// Indices into [`crate::merge`] of each part's shape.
    pub surfaces: [usize; 2],
    /// Ids of the touching faces: of the first part and of the second.
    pub faces: Vec<[u32; 2]>,
    /// Number of separate patches that touch: connected faces of one surface count once.
    pub count: usize,
    /// Plane: middle of the common area and the first part's outward normal there. Cylinder and cone: the axis, at the
    /// middle of the common length. Sphere: the centre, with an arbitrary direction. Ball in bore: the ball's centre, along
    /// the bore.
    pub axis: Axis,
    /// Radius, mm; of a cone at `axis.origin`; `None` for a plane.
    pub radius_mm: Option<f64>,
    /// Half angle of a cone, positive when it widens along `axis.direction`, radians.
    pub half_angle_rad: Option<f64>,
    /// Common area, mm²: accurate to a thousandth where outlines are lines and arcs, else to the tessellation's error on
    /// them. 0 for a ball in a bore.
    pub area_mm2: f64,
    /// Length of the touching circle of a ball in a bore, mm; else 0.
    pub length_mm: f64,
    /// Largest fit error of the surfaces recognised in splines, mm; 0 when all are analytic in the file.
    pub fit_mm: f64,
}

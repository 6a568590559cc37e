//! The content of a STEP file as plain values: no CAD-kernel type leaves this crate.
//!
//! Lengths are millimetres regardless of the file's unit, angles radians, frames right-handed and orthonormal. A [`Shape`] is in its own frame; a
//! [`Part`] places it in the assembly.

use glam::{DAffine3, DVec3};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A STEP file: distinct shapes, and the parts that place them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct CadModel {
    /// Name of the length unit in the file ("millimetre", "inch", …); lengths here are already mm.
    pub unit: String,
    /// Shapes, each listed once, regardless of the number of its placements.
    pub shapes: Vec<Shape>,
    /// Placed parts in file order: leaves of the assembly tree.
    pub parts: Vec<Part>,
    /// Irregularities and losses of the import, as text.
    pub warnings: Vec<String>,
    /// Files read: the requested one, then those it refers to.
    pub files: Vec<PathBuf>,
}

impl CadModel {
    /// Its bytes, for this version of the program only.
    pub fn to_bytes(&self) -> Option<Vec<u8>> {
        postcard::to_allocvec(self).ok()
    }

    /// The model with these bytes; `None` when they are no model's.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        postcard::from_bytes(bytes).ok()
    }
}

/// One placed part: a leaf of the assembly.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Part {
    /// Product name, made unique within the file by the reader if necessary.
    pub name: String,
    /// Names of the subassemblies above, outermost first.
    pub path: Vec<String>,
    /// Index into [`CadModel::shapes`].
    pub shape: usize,
    /// Shape frame to assembly frame: a rigid motion (a mirrored placement has its own shape).
    pub placement: DAffine3,
    /// Linear RGB in 0..1 if the file gives one.
    pub color: Option<[f32; 3]>,
}

/// Geometry of one shape, in its own frame.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Shape {
    /// B-rep faces; a face id is an index here.
    pub faces: Vec<Face>,
    /// B-rep edges.
    pub edges: Vec<Edge>,
    /// Tessellation, welded by topology.
    pub mesh: Mesh,
    /// Surfaces under the [`Surface::Spline`] faces, where the kernel could convert them.
    pub splines: Vec<SplineSurface>,
    /// Denser points of the edges that are [`Curve::Other`].
    pub curves: Vec<FineCurve>,
    /// Largest measured distance between the tessellation and the exact geometry, mm.
    pub deflection_mm: f64,
    /// Volume from the exact B-rep, mm³.
    pub volume_mm3: f64,
    /// Surface area from the exact B-rep, mm².
    pub area_mm2: f64,
    /// Centre of mass, mm.
    pub center_of_mass: DVec3,
    /// Inertia tensor about the centre of mass at unit density, mm⁵, row by row.
    pub inertia_mm5: [[f64; 3]; 3],
    /// Whether every mesh edge is used exactly twice, once in each direction.
    pub closed: bool,
    /// Mesh edges not used exactly twice (0 when closed).
    pub open_edges: usize,
}

/// A tensor-product (rational) B-spline surface under a face, trimmed to the face's parameter box (Piegl & Tiller, "The NURBS Book", 4.4):
/// S(u, v) = Σ Nᵢ(u) Nⱼ(v) wᵢⱼ Pᵢⱼ / Σ Nᵢ(u) Nⱼ(v) wᵢⱼ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplineSurface {
    /// Face it belongs to: an index into [`Shape::faces`].
    pub face: u32,
    /// Degree in u and in v.
    pub degrees: [u32; 2],
    /// Knots in u and in v, non-decreasing, each repeated by its multiplicity: poles + degree + 1 of them.
    pub knots: [Vec<f64>; 2],
    /// x, y, z (mm) and weight of each pole; v runs fastest.
    pub poles: Vec<[f64; 4]>,
    /// Largest distance measured from the face's own surface, mm: 0 for a spline, rounding for an extrusion or revolution, more for an offset.
    pub deviation_mm: f64,
}

/// Points along an edge that is neither line nor circle, dense enough that their chords are within [`EDGE_TOLERANCE_MM`] of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FineCurve {
    /// Edge it belongs to: an index into [`Shape::edges`].
    pub edge: u32,
    /// For each side of the edge's polyline the points strictly between its ends, mm.
    pub between: Vec<Vec<DVec3>>,
}

/// Accuracy with which [`FineCurve`] follows its edge, mm: a quarter of a micrometre, well below the micrometre required of distances.
pub const EDGE_TOLERANCE_MM: f64 = 2.5e-4;

/// A B-rep face.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Face {
    /// The exact surface it lies on, or one recognised in a spline (see `fit_mm`).
    pub surface: Surface,
    /// Largest distance measured between the file's spline and the `surface` recognised in it, mm; `None`: as written in the file.
    pub fit_mm: Option<f64>,
    /// Whether the face's outward normal is the reverse of the surface's natural normal.
    pub reversed: bool,
    /// Area, mm².
    pub area_mm2: f64,
    /// Bounding edges: indices into [`Shape::edges`].
    pub edges: Vec<u32>,
    /// Linear RGB in 0..1 if the file colours this face.
    pub color: Option<[f32; 3]>,
}

/// A right-handed orthonormal frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Origin, mm.
    pub origin: DVec3,
    /// Unit x axis.
    pub x: DVec3,
    /// Unit y axis (= z × x).
    pub y: DVec3,
    /// Unit z axis: the axis of a surface of revolution, the normal of a plane.
    pub z: DVec3,
}

/// The surface under a face. Natural normals point along +z (plane), away from the axis (cylinder, cone),
/// away from the centre (sphere) or from the tube's centre circle (torus).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Surface {
    /// The plane z = 0 of `frame`.
    Plane {
        /// Frame of the plane.
        frame: Frame,
    },
    /// Distance `radius` from the z axis.
    Cylinder {
        /// Axis along z.
        frame: Frame,
        /// Radius, mm.
        radius: f64,
    },
    /// Distance `radius + z·tan(half_angle)` from the z axis.
    Cone {
        /// Axis along z.
        frame: Frame,
        /// Radius at z = 0, mm.
        radius: f64,
        /// Half angle, rad, either sign.
        half_angle: f64,
    },
    /// Distance `radius` from the origin.
    Sphere {
        /// Centre at the origin.
        frame: Frame,
        /// Radius, mm.
        radius: f64,
    },
    /// A tube of radius `minor` about the circle of radius `major` in z = 0.
    Torus {
        /// Axis along z.
        frame: Frame,
        /// Major radius, mm.
        major: f64,
        /// Minor radius, mm.
        minor: f64,
    },
    /// Anything else: Bézier, B-spline, extrusion, revolution, offset.
    Spline,
}

impl Surface {
    /// Signed distance of `p` from the untrimmed surface, positive on the side of the natural normal, mm, and that unit normal at the foot of `p`.
    /// `None` for a spline, and where the normal is undefined (on an axis, at a centre).
    pub fn distance(&self, p: DVec3) -> Option<(f64, DVec3)> {
        let radial = |frame: &Frame| {
            let d = p - frame.origin;
            let across = d.reject_from_normalized(frame.z);
            Some((across.try_normalize()?, across.length(), d.dot(frame.z)))
        };
        Some(match self {
            Self::Plane { frame } => ((p - frame.origin).dot(frame.z), frame.z),
            Self::Cylinder { frame, radius } => {
                let (out, rho, _) = radial(frame)?;
                (rho - radius, out)
            }
            Self::Cone {
                frame,
                radius,
                half_angle,
            } => {
                let (out, rho, z) = radial(frame)?;
                let (sin, cos) = half_angle.sin_cos();
                ((rho - radius) * cos - z * sin, out * cos - frame.z * sin)
            }
            Self::Sphere { frame, radius } => {
                let d = p - frame.origin;
                (d.length() - radius, d.try_normalize()?)
            }
            Self::Torus { frame, major, minor } => {
                let (out, ..) = radial(frame)?;
                let tube = p - frame.origin - out * *major;
                (tube.length() - minor, tube.try_normalize()?)
            }
            Self::Spline => return None,
        })
    }
}

/// A B-rep edge.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Edge {
    /// The exact curve under it; a spline that is a line or circle within the recognition tolerance is given as that.
    pub curve: Curve,
    /// Length, mm.
    pub length_mm: f64,
    /// Adjacent faces (a seam lists its face twice).
    pub faces: Vec<u32>,
    /// Points along it, within the tessellation's tolerance, first to last.
    pub polyline: Vec<DVec3>,
}

/// The curve under an edge.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Curve {
    /// The line through `origin` along the unit vector `direction`.
    Line {
        /// Point on the line, mm.
        origin: DVec3,
        /// Unit vector.
        direction: DVec3,
    },
    /// A circle around the origin in z = 0 of `frame`.
    Circle {
        /// Axis along z.
        frame: Frame,
        /// Radius, mm.
        radius: f64,
    },
    /// Anything else.
    Other,
}

/// A triangle mesh whose vertices are shared wherever the B-rep shares them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Mesh {
    /// Positions, mm.
    pub vertices: Vec<DVec3>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Face id of each triangle.
    pub triangle_face: Vec<u32>,
}

//! What a STEP file holds, as plain values: no CAD-kernel type leaves this crate.
//!
//! Lengths are millimetres whatever the file's unit, angles radians, frames right-handed and
//! orthonormal. A [`Shape`] lives in its own frame; a [`Part`] places it in the assembly.

use glam::{DAffine3, DVec3};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A STEP file: distinct shapes, and the parts that place them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct CadModel {
    /// Name of the length unit in the file ("millimetre", "inch", …); lengths here are already mm.
    pub unit: String,
    /// Shapes, each once, however often it is placed.
    pub shapes: Vec<Shape>,
    /// Placed parts in file order: leaves of the assembly tree.
    pub parts: Vec<Part>,
    /// What the import noticed or lost, in words.
    pub warnings: Vec<String>,
    /// Files that were read: the one asked for, then those it refers to.
    pub files: Vec<PathBuf>,
}

/// One placed part: a leaf of the assembly.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Part {
    /// Product name, made unique within the file by the reader where it has to.
    pub name: String,
    /// Names of the subassemblies above, outermost first.
    pub path: Vec<String>,
    /// Index into [`CadModel::shapes`].
    pub shape: usize,
    /// Shape frame to assembly frame: a rigid motion (a mirrored placement gets a shape of its own).
    pub placement: DAffine3,
    /// Linear RGB in 0..1 where the file gives one.
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
    /// What lies under the faces that are [`Surface::Spline`], where the kernel could tell.
    pub splines: Vec<SplineSurface>,
    /// Finer points of the edges that are [`Curve::Other`].
    pub curves: Vec<FineCurve>,
    /// Largest distance measured between the tessellation and what it stands for, mm.
    pub deflection_mm: f64,
    /// Volume from the exact B-rep, mm³.
    pub volume_mm3: f64,
    /// Surface area from the exact B-rep, mm².
    pub area_mm2: f64,
    /// Centre of mass, mm.
    pub center_of_mass: DVec3,
    /// Inertia tensor about the centre of mass at unit density, mm⁵, row by row.
    pub inertia_mm5: [[f64; 3]; 3],
    /// Every mesh edge is used exactly twice, once each way.
    pub closed: bool,
    /// Mesh edges not used exactly twice (0 when closed).
    pub open_edges: usize,
}

/// A tensor-product (rational) B-spline surface under a face, cut to the face's box of parameters (Piegl & Tiller, "The NURBS Book", 4.4):
/// S(u, v) = Σ Nᵢ(u) Nⱼ(v) wᵢⱼ Pᵢⱼ / Σ Nᵢ(u) Nⱼ(v) wᵢⱼ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplineSurface {
    /// Face it belongs to: an index into [`Shape::faces`].
    pub face: u32,
    /// Degree in u and in v.
    pub degrees: [u32; 2],
    /// Knots in u and in v, not falling, each as often as its multiplicity: poles + degree + 1 of them.
    pub knots: [Vec<f64>; 2],
    /// x, y, z (mm) and weight of each pole; v runs fastest.
    pub poles: Vec<[f64; 4]>,
    /// Largest distance seen from the face's own surface, mm: 0 for a spline, rounding for an extrusion or revolution, more for an offset.
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

/// How closely [`FineCurve`] follows its edge, mm: a quarter of a micrometre, well below the micrometre asked of distances.
pub const EDGE_TOLERANCE_MM: f64 = 2.5e-4;

/// A B-rep face.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Face {
    /// The exact surface it lies on, or one recognised in a spline (see `fit_mm`).
    pub surface: Surface,
    /// Largest distance seen between the file's spline and `surface`, which was recognised in it, mm; `None`: as written.
    pub fit_mm: Option<f64>,
    /// The face's outward normal is the surface's natural normal turned round.
    pub reversed: bool,
    /// Area, mm².
    pub area_mm2: f64,
    /// Bounding edges: indices into [`Shape::edges`].
    pub edges: Vec<u32>,
    /// Linear RGB in 0..1 where the file colours this face.
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
    /// z = 0 of `frame`.
    Plane {
        /// Where.
        frame: Frame,
    },
    /// Distance `radius` from the z axis.
    Cylinder {
        /// Axis along z.
        frame: Frame,
        /// mm.
        radius: f64,
    },
    /// Distance `radius + z·tan(half_angle)` from the z axis.
    Cone {
        /// Axis along z.
        frame: Frame,
        /// Radius at z = 0, mm.
        radius: f64,
        /// Radians, either sign.
        half_angle: f64,
    },
    /// Distance `radius` from the origin.
    Sphere {
        /// Centre at the origin.
        frame: Frame,
        /// mm.
        radius: f64,
    },
    /// A tube of radius `minor` about the circle of radius `major` in z = 0.
    Torus {
        /// Axis along z.
        frame: Frame,
        /// mm.
        major: f64,
        /// mm.
        minor: f64,
    },
    /// Anything else: Bézier, B-spline, extrusion, revolution, offset.
    Spline,
}

impl Surface {
    /// Signed distance of `p` from the untrimmed surface, positive on the side of the natural normal, mm, and that unit normal
    /// at the point of the surface beside `p`. `None` for a spline, and where there is no such normal (on an axis, at a centre).
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
    /// The exact curve it lies on; a spline that is a line or circle to the tolerance of recognition is given as such.
    pub curve: Curve,
    /// mm.
    pub length_mm: f64,
    /// Faces that meet here (a seam names its face twice).
    pub faces: Vec<u32>,
    /// Points along it, within the tessellation's tolerance, first to last.
    pub polyline: Vec<DVec3>,
}

/// The curve under an edge.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Curve {
    /// Through `origin` along the unit vector `direction`.
    Line {
        /// mm.
        origin: DVec3,
        /// Unit vector.
        direction: DVec3,
    },
    /// In z = 0 of `frame`.
    Circle {
        /// Axis along z.
        frame: Frame,
        /// mm.
        radius: f64,
    },
    /// Anything else.
    Other,
}

/// A triangle mesh whose vertices are shared wherever the B-rep shares them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Mesh {
    /// mm.
    pub vertices: Vec<DVec3>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Face id of each triangle.
    pub triangle_face: Vec<u32>,
}

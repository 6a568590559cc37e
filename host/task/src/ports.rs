//! Ports of a part: places where another part can be connected (Jung, "Task-level assembly modeling in virtual environments", 2003, section 3).
//!
//! | port | from | capacity |
//! |---|---|---|
//! | extrusion, male or female | a merged cylinder: shaft or bore | interval along its axis |
//! | plane | a merged plane of some size | its area |
//! | point | a ball or socket | its centre |
//!
//! A bore is through when neither end of it is closed by its own part, else blind. A thread is a helical surface about the axis, or a part named as a screw,
//! bolt or nut. Profiles that are not round are not recognised as extrusions.

use std::fmt;

use glam::DVec3;
use mortise_brep::Surface;
use mortise_mating::Side;
use serde::Serialize;

use crate::assembly::Assembly;
use crate::graph::{extent, helical, is_threaded};

/// Least share of the part's area that a plane port has.
const PLANE_SHARE: f64 = 0.01;
/// Distance beyond a bore's end at which its part is sought, as a share of the radius, and least distance, mm.
const BEYOND: f64 = 0.2;
const BEYOND_MM: f64 = 0.05;

/// A port, in the assembly's frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Port {
    /// A shaft or bore.
    Extrusion {
        /// Shaft: "male"; bore: "female".
        sex: &'static str,
        /// Point on the axis, mm, from which the capacity counts.
        origin_mm: [f64; 3],
        /// Unit direction.
        axis: [f64; 3],
        /// Diameter, mm.
        diameter_mm: f64,
        /// Interval along the axis, mm.
        capacity_mm: [f64; 2],
        /// Of a bore: whether both ends are open. Of a shaft: `None`.
        through: Option<bool>,
        /// Whether it has a thread, by geometry or name.
        thread: bool,
        /// Angle of the surface around the axis that exists, degrees: 360 for a complete one.
        span_deg: f64,
    },
    /// A flat.
    Plane {
        /// A point of it, mm.
        point_mm: [f64; 3],
        /// Outward unit normal.
        normal: [f64; 3],
        /// Area, mm².
        area_mm2: f64,
    },
    /// A ball or socket.
    Point {
        /// Ball: "male"; socket: "female".
        sex: &'static str,
        /// Centre, mm.
        point_mm: [f64; 3],
        /// Diameter, mm.
        diameter_mm: f64,
    },
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Extrusion { sex, diameter_mm, capacity_mm: [low, high], through, thread, .. } => {
                let what = match (*sex, through) {
                    ("male", _) => "shaft",
                    (_, Some(true)) => "through bore",
                    _ => "blind bore",
                };
                write!(f, "{what} ⌀ {diameter_mm:.3} mm, {:.3} mm long{}", high - low, if *thread { ", thread" } else { "" })
            }
            Self::Plane { area_mm2, .. } => write!(f, "plane, {area_mm2:.1} mm²"),
            Self::Point { sex, diameter_mm, .. } => write!(f, "{} ⌀ {diameter_mm:.3} mm", if *sex == "male" { "ball" } else { "socket" }),
        }
    }
}

/// Ports of a part as placed, largest surface first. Cost: the angles and heights of the triangles of its cylinders, and some distance queries a bore.
pub fn ports(assembly: &Assembly, part: usize) -> Vec<Port> {
    let pose = assembly.placement(part);
    let area = assembly.body(part).surface().shape().area_mm2.max(1e-9);
    let thread = is_threaded(assembly.name(part)) || helical(assembly, part);
    let sex = |side: Side| if side == Side::Convex { "male" } else { "female" };
    (assembly.surfaces(part).iter())
        .filter_map(|m| match m.surface {
            Surface::Cylinder { frame, radius } => {
                let (origin, axis) = (pose.transform_point3(frame.origin), pose.transform_vector3(frame.z));
                let capacity = extent(assembly, part, &m.faces, origin, axis)?;
                Some(Port::Extrusion {
                    sex: sex(m.side),
                    origin_mm: origin.to_array(),
                    axis: axis.to_array(),
                    diameter_mm: 2.0 * radius,
                    capacity_mm: capacity,
                    through: (m.side == Side::Concave).then(|| through(assembly, part, origin, axis, radius, capacity)),
                    thread,
                    span_deg: span_deg(assembly, part, &m.faces, frame.origin, frame.z),
                })
            }
            Surface::Plane { frame } if m.area_mm2 >= PLANE_SHARE * area => Some(Port::Plane {
                point_mm: pose.transform_point3(frame.origin).to_array(),
                normal: pose.transform_vector3(frame.z).to_array(),
                area_mm2: m.area_mm2,
            }),
            Surface::Sphere { frame, radius } => Some(Port::Point {
                sex: sex(m.side),
                point_mm: pose.transform_point3(frame.origin).to_array(),
                diameter_mm: 2.0 * radius,
            }),
            _ => None,
        })
        .collect()
}

/// Whether the part has no material on the axis of a bore just beyond its ends.
fn through(assembly: &Assembly, part: usize, origin: DVec3, axis: DVec3, radius: f64, [low, high]: [f64; 2]) -> bool {
    let beyond = (BEYOND * radius).max(BEYOND_MM);
    let back = assembly.placement(part).inverse();
    [low - beyond, high + beyond].iter().all(|&t| {
        let p = back.transform_point3(origin + axis * t);
        assembly.body(part).surface().nearest(p).is_none_or(|n| n.distance > 0.0)
    })
}

/// Angle about an axis that some faces cover, degrees, to the accuracy of their triangles.
fn span_deg(assembly: &Assembly, part: usize, faces: &[u32], origin: DVec3, axis: DVec3) -> f64 {
    let shape = assembly.body(part).surface().shape();
    let x = axis.any_orthonormal_vector();
    let y = axis.cross(x);
    // Arcs of the triangles, as start and length.
    let mut arcs: Vec<[f64; 2]> = Vec::new();
    for (triangle, face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        if !faces.contains(face) {
            continue;
        }
        let angles = triangle.map(|v| {
            let d = shape.mesh.vertices[v as usize] - origin;
            d.dot(y).atan2(d.dot(x)).to_degrees()
        });
        let turn = |a: f64| (a - angles[0] + 540.0).rem_euclid(360.0) - 180.0;
        let (low, high) = angles.iter().map(|&a| turn(a)).fold((0.0f64, 0.0f64), |(l, h), t| (l.min(t), h.max(t)));
        arcs.push([(angles[0] + low).rem_euclid(360.0), high - low]);
    }
    arcs.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let Some(first) = arcs.first() else { return 0.0 };
    // Gaps between arcs around the circle, the first one after the last.
    let (mut end, mut gaps) = (first[0] + first[1], 0.0);
    for [start, length] in arcs.iter().skip(1).copied().chain([[first[0] + 360.0, 0.0]]) {
        if start > end + 1e-6 {
            gaps += start - end;
        }
        end = end.max(start + length);
    }
    (360.0 - gaps).clamp(0.0, 360.0)
}

//! Ports of a part: places where another part can be connected (Jung, "Task-level assembly modeling in virtual environments", 2003, section 3).
//!
//! | port | from | capacity |
//! |---|---|---|
//! | extrusion, male or female | a merged cylinder: shaft or bore; a profile of any other form | interval along its axis |
//! | taper, male or female | a merged cone | interval along its axis |
//! | plane | a merged plane of some size | its region |
//! | point | a ball or socket | its centre |
//!
//! A hole is through when neither end of it is closed by its own part, else blind. A thread is a helical surface about the axis, or a part that the catalogue, or
//! its name, states to be a screw, bolt or nut. The kind of a port is the most special one of the taxonomy ([`crate::taxonomy`]).

use std::collections::{HashMap, HashSet};
use std::fmt;

use glam::{DAffine3, DVec3};
use mortise_brep::{Frame, Surface};
use mortise_mating::{MergedSurface, Side};
use serde::Serialize;

use crate::assembly::Assembly;
use crate::fits::{extent, is_through, is_through_profile, stretches};
use crate::profile::Profile;
use crate::taxonomy::{Facts, PortKind, kinds};
use crate::threads::{helical, is_threaded};

/// Least share of the part's area that a plane port has.
const PLANE_SHARE: f64 = 0.01;
/// Share by which sides of a regular profile differ: its file's rounding.
const REGULAR: f64 = 1e-3;

/// A port, in the assembly's frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Port {
    /// Its place and size.
    #[serde(flatten)]
    pub geometry: Geometry,
    /// Its most special kind, and the more general ones after it.
    pub is: Vec<&'static str>,
    /// Its kind in words.
    #[serde(skip)]
    words: &'static str,
}

/// Place and size of a port, in the assembly's frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Geometry {
    /// A shaft or hole, round or of another form.
    Extrusion {
        /// Shaft: "male"; hole: "female".
        sex: &'static str,
        /// Point on the axis, mm, from which the capacity counts; of a profile the centre of its area.
        origin_mm: [f64; 3],
        /// Unit direction.
        axis: [f64; 3],
        /// Diameter, or that of the circle about the profile, mm.
        diameter_mm: f64,
        /// Interval along the axis, mm.
        capacity_mm: [f64; 2],
        /// Of a hole: whether both ends are open. Of a shaft: `None`.
        through: Option<bool>,
        /// Whether it has a thread, by geometry, catalogue or name.
        thread: bool,
        /// Angle of the surface around the axis that exists, degrees: 360 for a complete one.
        span_deg: f64,
        /// Number of flats and of other faces of a profile; `None`: it is round.
        profile: Option<[usize; 2]>,
    },
    /// A conical shaft or hole.
    Taper {
        /// Taper: "male"; tapered hole: "female".
        sex: &'static str,
        /// Point on the axis, mm, from which the capacity counts.
        origin_mm: [f64; 3],
        /// Unit direction.
        axis: [f64; 3],
        /// Angle of the surface to the axis, degrees.
        half_angle_deg: f64,
        /// Diameters at the ends of the capacity, mm.
        diameters_mm: [f64; 2],
        /// Interval along the axis, mm.
        capacity_mm: [f64; 2],
    },
    /// A flat.
    Plane {
        /// A point of it, mm.
        point_mm: [f64; 3],
        /// Outward unit normal.
        normal: [f64; 3],
        /// Area, mm².
        area_mm2: f64,
        /// Its region: the closed lines around it, outer ones and those of holes, to the accuracy of the triangles.
        region_mm: Vec<Vec<[f64; 3]>>,
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
        write!(f, "{}", self.words)?;
        match &self.geometry {
            Geometry::Extrusion {
                diameter_mm,
                capacity_mm: [low, high],
                profile,
                ..
            } => {
                let within = if profile.is_some() { "within " } else { "" };
                write!(f, " {within}⌀ {diameter_mm:.3} mm, {:.3} mm long", high - low)
            }
            Geometry::Taper {
                half_angle_deg,
                diameters_mm: [a, b],
                ..
            } => write!(f, " ⌀ {a:.3} to {b:.3} mm, {half_angle_deg:.2}° to its axis"),
            Geometry::Plane { area_mm2, .. } => write!(f, ", {area_mm2:.1} mm²"),
            Geometry::Point { diameter_mm, .. } => write!(f, " ⌀ {diameter_mm:.3} mm"),
        }
    }
}

/// Ports of a part as placed: largest surface first, then profiles. Cost: the angles and heights of the triangles of its cylinders, its profiles, and some distance
/// queries a hole.
pub fn ports(assembly: &Assembly, part: usize) -> Vec<Port> {
    let thread = is_threaded(assembly, part) || helical(assembly, part);
    let surfaces = (assembly.surfaces(part).iter()).flat_map(|m| of_surface(assembly, part, m, thread));
    let profiles = (assembly.profiles(part).iter()).map(|profile| of_profile(assembly, part, profile));
    surfaces.chain(profiles).collect()
}

fn port(geometry: Geometry, facts: &Facts) -> Port {
    let line: Vec<&'static PortKind> = kinds().of_port(facts);
    Port {
        geometry,
        words: line.first().map_or("port", |kind| kind.words.as_str()),
        is: line.into_iter().map(|kind| kind.name.as_str()).collect(),
    }
}

fn of_surface(assembly: &Assembly, part: usize, merged: &MergedSurface, thread: bool) -> Vec<Port> {
    let (Surface::Cylinder { frame, .. } | Surface::Cone { frame, .. }) = merged.surface else {
        return of_faces(assembly, part, merged, thread).into_iter().collect();
    };
    // A shaft that a groove or a collar interrupts is two.
    let (origin, axis) = placed(assembly.placement(part), frame);
    (stretches(assembly, part, &merged.faces, origin, axis).into_iter())
        .filter_map(|faces| {
            let merged = MergedSurface {
                faces,
                ..merged.clone()
            };
            of_faces(assembly, part, &merged, thread)
        })
        .collect()
}

fn of_faces(assembly: &Assembly, part: usize, merged: &MergedSurface, thread: bool) -> Option<Port> {
    let pose = assembly.placement(part);
    let sex = if merged.side == Side::Convex {
        "male"
    } else {
        "female"
    };
    let facts = Facts {
        surface: "plane",
        sex: Some(sex),
        through: None,
        thread: false,
        span_deg: 360.0,
        sides: [0, 0],
        regular: false,
        slender: 0.0,
    };
    match merged.surface {
        Surface::Cylinder { frame, radius } => {
            let (origin, axis) = placed(pose, frame);
            let capacity_mm = extent(assembly, part, &merged.faces, origin, axis)?;
            let through = (merged.side == Side::Concave)
                .then(|| is_through(assembly, part, origin, axis, radius, capacity_mm));
            let span_deg = span_deg(assembly, part, &merged.faces, frame.origin, frame.z);
            let geometry = Geometry::Extrusion {
                sex,
                origin_mm: origin.to_array(),
                axis: axis.to_array(),
                diameter_mm: 2.0 * radius,
                capacity_mm,
                through,
                thread,
                span_deg,
                profile: None,
            };
            let facts = Facts {
                surface: "cylinder",
                through,
                thread,
                span_deg,
                slender: (capacity_mm[1] - capacity_mm[0]) / (2.0 * radius),
                ..facts
            };
            Some(port(geometry, &facts))
        }
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } => {
            let (origin, axis) = placed(pose, frame);
            let capacity_mm = extent(assembly, part, &merged.faces, origin, axis)?;
            let geometry = Geometry::Taper {
                sex,
                origin_mm: origin.to_array(),
                axis: axis.to_array(),
                half_angle_deg: half_angle.abs().to_degrees(),
                diameters_mm: capacity_mm.map(|t| (2.0 * (radius + t * half_angle.tan())).max(0.0)),
                capacity_mm,
            };
            let surface = "cone";
            Some(port(geometry, &Facts { surface, ..facts }))
        }
        Surface::Plane { frame } => {
            let area = assembly.body(part).surface().shape().area_mm2.max(1e-9);
            let geometry = Geometry::Plane {
                point_mm: pose.transform_point3(frame.origin).to_array(),
                normal: pose.transform_vector3(frame.z).to_array(),
                area_mm2: merged.area_mm2,
                region_mm: region(assembly, part, &merged.faces),
            };
            let is_large = merged.area_mm2 >= PLANE_SHARE * area;
            is_large.then(|| port(geometry, &Facts { sex: None, ..facts }))
        }
        Surface::Sphere { frame, radius } => {
            let geometry = Geometry::Point {
                sex,
                point_mm: pose.transform_point3(frame.origin).to_array(),
                diameter_mm: 2.0 * radius,
            };
            let surface = "sphere";
            Some(port(geometry, &Facts { surface, ..facts }))
        }
        _ => None,
    }
}

fn of_profile(assembly: &Assembly, part: usize, profile: &Profile) -> Port {
    let pose = assembly.placement(part);
    let (origin, axis) = (
        pose.transform_point3(profile.origin),
        pose.transform_vector3(profile.axis),
    );
    let [low, high] = profile.capacity_mm;
    let through = (!profile.is_male).then(|| is_through_profile(assembly, part, profile));
    let sex = if profile.is_male { "male" } else { "female" };
    let geometry = Geometry::Extrusion {
        sex,
        origin_mm: origin.to_array(),
        axis: axis.to_array(),
        diameter_mm: profile.diameter_mm(),
        capacity_mm: profile.capacity_mm,
        through,
        thread: false,
        span_deg: 360.0,
        profile: Some(profile.sides),
    };
    let facts = Facts {
        surface: "profile",
        sex: Some(sex),
        through,
        thread: false,
        span_deg: 360.0,
        sides: profile.sides,
        regular: profile.is_regular(REGULAR),
        slender: (high - low) / profile.diameter_mm().max(1e-9),
    };
    port(geometry, &facts)
}

fn placed(pose: DAffine3, frame: Frame) -> (DVec3, DVec3) {
    (
        pose.transform_point3(frame.origin),
        pose.transform_vector3(frame.z),
    )
}

/// Closed lines around some faces: edges of their triangles that only one of them has.
fn region(assembly: &Assembly, part: usize, faces: &[u32]) -> Vec<Vec<[f64; 3]>> {
    let (mesh, pose) = (
        &assembly.body(part).surface().shape().mesh,
        assembly.placement(part),
    );
    let mut open: HashSet<[u32; 2]> = HashSet::new();
    for (triangle, face) in mesh.triangles.iter().zip(&mesh.triangle_face) {
        if !faces.contains(face) {
            continue;
        }
        for i in 0..3 {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            if !open.remove(&[b, a]) {
                open.insert([a, b]);
            }
        }
    }
    let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
    let mut edges: Vec<[u32; 2]> = open.into_iter().collect();
    edges.sort_unstable();
    for [a, b] in &edges {
        next.entry(*a).or_default().push(*b);
    }
    let mut lines = Vec::new();
    for [first, _] in edges {
        let (mut at, mut line) = (first, Vec::new());
        while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
            line.push(pose.transform_point3(mesh.vertices[at as usize]).to_array());
            at = to;
        }
        if line.len() > 2 {
            lines.push(line);
        }
    }
    lines
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
        let (low, high) = angles
            .iter()
            .map(|&a| turn(a))
            .fold((0.0f64, 0.0f64), |(l, h), t| (l.min(t), h.max(t)));
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

//! The connection graph: parts as nodes, and for each pair that touches or fits an edge with what connects them.
//!
//! A connection is read from geometry: contacts ([`mortise_mating::identify`]) and fits, a shaft in a bore with a small difference of radii whose faces lie
//! side by side without touching. Its kind follows from the clearance's sign and from threads; what no geometry states (welded, glued) is not guessed.

use std::collections::HashMap;

use glam::DVec3;
use mortise_brep::Surface;
use mortise_mating::{ContactKind, Side};
use petgraph::graph::{NodeIndex, UnGraph};
use serde::Serialize;

use crate::assembly::Assembly;

/// Largest clearance of a fit: on the radius, mm.
pub const FIT_MM: f64 = 0.5;
/// Largest overlap on the radius of a press fit, mm.
const PRESS_MM: f64 = 0.2;
/// Least overlap of a pressed pair, mm: above the distance of a contact.
const PRESSED_MM: f64 = 1e-3;
/// Angle between, and share of the clearance beside which the axes of a fit are one.
const COAXIAL_RAD: f64 = 2e-3;
/// Least common length of a fit, mm.
const COMMON_MM: f64 = 0.2;

/// What connects two parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Connection {
    /// Shaft in bore with clearance, or without and without overlap: one turn and one slide are free.
    Inserted,
    /// Shaft in bore with overlap.
    Pressed,
    /// A shaft named as a screw, bolt or nut in the bore of another part, or helical surfaces on both.
    Screwed,
    /// Taper in taper.
    Seated,
    /// Ball in socket or bore.
    Ball,
    /// Plane on plane.
    Resting,
}

/// A shaft in a bore.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Part with the shaft and part with the bore.
    pub parts: [usize; 2],
    /// Their merged surfaces ([`Assembly::surfaces`]).
    pub surfaces: [usize; 2],
    /// Middle of the common length on the axis, mm, in the assembly's frame.
    pub center: DVec3,
    /// Unit direction of the axis.
    pub axis: DVec3,
    /// Radius of the shaft, mm.
    pub radius_mm: f64,
    /// Radius of the bore less that of the shaft, mm.
    pub clearance_mm: f64,
    /// Common length, mm.
    pub length_mm: f64,
}

/// An edge of the graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Parts, ascending.
    pub parts: [usize; 2],
    /// Kinds of connection, strongest first.
    pub kinds: Vec<Connection>,
    /// Indices into [`Assembly::contacts`].
    pub contacts: Vec<usize>,
    /// Shafts in bores.
    pub fits: Vec<Fit>,
}

/// The graph of an assembly; nodes carry the part's index.
///
/// Cost: a comparison of each shaft with each bore of other parts, and the triangles of the parts of those that share an axis.
pub fn graph(assembly: &Assembly) -> UnGraph<usize, Edge> {
    let count = assembly.count();
    let mut graph = UnGraph::new_undirected();
    let nodes: Vec<NodeIndex> = (0..count).map(|p| graph.add_node(p)).collect();
    let rounds: Vec<Rounds> = (0..count).map(|p| Rounds::of(assembly, p)).collect();
    let mut contacts: HashMap<[usize; 2], Vec<usize>> = HashMap::new();
    for (i, contact) in assembly.contacts.iter().enumerate() {
        contacts.entry(contact.parts).or_default().push(i);
    }
    for a in 0..count {
        for b in a + 1..count {
            let contacts = contacts.remove(&[a, b]).unwrap_or_default();
            let fits = [
                fits(assembly, &rounds[a], &rounds[b]),
                fits(assembly, &rounds[b], &rounds[a]),
            ]
            .concat();
            if let Some(edge) = edge(assembly, [a, b], contacts, fits) {
                graph.add_edge(nodes[a], nodes[b], edge);
            }
        }
    }
    graph
}

fn edge(assembly: &Assembly, [a, b]: [usize; 2], contacts: Vec<usize>, fits: Vec<Fit>) -> Option<Edge> {
    let pressed = assembly.pressed_mm(a, b) > PRESSED_MM;
    if contacts.is_empty() && fits.is_empty() && !pressed {
        return None;
    }
    let threaded = [a, b].map(|p| is_threaded(assembly.name(p)));
    let mut kinds: Vec<Connection> = Vec::new();
    for fit in &fits {
        kinds.push(if fit.clearance_mm < -PRESSED_MM {
            Connection::Pressed
        } else {
            Connection::Inserted
        });
    }
    // A thread holds only in the last part that its shaft meets; geometry of plain pins cannot tell which, so every bore of a named screw counts.
    if (threaded[0] != threaded[1] && !fits.is_empty())
        || fits
            .iter()
            .any(|f| helical(assembly, f.parts[0]) && helical(assembly, f.parts[1]))
    {
        kinds.push(Connection::Screwed);
    }
    if pressed && fits.iter().any(|f| f.clearance_mm <= 0.0) {
        kinds.push(Connection::Pressed);
    }
    kinds.extend(contacts.iter().map(|&i| match assembly.contacts[i].kind {
        ContactKind::Planar => Connection::Resting,
        ContactKind::Conical => Connection::Seated,
        ContactKind::Spherical | ContactKind::Annular => Connection::Ball,
        ContactKind::Cylindrical => Connection::Inserted,
    }));
    let strength = |kind: &Connection| match kind {
        Connection::Screwed => 0,
        Connection::Pressed => 1,
        Connection::Inserted => 2,
        Connection::Seated => 3,
        Connection::Ball => 4,
        Connection::Resting => 5,
    };
    kinds.sort_by_key(strength);
    kinds.dedup();
    Some(Edge {
        parts: [a, b],
        kinds,
        contacts,
        fits,
    })
}

/// Words in the name of a part that has a thread which the model leaves out.
const THREADED: [&str; 8] = [
    "screw", "bolt", "nut", "stud", "schraube", "mutter", "threaded", "gewinde",
];

/// Whether a part's name says that it has a thread.
pub fn is_threaded(name: &str) -> bool {
    let lower = name.to_lowercase();
    lower
        .split(|c: char| !c.is_alphabetic())
        .any(|word| THREADED.iter().any(|t| word.trim_end_matches('s') == *t))
}

/// Whether a part has free-form faces that coil about one of its cylinders' axes: a modelled thread.
pub fn helical(assembly: &Assembly, part: usize) -> bool {
    let shape = assembly.body(part).surface().shape();
    let mesh = &shape.mesh;
    shape
        .faces
        .iter()
        .enumerate()
        .filter(|(_, f)| f.surface == Surface::Spline)
        .any(|(id, _)| {
            let points: Vec<DVec3> = (mesh.triangles.iter().zip(&mesh.triangle_face))
                .filter(|(_, face)| **face as usize == id)
                .flat_map(|(t, _)| t.map(|v| mesh.vertices[v as usize]))
                .collect();
            assembly.surfaces(part).iter().any(|m| match m.surface {
                Surface::Cylinder { frame, .. } => crate::helix::winds(&points, frame.origin, frame.z),
                _ => false,
            })
        })
}

/// A merged cylinder of a part, in the assembly's frame.
struct Round {
    /// Its place in [`Assembly::surfaces`].
    surface: usize,
    radius: f64,
    origin: DVec3,
    axis: DVec3,
}

/// The shafts and bores of a part.
struct Rounds {
    part: usize,
    shafts: Vec<Round>,
    bores: Vec<Round>,
}

impl Rounds {
    fn of(assembly: &Assembly, part: usize) -> Self {
        let place = assembly.placement(part);
        let mut found = Self {
            part,
            shafts: Vec::new(),
            bores: Vec::new(),
        };
        for (surface, merged) in assembly.surfaces(part).iter().enumerate() {
            let Surface::Cylinder { frame, radius } = merged.surface else {
                continue;
            };
            let round = Round {
                surface,
                radius,
                origin: place.transform_point3(frame.origin),
                axis: place.transform_vector3(frame.z),
            };
            match merged.side {
                Side::Convex => found.shafts.push(round),
                Side::Concave => found.bores.push(round),
                Side::Flat => {}
            }
        }
        found
    }
}

/// Shafts of `a` in bores of `b`.
fn fits(assembly: &Assembly, a: &Rounds, b: &Rounds) -> Vec<Fit> {
    let mut found = Vec::new();
    for shaft in &a.shafts {
        for bore in &b.bores {
            let clearance = bore.radius - shaft.radius;
            if !(-PRESS_MM..=FIT_MM).contains(&clearance) {
                continue;
            }
            let (o, z) = (shaft.origin, shaft.axis);
            let apart = (bore.origin - o).reject_from_normalized(z).length();
            if z.cross(bore.axis).length() > COAXIAL_RAD || apart > clearance.abs() + 1e-3 {
                continue;
            }
            let along = |rounds: &Rounds, round: &Round| {
                let faces = &assembly.surfaces(rounds.part)[round.surface].faces;
                extent(assembly, rounds.part, faces, o, z)
            };
            let (Some(s), Some(t)) = (along(a, shaft), along(b, bore)) else {
                continue;
            };
            let (low, high) = (s[0].max(t[0]), s[1].min(t[1]));
            if high - low > COMMON_MM {
                let center = o + z * ((low + high) / 2.0);
                found.push(Fit {
                    parts: [a.part, b.part],
                    surfaces: [shaft.surface, bore.surface],
                    center,
                    axis: z,
                    radius_mm: shaft.radius,
                    clearance_mm: clearance,
                    length_mm: high - low,
                });
            }
        }
    }
    found
}

/// Interval of some faces of a part along an axis in the assembly's frame, mm from `origin`.
pub(crate) fn extent(
    assembly: &Assembly,
    part: usize,
    faces: &[u32],
    origin: DVec3,
    axis: DVec3,
) -> Option<[f64; 2]> {
    let shape = assembly.body(part).surface().shape();
    let place = assembly.placement(part);
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for (triangle, face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        if faces.contains(face) {
            for &v in triangle {
                let t = (place.transform_point3(shape.mesh.vertices[v as usize]) - origin).dot(axis);
                range = [range[0].min(t), range[1].max(t)];
            }
        }
    }
    (range[0] < range[1]).then_some(range)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_threaded_parts() {
        for name in ["screw_1", "M6 Bolt", "flange/nuts", "Schraube 3"] {
            assert!(is_threaded(name), "{name}");
        }
        for name in ["minute", "nutshell", "rod", "bolted plate", "donut"] {
            assert!(!is_threaded(name), "{name}");
        }
    }
}

//! The pointshell: samples of the exact surface, as dense as an error bound requires.
//!
//! The points of a shape query its partner's field and the partner's points query the shape's, so a place needs a sample only where no sample of a
//! partner would find it. With ε the bound and κ' the curvature of the partners (see [`crate::partners`]):
//!
//! | where | spacing |
//! |---|---|
//! | inside planes, concave faces, along concave edges | none |
//! | inside faces convex in some direction | √(4ε/(κᵢ + κ')) in each principal direction i; none where κᵢ + κ' ≤ 0 |
//! | along sharp convex edges | spans, on which the tick finds the deepest place, see [`crate::edge_spans`]; points as below where they are fewer |
//! | along other convex edges, straight or curved | √(8ε/(κ + κ')), κ the edge's own curvature away from the touching partner |
//! | on shafts that fit a bore, beside their rims | a ring, see [`crate::ring_samples`] |
//!
//! The two directions of a face share ε; an edge uses all of it. Inside faces that are not convex in both directions, mainly cylinders, samples serve
//! only contact between convex faces away from every edge, and there are many of them: they can have a separate bound. So a cylinder that only flats
//! and bores can meet has its two rims, a ring beside each, and nothing between; the error of a peg's rim in its hole is s²/8 times the *difference*
//! of the two curvatures, and on a flat at tilt α it is ε·sin α.
//!
//! No such bound holds where two sharp edges cross: a sample s/2 from the crossing is up to (s/2)·sin(θ/2) less deep, where θ is the angle between
//! the edge and the partner's face it passes under. Contact there is found from the edges themselves ([`crate::edges`]) but for edges nearly
//! parallel, for which edges are never sampled more sparsely than `max_spacing_mm`.

use mortise_protocol::image::NO_FACE;

use crate::distance::ExactSurface;
use crate::grid::bounding_box;
use crate::partners::Partners;
use crate::shell::{Pointshell, PointshellOptions, ShellPoint};

/// Fewest points of a useful shell: with fewer, the shape is sampled without relying on partners.
const FEWEST: usize = 8;

/// Samples `surface`. Spline faces are sampled on their tessellation, by their own curvature alone. Cost: proportional to area over spacing².
pub fn sample_pointshell(surface: &ExactSurface, options: &PointshellOptions) -> Pointshell {
    let (low, high) = bounding_box(surface.shape());
    let tenth = ((high - low).max_element() / 10.0).max(1e-3);
    let shell = sample(surface, options, tenth);
    if shell.points.len() >= FEWEST || options.partners == Partners::Unknown {
        return shell;
    }
    let alone = PointshellOptions {
        max_spacing_mm: options.max_spacing_mm.min(tenth),
        partners: Partners::Unknown,
        ..options.clone()
    };
    sample(surface, &alone, tenth)
}

/// `flat_mm`: largest spacing inside spline faces of which the partners are known.
fn sample(surface: &ExactSurface, options: &PointshellOptions, flat_mm: f64) -> Pointshell {
    let mut points = Vec::new();
    for face in 0..surface.shape().faces.len() as u32 {
        crate::face_samples::sample_face(surface, face, options, flat_mm, &mut points);
    }
    let face_points = points.len();
    let corners = crate::edge_samples::sample_edges(surface, options, &mut points);
    let edge_points = points.len() - face_points;
    for vertex in corners {
        points.extend(corner_point(surface, vertex));
    }
    let corner_points = points.len() - face_points - edge_points;
    Pointshell {
        points,
        offsets: Vec::new(),
        face_points,
        edge_points,
        corner_points,
    }
}

fn corner_point(surface: &ExactSurface, vertex: u32) -> Option<ShellPoint> {
    let topology = &surface.topology;
    let mut faces: Vec<u32> = topology
        .vertex_pieces
        .get(&vertex)?
        .iter()
        .flat_map(|&i| topology.pieces[i as usize].sides.iter().map(|s| s.face))
        .collect();
    faces.sort_unstable();
    faces.dedup();
    Some(ShellPoint {
        position: surface.shape().mesh.vertices[vertex as usize],
        normal: topology.vertex_normals[vertex as usize].try_normalize()?,
        face: *faces.first()? as u16,
        edge_face: faces.get(1).map_or(NO_FACE, |&f| f as u16),
        span: None,
    })
}

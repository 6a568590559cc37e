//! The pointshell: samples of the exact surface, as dense as an error bound asks.
//!
//! Between two samples s apart on a curve of radius R the surface rises at most s²/(8R) above the chord; spacing s = √(8Rε) keeps that below
//! ε. Straight generators and planes have no such error: there the spacing is only limited so that a small boss pressed on a large flat is
//! felt. Edges are sampled by their own curvature and carry both faces; their ends are sampled once.

use glam::DVec3;
use mortise_protocol::image::NO_FACE;

use crate::distance::ExactSurface;

/// How dense a pointshell is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointshellOptions {
    /// Bound on the chord error between neighbouring points, mm.
    pub epsilon_mm: f64,
    /// Largest spacing anywhere, mm.
    pub max_spacing_mm: f64,
}

impl PointshellOptions {
    /// Spacing along a direction of curvature `curvature` (1/mm), mm.
    pub(crate) fn spacing(&self, curvature: f64) -> f64 {
        (8.0 * self.epsilon_mm / curvature.abs().max(1e-12))
            .sqrt()
            .min(self.max_spacing_mm)
    }
}

/// A sample of the exact surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShellPoint {
    /// mm, shape frame.
    pub position: DVec3,
    /// Outward unit normal; on an edge or corner the mean of its faces' normals.
    pub normal: DVec3,
    /// Face it lies on.
    pub face: u16,
    /// The other face on an edge or corner, else [`NO_FACE`].
    pub edge_face: u16,
}

/// Points of a shape, those of faces before those of edges before those of corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pointshell {
    /// The points.
    pub points: Vec<ShellPoint>,
    /// Of them inside faces.
    pub face_points: usize,
    /// Of them along edges.
    pub edge_points: usize,
    /// Of them at corners.
    pub corner_points: usize,
}

/// Samples `surface`. Spline faces are sampled on their tessellation. Cost: grows with area over spacing².
pub fn sample_pointshell(surface: &ExactSurface, options: &PointshellOptions) -> Pointshell {
    let mut points = Vec::new();
    for face in 0..surface.shape().faces.len() as u32 {
        crate::face_samples::sample_face(surface, face, options, &mut points);
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
    })
}

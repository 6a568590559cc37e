//! Pieces and spans of sharp convex edges.

use bytemuck::{Pod, Zeroable};

/// A piece of a sharp convex edge: the quadratic curve p(t) = `center` + t·`half` + t²·`bend`, −1 ≤ t ≤ 1, within half a micrometre of the exact edge.
/// Consecutive pieces of an edge share their ends.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct EdgeRecord {
    /// Its middle, m, shape frame.
    pub center: [f32; 3],
    /// Derivative at the middle: half of the chord, m.
    pub half: [f32; 3],
    /// Half of the second derivative, m; zero for a straight piece.
    pub bend: [f32; 3],
    /// Outward unit normals of the two faces at the middle, octahedral (see [`super::oct_decode`]).
    pub normals: [[i16; 2]; 2],
    /// The two faces, counted from the shape's first face; equal where a face meets itself.
    pub faces: [u16; 2],
    /// Thickness of the solid behind the edge, m: twice the radius of the largest sphere found that lies inside and touches both faces.
    pub thickness: f32,
    /// Number of the edge within the shape: equal for all pieces of one edge.
    pub edge: u32,
    /// Radius of a sphere about `center` that contains the piece, m.
    pub radius: f32,
}

impl EdgeRecord {
    /// Whether the piece is straight.
    #[inline]
    pub fn is_straight(&self) -> bool {
        self.bend == [0.0; 3]
    }
}

/// [`super::PointRecord::span`] of a point that stands for itself alone.
pub const NO_SPAN: u16 = u16::MAX;

/// A stretch of a sharp convex edge about a point m: x(u) = m + a·u + b·u²·(1 − k·(1 − u²)) for −1 ≤ u ≤ 1.
///
/// With k = |b|²/|a|² it follows a circle's arc of half angle θ and radius r within r·θ⁶/320.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SpanRecord {
    /// a, m, shape frame.
    pub along: [f32; 3],
    /// b, m.
    pub bend: [f32; 3],
    /// k, from 0 to 1.
    pub round: f32,
}

//! Pieces of sharp convex edges.

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

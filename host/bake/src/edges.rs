//! Pieces of sharp convex edges, for contact of edges with edges: each a quadratic curve within [`TOLERANCE_MM`] of the exact edge.
//!
//! A chain of boundary pieces is divided until a quadratic fits and the tangent turns little ([`crate::stretch`]). The number of pieces depends on the
//! curve alone: one for a straight edge, 16 for a circle of 10 mm.

use glam::DVec3;
use mortise_protocol::image::EdgeRecord;
use mortise_protocol::image::oct_encode;

use crate::chains::edge_chains;
use crate::distance::{ExactSurface, Scratch};
use crate::piece::Piece;
use crate::stretch::{Chain, Curve, Fineness};
use crate::tree::round_up;

/// As fine as the exact edges are known.
pub(crate) const FINEST: Fineness = Fineness {
    tolerance_mm: TOLERANCE_MM,
    most_turn: MOST_TURN,
};

/// Half as many pieces: the error grows with the fourth power of their length.
pub(crate) fn coarser(fineness: Fineness) -> Fineness {
    Fineness {
        tolerance_mm: 16.0 * fineness.tolerance_mm,
        most_turn: 2.0 * fineness.most_turn,
    }
}

/// Largest distance of a piece from the exact edge, mm, across its direction. Twice the tolerance of edges that are neither lines nor circles.
const TOLERANCE_MM: f64 = 2.0 * mortise_brep::EDGE_TOLERANCE_MM;
/// Largest angle by which a piece's tangent turns from its middle to an end, rad.
const MOST_TURN: f64 = 0.2;
/// Faces whose normals differ by a smaller angle (rad) meet smoothly: ten times the error that modellers and STEP files leave.
const SMOOTH: f64 = 0.01;
/// Pieces of an edge at which the thickness is measured.
const THICKNESS_PIECES: usize = 5;
/// Ratio of consecutive depths at which the thickness is measured, and their number: 1.25⁻⁴⁰ is a ten-thousandth.
const DEPTH_RATIO: f64 = 1.25;
const DEPTHS: i32 = 40;

/// A piece of an edge, mm.
pub(crate) struct EdgePiece {
    center: DVec3,
    half: DVec3,
    bend: DVec3,
    normals: [DVec3; 2],
    faces: [u32; 2],
    thickness: f64,
    edge: u32,
}

impl EdgePiece {
    /// Points whose convex hull contains the piece, m: its ends and its middle control point.
    pub fn hull(&self) -> [[f32; 3]; 3] {
        [
            self.center - self.half + self.bend,
            self.center - self.bend,
            self.center + self.half + self.bend,
        ]
        .map(meters)
    }

    /// Largest coordinate of its points along `n`, mm.
    pub fn support(&self, n: DVec3) -> f64 {
        let [center, half, bend] = [self.center, self.half, self.bend].map(|v| v.dot(n));
        if bend < 0.0 && half.abs() < -2.0 * bend {
            center - half * half / (4.0 * bend)
        } else {
            center + half.abs() + bend
        }
    }

    /// The piece as stored.
    pub fn record(&self) -> EdgeRecord {
        EdgeRecord {
            center: meters(self.center),
            half: meters(self.half),
            bend: meters(self.bend),
            normals: self.normals.map(|n| oct_encode(n.as_vec3().to_array())),
            faces: self.faces.map(|face| face as u16),
            thickness: round_up(self.thickness / 1000.0),
            edge: self.edge,
            radius: round_up((self.half.length() + self.bend.length()) / 1000.0),
        }
    }
}

fn meters(mm: DVec3) -> [f32; 3] {
    (mm / 1000.0).as_vec3().to_array()
}

/// The sharp convex edges of a shape, in pieces. Borders of open shells, and edges of more than two faces, are left out.
pub(crate) fn edge_pieces(surface: &ExactSurface, fineness: Fineness) -> Vec<EdgePiece> {
    let mut all = Vec::new();
    for (edge, links) in edge_chains(surface).into_iter().enumerate() {
        let chain = Chain::new(&surface.topology.pieces, &links);
        let first = all.len();
        for stretch in chain.stretches(Curve::Parabola, fineness) {
            if let Some((normals, faces)) = sharp(surface, chain.piece(&stretch), stretch.middle) {
                all.push(EdgePiece {
                    center: stretch.middle,
                    half: stretch.along,
                    bend: stretch.bend,
                    normals,
                    faces,
                    thickness: 0.0,
                    edge: edge as u32,
                });
            }
        }
        let thickness = thickness(surface, &all[first..]);
        for piece in &mut all[first..] {
            piece.thickness = thickness;
        }
    }
    all
}

/// Outward normals and numbers of the two faces that meet at a point of a boundary piece, if they form a sharp convex edge.
pub(crate) fn sharp(surface: &ExactSurface, piece: &Piece, at: DVec3) -> Option<([DVec3; 2], [u32; 2])> {
    let [first, second] = piece.sides.as_slice() else {
        return None;
    };
    let normals = [first, second].map(|side| surface.topology.outward(surface.shape(), side.triangle, at));
    let [a, b] = normals;
    if a.cross(b).length() < SMOOTH && a.dot(b) > 0.0 {
        return None;
    }
    // Direction into the first face, which lies on the left of its side.
    let inward = a.cross(piece.tangent(at) * if first.forward { 1.0 } else { -1.0 });
    (b.dot(inward) < 0.0).then_some((normals, [first.face, second.face]))
}

/// Smallest thickness of the solid behind the pieces of one edge, mm: at each, twice the depth of the deepest point on the bisector of the faces from
/// which those faces are nearest. It is at most the true one.
fn thickness(surface: &ExactSurface, pieces: &[EdgePiece]) -> f64 {
    let size = pieces.iter().map(|p| p.half.length()).fold(0.0, f64::max);
    let (low, high) = crate::grid::bounding_box(surface.shape());
    let size = (high - low).length().max(size);
    let step = pieces.len().div_ceil(THICKNESS_PIECES).max(1);
    let mut scratch = Scratch::default();
    let depth_at = |piece: &EdgePiece, scratch: &mut Scratch| {
        let inward = -(piece.normals[0] + piece.normals[1]).normalize_or_zero();
        let mut deepest = 0.0f64;
        for k in 0..DEPTHS {
            let p = piece.center + inward * (size * DEPTH_RATIO.powi(k - DEPTHS));
            match surface.query(p, f64::INFINITY, scratch) {
                Some(nearest) if nearest.distance <= 0.0 => deepest = deepest.max(-nearest.distance),
                // The bisector has left the solid.
                _ => break,
            }
        }
        2.0 * deepest
    };
    let thicknesses = pieces.iter().step_by(step).map(|p| depth_at(p, &mut scratch));
    let least = thicknesses.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

//! Pieces of sharp convex edges, for contact of edges with edges: each a quadratic curve within [`TOLERANCE_MM`] of the exact edge.
//!
//! A chain of boundary pieces is divided by halves until a quadratic fits and the tangent turns little. The number of pieces depends on the curve
//! alone: one for a straight edge, some 25 for a circle of 10 mm.

use glam::DVec3;
use mortise_protocol::image::EdgeRecord;
use mortise_protocol::image::oct_encode;

use crate::chains::edge_chains;
use crate::distance::{ExactSurface, Scratch};
use crate::piece::{Link, Piece, PieceCurve};
use crate::tree::round_up;

/// Fineness of the division of edges into pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fineness {
    /// Largest distance of a piece from the exact edge across its direction, mm.
    pub tolerance_mm: f64,
    /// Largest angle by which a piece's tangent turns from its middle to an end, rad.
    most_turn: f64,
}

impl Fineness {
    /// As fine as the exact edges are known.
    pub const FINEST: Self = Self {
        tolerance_mm: TOLERANCE_MM,
        most_turn: MOST_TURN,
    };

    /// Half as many pieces: the error grows with the fourth power of their length.
    pub fn coarser(self) -> Self {
        Self {
            tolerance_mm: 16.0 * self.tolerance_mm,
            most_turn: 2.0 * self.most_turn,
        }
    }
}

/// Largest distance of a piece from the exact edge, mm, across its direction. Twice the tolerance of edges that are neither lines nor circles.
const TOLERANCE_MM: f64 = 2.0 * mortise_brep::EDGE_TOLERANCE_MM;
/// Largest angle by which a piece's tangent turns from its middle to an end, rad.
const MOST_TURN: f64 = 0.2;
/// Halvings of a chain at most: a kink inside a chain would be divided without end.
const MOST_HALVINGS: u32 = 12;
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
    /// Arc lengths of its ends along the chain, mm.
    range: [f64; 2],
}

impl EdgePiece {
    /// Number of its edge within the shape, the index of its chain.
    pub fn edge(&self) -> u32 {
        self.edge
    }

    /// Its two faces.
    pub fn faces(&self) -> [u32; 2] {
        self.faces
    }

    /// Its length, mm.
    pub fn length(&self) -> f64 {
        self.range[1] - self.range[0]
    }

    /// Arc length along the chain at a parameter from −1 to 1, mm.
    pub fn arc_length(&self, t: f64) -> f64 {
        0.5 * (self.range[0] + self.range[1] + t * self.length())
    }

    /// Curvature away from what touches the edge, 1/mm: where it bends away from a normal in the cone of its faces'.
    pub fn curvature_outward(&self) -> f64 {
        let curvature = self.bend * (2.0 / self.half.length_squared().max(1e-300));
        let middle = (self.normals[0] + self.normals[1]).normalize_or_zero();
        let outward = [self.normals[0], self.normals[1], middle].map(|n| -curvature.dot(n));
        outward.into_iter().fold(0.0, f64::max)
    }

    /// Ends and middle control point of the stretch between two parameters, moved so that its middle is at `middle`, mm: their convex hull contains
    /// it.
    pub fn hull_between(&self, [from, to]: [f64; 2], middle: DVec3) -> [DVec3; 3] {
        let (t, share) = (0.5 * (from + to), 0.5 * (to - from));
        let along = (self.half + self.bend * (2.0 * t)) * share;
        let bend = self.bend * (share * share);
        [middle - along + bend, middle - bend, middle + along + bend]
    }

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
        let chain = Chain::new(&surface.topology.pieces, links);
        if chain.length <= 0.0 {
            continue;
        }
        let first = all.len();
        let parts = chain.even_parts(fineness);
        for part in 0..parts {
            let ends = [part, part + 1].map(|k| chain.length * k as f64 / parts as f64);
            divide(
                surface,
                (&chain, fineness),
                ends,
                MOST_HALVINGS,
                edge as u32,
                &mut all,
            );
        }
        let thickness = thickness(surface, &all[first..]);
        for piece in &mut all[first..] {
            piece.thickness = thickness;
        }
    }
    all
}

/// A chain and the arc length at which each of its pieces begins, mm.
pub(crate) struct Chain<'a> {
    pieces: &'a [Piece],
    links: Vec<Link>,
    starts: Vec<f64>,
    length: f64,
}

impl<'a> Chain<'a> {
    pub fn new(pieces: &'a [Piece], links: Vec<Link>) -> Self {
        let mut length = 0.0;
        let starts = (links.iter())
            .map(|&(i, _)| {
                let start = length;
                length += pieces[i as usize].length();
                start
            })
            .collect();
        Self {
            pieces,
            links,
            starts,
            length,
        }
    }

    /// Its length, mm.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Number of equal parts in which to begin: of a circle, or an arc, as many as its pieces, since halves would be up to twice as many.
    fn even_parts(&self, fineness: Fineness) -> usize {
        let arcs = || self.links.iter().map(|&(i, _)| &self.pieces[i as usize]);
        if !arcs().all(|piece| matches!(piece.curve, PieceCurve::Arc { .. })) {
            return 1;
        }
        let turn: f64 = arcs().map(Piece::turn).sum();
        let radius = self.length / turn.max(1e-9);
        // A parabola through the ends and the middle of an arc of half angle θ and radius r is off by at most r·θ⁴/32.
        let by_error = (32.0 * 0.9 * fineness.tolerance_mm / radius).powf(0.25);
        let half_angle = by_error.min(2.0 * (0.5 * fineness.most_turn).atan());
        (turn / (2.0 * half_angle) - 1e-9).ceil().clamp(1.0, 4096.0) as usize
    }

    /// The boundary piece at arc length `s`, and the point there.
    pub fn at(&self, s: f64) -> (&'a Piece, DVec3) {
        let k = self.starts.partition_point(|&start| start <= s).max(1) - 1;
        let (i, forward) = self.links[k];
        let piece = &self.pieces[i as usize];
        let t = ((s - self.starts[k]) / piece.length().max(1e-300)).clamp(0.0, 1.0);
        (piece, piece.at(if forward { t } else { 1.0 - t }))
    }
}

/// Appends the pieces of a chain between two arc lengths.
fn divide(
    surface: &ExactSurface,
    (chain, fineness): (&Chain<'_>, Fineness),
    [from, to]: [f64; 2],
    halvings: u32,
    edge: u32,
    out: &mut Vec<EdgePiece>,
) {
    let middle = 0.5 * (from + to);
    let [a, center, b] = [from, middle, to].map(|s| chain.at(s).1);
    let half = (b - a) / 2.0;
    let mut bend = (a + b) / 2.0 - center;
    if bend.length() < 1e-6 * half.length() {
        bend = DVec3::ZERO;
    }
    let fits = || {
        [-0.75, -0.5, -0.25, 0.25, 0.5, 0.75].iter().all(|&t| {
            let exact = chain.at(middle + t * (to - middle)).1;
            let off = center + half * t + bend * (t * t) - exact;
            off.reject_from(half + 2.0 * t * bend).length() <= fineness.tolerance_mm
        })
    };
    let turn = 2.0 * bend.length() / half.length().max(1e-300);
    // A closed chain has no chord: its turn is infinite.
    if halvings > 0 && to - from > TOLERANCE_MM && (turn > fineness.most_turn || !fits()) {
        divide(
            surface,
            (chain, fineness),
            [from, middle],
            halvings - 1,
            edge,
            out,
        );
        divide(surface, (chain, fineness), [middle, to], halvings - 1, edge, out);
        return;
    }
    let (piece, at) = chain.at(middle);
    if let Some((normals, faces)) = sharp(surface, piece, at) {
        out.push(EdgePiece {
            center,
            half,
            bend,
            normals,
            faces,
            thickness: 0.0,
            edge,
            range: [from, to],
        });
    }
}

/// Outward normals and numbers of the two faces that meet at a point of a boundary piece, if they form a sharp convex edge.
fn sharp(surface: &ExactSurface, piece: &Piece, at: DVec3) -> Option<([DVec3; 2], [u32; 2])> {
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

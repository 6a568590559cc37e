//! B-rep topology recovered from the tessellation: mesh sides between faces, their exact curves, and the orientation of faces.

use std::collections::HashMap;

use glam::DVec3;
use mortise_brep::{Curve, EDGE_TOLERANCE_MM, Edge, Shape, Surface};
use rayon::prelude::*;

use crate::free_form::FreeForms;
use crate::piece::{Piece, PieceCurve, PieceSide, on_segment};
use crate::surface::{natural_normal, project};

/// Cosine of 170°: outward normals that far apart count as opposite.
const OPPOSITE: f64 = -0.985;

/// Index that means no piece or no neighbour.
pub(crate) const NONE: u32 = u32::MAX;

/// Boundary pieces, neighbours, senses and chord errors of a shape's tessellation.
pub(crate) struct Topology {
    /// Boundary pieces between faces, and open sides.
    pub pieces: Vec<Piece>,
    /// For each triangle and side (corner i to i+1): its piece, or [`NONE`] inside a face.
    pub triangle_pieces: Vec<[u32; 3]>,
    /// For each triangle and side inside a face: the triangle beyond, or [`NONE`].
    pub neighbors: Vec<[u32; 3]>,
    /// For each face: +1 when its outward normal is the surface's natural one, else −1.
    pub sense: Vec<f64>,
    /// For each face: largest deviation of its triangles and their boundary from the exact face, mm.
    pub chord: Vec<f64>,
    /// Angle-weighted outward normal of each vertex (exact face normals; not unit length).
    pub vertex_normals: Vec<DVec3>,
    /// Whether faces with almost opposite normals meet at a vertex.
    pub is_cusp: Vec<bool>,
    /// Pieces that end at each vertex, for vertices with any.
    pub vertex_pieces: HashMap<u32, Vec<u32>>,
    /// Unit outward facet normals; zero for a degenerate triangle.
    pub facet_normals: Vec<DVec3>,
    /// Free-form faces.
    pub free_forms: FreeForms,
}

impl Topology {
    /// Builds the topology from the tessellation and exact geometry of `shape`, whose triangles wind outward. Cost: linear in triangles and edges.
    pub fn new(shape: &Shape) -> Self {
        let mesh = &shape.mesh;
        let corner = |v: u32| mesh.vertices[v as usize];
        let facet_normals: Vec<DVec3> = mesh
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(corner);
                (b - a).cross(c - a).normalize_or_zero()
            })
            .collect();
        let free_forms = FreeForms::new(shape);
        let sense = senses(shape, &free_forms);
        let (pieces, triangle_pieces, neighbors) = split_sides(shape);
        let chord = chords(shape, &free_forms, &pieces);
        let mut vertex_pieces: HashMap<u32, Vec<u32>> = HashMap::new();
        for (i, piece) in pieces.iter().enumerate() {
            for end in piece.ends {
                vertex_pieces.entry(end).or_default().push(i as u32);
            }
        }
        let mut topology = Self {
            pieces,
            triangle_pieces,
            neighbors,
            sense,
            chord,
            vertex_normals: vec![DVec3::ZERO; mesh.vertices.len()],
            is_cusp: vec![false; mesh.vertices.len()],
            vertex_pieces,
            facet_normals,
            free_forms,
        };
        let mut normals_at: Vec<Vec<DVec3>> = vec![Vec::new(); mesh.vertices.len()];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            for i in 0..3 {
                let [at, next, last] =
                    [triangle[i], triangle[(i + 1) % 3], triangle[(i + 2) % 3]].map(corner);
                let angle = (next - at).angle_between(last - at);
                if angle.is_finite() {
                    let normal = topology.outward(shape, t as u32, at);
                    let vertex = triangle[i] as usize;
                    topology.vertex_normals[vertex] += normal * angle;
                    topology.is_cusp[vertex] |= normals_at[vertex].iter().any(|n| n.dot(normal) < OPPOSITE);
                    normals_at[vertex].push(normal);
                }
            }
        }
        topology
    }

    /// Outward unit normal, at a point `q` of triangle `t`, of the face that the triangle belongs to: exact where the face is analytic or its patch
    /// is known, else the facet's.
    pub fn outward(&self, shape: &Shape, t: u32, q: DVec3) -> DVec3 {
        let face = shape.mesh.triangle_face[t as usize];
        let natural = natural_normal(&shape.faces[face as usize].surface, q)
            .or_else(|| self.free_forms.beside(face, t, q).map(|on| on.normal))
            .filter(|&n| n != DVec3::ZERO);
        match natural {
            Some(n) => n * self.sense[face as usize],
            None => self.facet_normals[t as usize],
        }
    }

    /// Error bound of distances, mm: see [`crate::ExactSurface::surface_error_mm`].
    pub fn error(&self, shape: &Shape) -> f64 {
        let faces = shape
            .faces
            .iter()
            .enumerate()
            .filter(|(_, f)| f.surface == Surface::Spline);
        let of_faces = faces.map(|(f, _)| match self.free_forms.patch(f as u32) {
            Some(patch) => patch.deviation,
            None => shape.deflection_mm,
        });
        let of_pieces = self.pieces.iter().map(|piece| {
            let curve = piece.edge.map(|e| shape.edges[e as usize].curve);
            match (curve, &piece.curve) {
                (Some(Curve::Line { .. }), PieceCurve::Segment) | (_, PieceCurve::Arc { .. }) => 0.0,
                (_, PieceCurve::Dense(_)) => EDGE_TOLERANCE_MM,
                (_, PieceCurve::Segment) => shape.deflection_mm,
            }
        });
        of_faces.chain(of_pieces).fold(0.0, f64::max)
    }

    /// Sum of the outward normals of the faces that meet at `q` on a piece.
    pub fn piece_normal(&self, shape: &Shape, piece: &Piece, q: DVec3) -> DVec3 {
        piece
            .sides
            .iter()
            .map(|side| self.outward(shape, side.triangle, q))
            .sum()
    }
}

/// Sense of each face from its own triangles; from the B-rep if it has no (non-degenerate) triangle.
fn senses(shape: &Shape, free_forms: &FreeForms) -> Vec<f64> {
    let mesh = &shape.mesh;
    let mut agree = vec![0.0; shape.faces.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let face = mesh.triangle_face[t] as usize;
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize]);
        let area = (b - a).cross(c - a);
        let middle = (a + b + c) / 3.0;
        let natural = natural_normal(&shape.faces[face].surface, middle).or_else(|| {
            free_forms
                .beside(face as u32, t as u32, middle)
                .map(|on| on.normal)
        });
        if let Some(n) = natural {
            agree[face] += area.dot(n);
        }
    }
    agree
        .iter()
        .zip(&shape.faces)
        .map(|(&agree, face)| match agree {
            a if a > 0.0 => 1.0,
            a if a < 0.0 => -1.0,
            _ if face.reversed => -1.0,
            _ => 1.0,
        })
        .collect()
}

type Sides = (Vec<Piece>, Vec<[u32; 3]>, Vec<[u32; 3]>);

fn split_sides(shape: &Shape) -> Sides {
    let mesh = &shape.mesh;
    let mut uses: HashMap<(u32, u32), Vec<(u32, usize)>> = HashMap::new();
    let mut order = Vec::new();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            let list = uses.entry((a.min(b), a.max(b))).or_default();
            if list.is_empty() {
                order.push((a.min(b), a.max(b)));
            }
            list.push((t as u32, i));
        }
    }
    let edge_of = edges_by_side(shape);
    let fine: HashMap<u32, &[Vec<DVec3>]> = shape
        .curves
        .iter()
        .map(|c| (c.edge, c.between.as_slice()))
        .collect();
    let mut triangle_pieces = vec![[NONE; 3]; mesh.triangles.len()];
    let mut neighbors = vec![[NONE; 3]; mesh.triangles.len()];
    let mut pieces = Vec::new();
    for key in order {
        let list = &uses[&key];
        let face = |t: u32| mesh.triangle_face[t as usize];
        if let &[(t, i), (u, j)] = list.as_slice()
            && face(t) == face(u)
        {
            neighbors[t as usize][i] = u;
            neighbors[u as usize][j] = t;
            continue;
        }
        let ends = [key.0, key.1];
        let points = ends.map(|v| mesh.vertices[v as usize]);
        let sides: Vec<PieceSide> = list
            .iter()
            .map(|&(t, i)| PieceSide {
                triangle: t,
                face: face(t),
                forward: mesh.triangles[t as usize][i] == key.0,
            })
            .collect();
        let (edge, curve) = exact_curve(shape, &edge_of, &fine, ends, points, &sides);
        for &(t, i) in list {
            triangle_pieces[t as usize][i] = pieces.len() as u32;
        }
        pieces.push(Piece {
            ends,
            points,
            curve,
            sides,
            edge,
        });
    }
    (pieces, triangle_pieces, neighbors)
}

/// A mesh side of an edge: the edge, index of the segment of its polyline, and whether that runs from the lower vertex to the higher.
type SideOfEdge = (u32, usize, bool);

/// Mesh sides along each edge's polyline: vertices are matched by position to a millionth of the shape's size.
fn edges_by_side(shape: &Shape) -> HashMap<(u32, u32), SideOfEdge> {
    let size = shape
        .mesh
        .vertices
        .iter()
        .fold(0.0f64, |m, v| m.max(v.abs().max_element()));
    let quantum = (size * 1e-6).max(1e-9);
    let key = |p: DVec3| (p / quantum).round().to_array().map(|c| c as i64);
    let mut by_place = HashMap::new();
    for (i, &v) in shape.mesh.vertices.iter().enumerate() {
        by_place.entry(key(v)).or_insert(i as u32);
    }
    let find = |p: DVec3| {
        let k = key(p);
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    if let Some(&v) = by_place.get(&[k[0] + x, k[1] + y, k[2] + z])
                        && shape.mesh.vertices[v as usize].distance(p) <= quantum
                    {
                        return Some(v);
                    }
                }
            }
        }
        None
    };
    let mut sides = HashMap::new();
    for (e, edge) in shape.edges.iter().enumerate() {
        let on: Vec<Option<u32>> = edge.polyline.iter().map(|&p| find(p)).collect();
        for (i, pair) in on.windows(2).enumerate() {
            if let &[Some(a), Some(b)] = pair {
                sides.entry((a.min(b), a.max(b))).or_insert((e as u32, i, a < b));
            }
        }
    }
    sides
}

/// The edge that a mesh side lies on and its exact curve: found by the edge's own polyline, else the edge of its faces that fits its ends best.
fn exact_curve(
    shape: &Shape,
    edge_of: &HashMap<(u32, u32), SideOfEdge>,
    fine: &HashMap<u32, &[Vec<DVec3>]>,
    ends: [u32; 2],
    points: [DVec3; 2],
    sides: &[PieceSide],
) -> (Option<u32>, PieceCurve) {
    // Half of STEP's customary accuracy of 1e-3 mm: points closer than that coincide.
    const TOLERANCE_MM: f64 = 5e-4;
    if let Some(&(e, side, forward)) = edge_of.get(&(ends[0], ends[1])) {
        let curve = curve_through(&shape.edges[e as usize], points, TOLERANCE_MM);
        let dense = || {
            let between = fine.get(&e)?.get(side)?;
            let mut all = vec![points[0]];
            if forward {
                all.extend(between);
            } else {
                all.extend(between.iter().rev());
            }
            all.push(points[1]);
            Some(PieceCurve::Dense(all.into()))
        };
        return (Some(e), curve.or_else(dense).unwrap_or(PieceCurve::Segment));
    }
    let mut candidates: Vec<u32> = sides
        .iter()
        .flat_map(|s| shape.faces[s.face as usize].edges.iter().copied())
        .filter(|&e| (e as usize) < shape.edges.len())
        .collect();
    candidates.sort_unstable();
    candidates.dedup();
    for e in candidates {
        let edge = &shape.edges[e as usize];
        let middle = (points[0] + points[1]) / 2.0;
        let length = points[0].distance(points[1]);
        let beside = |p: DVec3| {
            edge.polyline
                .windows(2)
                .map(|w| on_segment(w[0], w[1], p).distance(p))
                .fold(f64::INFINITY, f64::min)
        };
        if beside(middle) < 0.1 * length
            && let Some(curve) = curve_through(edge, points, TOLERANCE_MM)
        {
            return (Some(e), curve);
        }
    }
    (None, PieceCurve::Segment)
}

fn curve_through(edge: &Edge, points: [DVec3; 2], tolerance: f64) -> Option<PieceCurve> {
    match edge.curve {
        Curve::Line { origin, direction } => points
            .iter()
            .all(|&p| {
                let d = p - origin;
                (d - direction * d.dot(direction)).length() <= tolerance
            })
            .then_some(PieceCurve::Segment),
        Curve::Circle { frame, radius } => PieceCurve::arc(frame.origin, frame.z, radius, points, tolerance),
        Curve::Other => None,
    }
}

/// Largest deviation of each face's triangles from its exact surface, including its boundary's sagitta.
///
/// Measured at the centroid and at the middles of the sides, where the deviation of a chord from a surface of constant curvature is largest, times
/// 1.5 for surfaces of varying curvature (cone, torus, free forms). 0 for splines without a patch, which are represented by their tessellation here.
fn chords(shape: &Shape, free_forms: &FreeForms, pieces: &[Piece]) -> Vec<f64> {
    let mesh = &shape.mesh;
    let mut chord = vec![0.0f64; shape.faces.len()];
    let of_triangle = |t: usize| -> f64 {
        let face = mesh.triangle_face[t];
        let surface = &shape.faces[face as usize].surface;
        let [a, b, c] = mesh.triangles[t].map(|v| mesh.vertices[v as usize]);
        let places = [
            a,
            b,
            c,
            (a + b + c) / 3.0,
            (a + b) / 2.0,
            (b + c) / 2.0,
            (c + a) / 2.0,
        ];
        let off = |p: DVec3| {
            let foot = project(surface, p, p)
                .map(|q| q.point)
                .or_else(|| free_forms.beside(face, t as u32, p).map(|on| on.point));
            foot.map_or(0.0, |q| q.distance(p))
        };
        1.5 * places.map(off).into_iter().fold(0.0, f64::max)
    };
    let all: Vec<f64> = (0..mesh.triangles.len())
        .into_par_iter()
        .map(of_triangle)
        .collect();
    for (&face, off) in mesh.triangle_face.iter().zip(all) {
        let c = &mut chord[face as usize];
        *c = c.max(off);
    }
    for piece in pieces {
        for side in &piece.sides {
            let c = &mut chord[side.face as usize];
            *c = c.max(piece.sagitta());
        }
    }
    chord
}

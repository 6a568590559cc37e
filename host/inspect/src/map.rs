//! Map of the clearance of one part to another: exact signed distances at the vertices of a refined tessellation.
//!
//! The tessellation of the first part is divided where its edges are long for the range, and where the distance at an edge's middle differs from the mean of
//! its ends by more than the tolerance. Whether an edge is divided depends on the edge alone, so that triangles on both sides of it divide it at the same
//! vertex and no gap opens. Every vertex lies on the exact surface. What surely lies farther than the range is left out.
//!
//! Cost: one exact distance for each vertex, and one for each edge that stays (1.5 to 10 µs each).

use std::collections::HashMap;

use glam::{DAffine3, DVec3};

use crate::onto::onto;
use crate::solid::Solid;

/// How finely a map follows the distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapOptions {
    /// Distances up to this are mapped, mm.
    pub range_mm: f64,
    /// Largest difference between the distance at the middle of an edge and the mean of its ends where the distance is below `near_mm`, mm; beyond, in
    /// proportion to the distance.
    pub tolerance_mm: f64,
    /// Distances up to this are held to the tolerance, mm.
    pub near_mm: f64,
    /// Longest edge within the range, mm.
    pub longest_mm: f64,
    /// Edges shorter than this are not divided, mm: along a kink of the distance, such as opposite the rim of a bore, no edge is short enough.
    pub shortest_mm: f64,
    /// Vertices after which no edge is divided.
    pub most_vertices: usize,
}

impl Default for MapOptions {
    /// One millimetre of range, to a micrometre: inside a triangle a quadratic distance differs from the linear one by up to 4/3 of what it does at the middles of
    /// its edges.
    fn default() -> Self {
        Self {
            range_mm: 1.0,
            tolerance_mm: 5e-4,
            near_mm: 0.1,
            longest_mm: 2.0,
            shortest_mm: 0.1,
            most_vertices: 200_000,
        }
    }
}

/// Distances of a part's surface to another part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClearanceMap {
    /// Vertices on the exact surface, mm, in the part's own frame.
    pub points: Vec<DVec3>,
    /// Signed distance of each to the other part, mm, negative inside it.
    pub distances_mm: Vec<f64>,
    /// Triangles, counter-clockwise seen from outside; none lies farther from the other part than the range.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle the face it is on.
    pub faces: Vec<u32>,
    /// For each triangle whether the distance on its edges is linear within the tolerance; not where [`MapOptions::shortest_mm`] or
    /// [`MapOptions::most_vertices`] ended the division.
    pub met: Vec<bool>,
}

impl ClearanceMap {
    /// The vertex with the least distance.
    pub fn least(&self) -> Option<(DVec3, f64)> {
        let i =
            (0..self.points.len()).min_by(|&i, &j| self.distances_mm[i].total_cmp(&self.distances_mm[j]))?;
        Some((self.points[i], self.distances_mm[i]))
    }
}

/// Maps the distance of `part` to `other`; `to` places the part's frame in the other's.
pub fn clearance_map(part: &Solid, other: &Solid, to: &DAffine3, options: &MapOptions) -> ClearanceMap {
    let mut work = Work {
        part,
        other,
        to: *to,
        options,
        map: ClearanceMap::default(),
        middles: HashMap::new(),
        sides: side_faces(part),
    };
    work.start();
    while work.divide() {}
    work.finish()
}

/// What is known of an edge.
#[derive(Clone, Copy, PartialEq)]
enum Middle {
    /// The distance is linear within the tolerance, or lies out of range.
    Linear,
    /// It is not, but the edge is not divided further.
    Coarse,
    /// Divided at this vertex.
    At(u32),
}

struct Work<'a> {
    part: &'a Solid,
    other: &'a Solid,
    to: DAffine3,
    options: &'a MapOptions,
    map: ClearanceMap,
    middles: HashMap<[u32; 2], Middle>,
    /// Faces on the two sides of each edge, by its vertices' numbers in the map.
    sides: HashMap<[u32; 2], [u32; 2]>,
}

/// Faces of the triangles at each edge of the mesh, where these are two.
fn side_faces(part: &Solid) -> HashMap<[u32; 2], [u32; 2]> {
    let mesh = &part.shape().mesh;
    let mut sides: HashMap<[u32; 2], [u32; 2]> = HashMap::new();
    for (t, &face) in mesh.triangles.iter().zip(&mesh.triangle_face) {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            sides
                .entry([a.min(b), a.max(b)])
                .and_modify(|f| f[1] = face)
                .or_insert([face; 2]);
        }
    }
    sides
}

impl Work<'_> {
    fn distance(&self, p: DVec3) -> f64 {
        self.other.distance(self.to.transform_point3(p))
    }

    /// Takes the triangles that may come within the range.
    fn start(&mut self) {
        let mesh = &self.part.shape().mesh;
        let chord = self.part.surface().chord_error_mm();
        let (low, high) = bounds(self.other);
        let reach = self.options.range_mm + chord + self.other.surface().chord_error_mm();
        let mut number: HashMap<u32, u32> = HashMap::new();
        let mut sides = HashMap::new();
        for (t, &face) in mesh.triangles.iter().zip(&mesh.triangle_face) {
            let corners = t.map(|v| self.to.transform_point3(mesh.vertices[v as usize]));
            let center = (corners[0] + corners[1] + corners[2]) / 3.0;
            let radius = corners.iter().map(|c| c.distance(center)).fold(0.0, f64::max);
            if center.clamp(low, high).distance(center) > radius + reach
                || self.other.distance(center) > radius + reach
            {
                continue;
            }
            let mut own = [0; 3];
            for (own, &v) in own.iter_mut().zip(t) {
                *own = *number.entry(v).or_insert_with(|| {
                    let p = mesh.vertices[v as usize];
                    self.map.points.push(p);
                    self.map.points.len() as u32 - 1
                });
            }
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                if let Some(&faces) = self.sides.get(&[t[i].min(t[j]), t[i].max(t[j])]) {
                    sides.insert([own[i].min(own[j]), own[i].max(own[j])], faces);
                }
            }
            self.map.triangles.push(own);
            self.map.faces.push(face);
        }
        self.sides = sides;
        self.map.distances_mm = self.map.points.iter().map(|&p| self.distance(p)).collect();
    }

    /// Divides every edge once that needs it; false when none does.
    fn divide(&mut self) -> bool {
        let (triangles, faces) = (
            std::mem::take(&mut self.map.triangles),
            std::mem::take(&mut self.map.faces),
        );
        let mut divided = false;
        for (t, face) in triangles.into_iter().zip(faces) {
            let middles = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| match self.middle(t[i], t[j], face) {
                Middle::At(v) => Some(v),
                _ => None,
            });
            divided |= middles.iter().any(Option::is_some);
            for part in parts(t, middles, &self.map.points) {
                self.map.triangles.push(part);
                self.map.faces.push(face);
            }
        }
        divided
    }

    fn middle(&mut self, a: u32, b: u32, face: u32) -> Middle {
        let key = [a.min(b), a.max(b)];
        if let Some(&known) = self.middles.get(&key) {
            return known;
        }
        let found = self.decide(key, face);
        self.middles.insert(key, found);
        found
    }

    fn decide(&mut self, key: [u32; 2], face: u32) -> Middle {
        let [a, b] = key.map(|v| v as usize);
        let (p, q) = (self.map.points[a], self.map.points[b]);
        let ends = [self.map.distances_mm[a], self.map.distances_mm[b]];
        let length = p.distance(q);
        let least = ends[0].min(ends[1]);
        let o = self.options;
        if least - length > o.range_mm {
            return Middle::Linear;
        }
        let faces = self.sides.get(&key).copied().unwrap_or([face; 2]);
        let chord = p.midpoint(q);
        let point = onto(self.part.surface(), chord, faces, None)
            .or_else(|| self.part.surface().nearest(chord).map(|n| n.point))
            .unwrap_or(chord);
        let distance = self.distance(point);
        let least = least.abs().min(distance.abs());
        let allowed = o.tolerance_mm * (least / o.near_mm).max(1.0);
        let bends = (distance - (ends[0] + ends[1]) / 2.0).abs() > allowed;
        if !bends && length <= o.longest_mm {
            return Middle::Linear;
        }
        if length < o.shortest_mm || self.map.points.len() >= o.most_vertices {
            return Middle::Coarse;
        }
        let v = self.map.points.len() as u32;
        self.map.points.push(point);
        self.map.distances_mm.push(distance);
        for end in key {
            self.sides.insert([end, v], faces);
        }
        Middle::At(v)
    }

    /// Drops triangles beyond the range and the vertices of these alone.
    fn finish(mut self) -> ClearanceMap {
        let triangles = std::mem::take(&mut self.map.triangles);
        let faces = std::mem::take(&mut self.map.faces);
        let mut out = ClearanceMap::default();
        let mut number: HashMap<u32, u32> = HashMap::new();
        for (t, face) in triangles.into_iter().zip(faces) {
            if t.iter()
                .all(|&v| self.map.distances_mm[v as usize] > self.options.range_mm)
            {
                continue;
            }
            out.triangles.push(t.map(|v| {
                *number.entry(v).or_insert_with(|| {
                    out.points.push(self.map.points[v as usize]);
                    out.distances_mm.push(self.map.distances_mm[v as usize]);
                    out.points.len() as u32 - 1
                })
            }));
            out.faces.push(face);
            out.met.push(
                [(0, 1), (1, 2), (2, 0)].iter().all(|&(i, j)| {
                    self.middles.get(&[t[i].min(t[j]), t[i].max(t[j])]) == Some(&Middle::Linear)
                }),
            );
        }
        out
    }
}

/// Box of a solid: low and high corner.
fn bounds(solid: &Solid) -> (DVec3, DVec3) {
    let mesh = &solid.shape().mesh;
    mesh.triangles
        .iter()
        .flatten()
        .map(|&v| mesh.vertices[v as usize])
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p), high.max(p))
        })
}

/// A triangle divided at the middles of its sides 01, 12, 20, as many as there are.
fn parts(t: [u32; 3], middles: [Option<u32>; 3], points: &[DVec3]) -> Vec<[u32; 3]> {
    // Turned so that the pattern starts at its first divided side.
    let turned = |k: usize| [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
    match middles {
        [None, None, None] => vec![t],
        [Some(m), Some(n), Some(o)] => vec![[t[0], m, o], [m, t[1], n], [o, n, t[2]], [m, n, o]],
        _ => {
            let divided = middles.iter().filter(|m| m.is_some()).count();
            // One side: the divided one first. Two: the undivided one last.
            let k = match divided {
                1 => middles.iter().position(Option::is_some).unwrap_or(0),
                _ => (middles.iter().position(Option::is_none).unwrap_or(2) + 1) % 3,
            };
            let [a, b, c] = turned(k);
            match (middles[k], middles[(k + 1) % 3]) {
                (Some(m), None) => vec![[a, m, c], [m, b, c]],
                (Some(m), Some(n)) => {
                    // The shorter diagonal of the quadrilateral a m n c.
                    let at = |v: u32| points[v as usize];
                    let mut all = vec![[m, b, n]];
                    if at(a).distance_squared(at(n)) < at(m).distance_squared(at(c)) {
                        all.extend([[a, m, n], [a, n, c]]);
                    } else {
                        all.extend([[a, m, c], [m, n, c]]);
                    }
                    all
                }
                _ => vec![t],
            }
        }
    }
}

//! A solid prepared for the search: exact distance, area samples, and the walls that can mate.
//!
//! Samples lie on the exact surface, with the exact outward normal and the area that they stand for; a fixed low-discrepancy sequence places them, so
//! that the same shape gives the same samples. Lengths are in millimetres, in the shape's frame.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use mortise_bake::ExactSurface;
use mortise_brep::{Shape, Surface};
use mortise_mating::{Side, Tolerances, merge};

use crate::facets::Facets;
use crate::hit::Hit;

/// Samples of a face at least, where it has triangles.
const LEAST_PER_FACE: usize = 8;
/// Distance below which the direction to the foot is rounding, mm.
const TOUCHING_MM: f64 = 1e-4;
/// Cosine of the angle between a sample's exact normal and its triangle's above which the sample is kept.
const SAME_WAY: f64 = 0.7;

/// A point of a solid's exact surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Point, mm.
    pub p: DVec3,
    /// Outward unit normal.
    pub n: DVec3,
    /// Face it lies on.
    pub face: u32,
    /// Area that it stands for, mm².
    pub area: f64,
}

/// Faces of one surface, as a feature that can mate with another.
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    /// Plane (its z out of the material), cylinder, cone, sphere or torus.
    pub surface: Surface,
    /// Whether the material is on the inner side.
    pub side: Side,
    /// Area, mm².
    pub area: f64,
    /// Mesh vertices of its faces, mm.
    pub points: Vec<DVec3>,
}

/// A solid prepared for the search.
pub(crate) struct Solid {
    pub exact: ExactSurface,
    pub facets: Facets,
    pub samples: Vec<Sample>,
    pub walls: Vec<Wall>,
    /// Points along the edges, mm.
    pub edge_points: Vec<DVec3>,
    /// Box of the mesh, mm.
    pub low: DVec3,
    pub high: DVec3,
    /// Total area, mm².
    pub area: f64,
}

impl Solid {
    /// Prepares `shape` with about `count` samples. Cost: some microseconds a sample.
    pub fn new(shape: &Shape, count: usize) -> Self {
        let exact = ExactSurface::new(shape);
        let mut low = DVec3::INFINITY;
        let mut high = DVec3::NEG_INFINITY;
        for &v in &shape.mesh.vertices {
            low = low.min(v);
            high = high.max(v);
        }
        let error = shape.deflection_mm.max(exact.chord_error_mm()) + exact.surface_error_mm();
        let mut solid = Self {
            facets: Facets::new(exact.shape(), error),
            exact,
            samples: Vec::new(),
            walls: walls(shape),
            edge_points: Vec::new(),
            low,
            high,
            area: shape.faces.iter().map(|face| face.area_mm2).sum(),
        };
        solid.samples = solid.sampled(count);
        // Points of free-form edges are off by the tessellation's error: their feet are not.
        solid.edge_points = (edge_points(shape, count / 2).into_iter())
            .filter_map(|p| solid.exact.nearest(p).map(|near| near.point))
            .collect();
        solid
    }

    /// Diagonal of its box, mm.
    pub fn size(&self) -> f64 {
        self.low.distance(self.high)
    }

    /// Middle of its box.
    pub fn middle(&self) -> DVec3 {
        (self.low + self.high) / 2.0
    }

    /// Lower bound of the distance from `p`: that to the box, mm; 0 within it.
    pub fn box_distance(&self, p: DVec3) -> f64 {
        (self.low - p).max(p - self.high).max(DVec3::ZERO).length()
    }

    /// Signed distance of `p`, mm; infinite without triangles.
    pub fn distance(&self, p: DVec3) -> f64 {
        self.exact.nearest(p).map_or(f64::INFINITY, |near| near.distance)
    }

    /// Nearest point of the surface to `p`, with the outward normal there.
    pub fn hit(&self, p: DVec3) -> Option<Hit> {
        let near = self.exact.nearest(p)?;
        let normal = if near.distance.abs() > TOUCHING_MM {
            (p - near.point) / near.distance
        } else {
            self.normal(near.point, near.face)?
        };
        Some(Hit {
            distance: near.distance,
            foot: near.point,
            normal,
            face: near.face,
        })
    }

    /// Outward normal at a point of a face: the surface's own, or by differences of the distance on a free-form face.
    fn normal(&self, at: DVec3, face: u32) -> Option<DVec3> {
        let face = &self.exact.shape().faces[face as usize];
        if let Some((_, natural)) = face.surface.distance(at) {
            return Some(if face.reversed { -natural } else { natural });
        }
        const STEP_MM: f64 = 1e-3;
        DVec3::AXES
            .map(|axis| self.distance(at + STEP_MM * axis) - self.distance(at - STEP_MM * axis))
            .iter()
            .zip(DVec3::AXES)
            .map(|(&difference, axis)| difference * axis)
            .sum::<DVec3>()
            .try_normalize()
    }

    /// The sample of the surface nearest to `p`, a point of the tessellation whose outward normal is `facet`, when it lies on `face`.
    pub fn lifted(&self, p: DVec3, facet: DVec3, face: u32, lift: f64) -> Option<(DVec3, DVec3)> {
        let q = p + lift * facet;
        let near = self.exact.nearest(q)?;
        let normal = (q - near.point) / near.distance;
        (near.face == face && near.distance > 0.0 && normal.dot(facet) > SAME_WAY)
            .then_some((near.point, normal))
    }

    /// Height above the tessellation from which points are projected, mm.
    pub fn lift_mm(&self) -> f64 {
        2.0 * self.exact.shape().deflection_mm.max(self.exact.chord_error_mm()) + 1e-3
    }

    fn sampled(&self, count: usize) -> Vec<Sample> {
        let shape = self.exact.shape();
        let mesh = &shape.mesh;
        let mut of_face: Vec<Vec<usize>> = vec![Vec::new(); shape.faces.len()];
        for (triangle, &face) in mesh.triangle_face.iter().enumerate() {
            of_face[face as usize].push(triangle);
        }
        let lift = self.lift_mm();
        let mut out = Vec::new();
        for (face, triangles) in of_face.iter().enumerate() {
            let corners = |t: usize| mesh.triangles[t].map(|v| mesh.vertices[v as usize]);
            let mut sums = Vec::with_capacity(triangles.len());
            let mut total = 0.0;
            for &t in triangles {
                let [a, b, c] = corners(t);
                total += (b - a).cross(c - a).length() / 2.0;
                sums.push(total);
            }
            if total <= 0.0 {
                continue;
            }
            let area = shape.faces[face].area_mm2;
            let wanted = ((count as f64 * area / self.area) as usize).max(LEAST_PER_FACE);
            let first = out.len();
            for k in 0..wanted {
                let along = (k as f64 + 0.5) / wanted as f64 * total;
                let t = triangles[sums.partition_point(|&s| s < along).min(triangles.len() - 1)];
                let [a, b, c] = corners(t);
                let Some(facet) = (b - a).cross(c - a).try_normalize() else {
                    continue;
                };
                let at = spread(k);
                let (u, v) = if at.x + at.y > 1.0 {
                    (1.0 - at.x, 1.0 - at.y)
                } else {
                    (at.x, at.y)
                };
                let p = a + u * (b - a) + v * (c - a);
                if let Some((p, n)) = self.lifted(p, facet, face as u32, lift) {
                    out.push(Sample {
                        p,
                        n,
                        face: face as u32,
                        area: 0.0,
                    });
                }
            }
            let kept = out.len() - first;
            for sample in &mut out[first..] {
                sample.area = area / kept as f64;
            }
        }
        out
    }
}

/// The k-th point of the R2 sequence: evenly spread over the unit square (Roberts 2018).
fn spread(k: usize) -> DVec2 {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let step = DVec2::new(1.0 / PLASTIC, 1.0 / (PLASTIC * PLASTIC));
    (DVec2::splat(0.5) + k as f64 * step).fract()
}

/// `count` unit vectors, evenly spread over the sphere: a Fibonacci lattice.
pub(crate) fn directions(count: usize) -> impl Iterator<Item = DVec3> {
    const GOLDEN: f64 = 1.618_033_988_749_895;
    (0..count).map(move |k| {
        let z = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
        let (sin, cos) = (TAU * (k as f64 / GOLDEN).fract()).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * cos, r * sin, z)
    })
}

/// About `count` points along the edges, at least both ends and the middle of each.
fn edge_points(shape: &Shape, count: usize) -> Vec<DVec3> {
    let total: f64 = shape.edges.iter().map(|edge| edge.length_mm).sum();
    let mut out = Vec::new();
    for edge in &shape.edges {
        let wanted = ((count as f64 * edge.length_mm / total) as usize).max(3);
        let last = edge.polyline.len().saturating_sub(1);
        let shown = wanted.min(edge.polyline.len());
        out.extend((0..shown).map(|k| edge.polyline[(k * last) / shown.saturating_sub(1).max(1)]));
        // Straight edges have points at their ends only.
        if let [a, b] = edge.polyline[..] {
            out.extend((1..wanted).map(|k| a.lerp(b, k as f64 / wanted as f64)));
        }
    }
    out
}

fn walls(shape: &Shape) -> Vec<Wall> {
    let mut of_face: Vec<Vec<u32>> = vec![Vec::new(); shape.faces.len()];
    for (triangle, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
        of_face[face as usize].extend(triangle);
    }
    let points = |faces: &[u32]| {
        let mut ids: Vec<u32> = (faces.iter())
            .flat_map(|&face| of_face[face as usize].iter().copied())
            .collect();
        ids.sort_unstable();
        ids.dedup();
        ids.iter().map(|&v| shape.mesh.vertices[v as usize]).collect()
    };
    let merged = merge(shape, &Tolerances::default());
    let mut walls: Vec<Wall> = (merged.iter())
        .map(|m| Wall {
            surface: m.surface,
            side: m.side,
            area: m.area_mm2,
            points: points(&m.faces),
        })
        .collect();
    for (id, face) in shape.faces.iter().enumerate() {
        if matches!(face.surface, Surface::Torus { .. }) {
            walls.push(Wall {
                surface: face.surface,
                side: if face.reversed {
                    Side::Concave
                } else {
                    Side::Convex
                },
                area: face.area_mm2,
                points: points(&[id as u32]),
            });
        }
    }
    walls.retain(|wall| !wall.points.is_empty());
    walls
}

impl Wall {
    /// Smallest and largest coordinate of its points along `direction` after `place`, mm.
    pub fn extent(&self, direction: DVec3, place: impl Fn(DVec3) -> DVec3) -> [f64; 2] {
        let mut out = [f64::INFINITY, f64::NEG_INFINITY];
        for &p in &self.points {
            let along = direction.dot(place(p));
            out = [out[0].min(along), out[1].max(along)];
        }
        out
    }
}

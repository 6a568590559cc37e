//! A shape prepared for clearance queries: its exact surface, and samples of that surface under a tree of spheres.
//!
//! Samples inside faces are as dense as a chord error of [`SAMPLE_ERROR_MM`] requires, samples along edges no farther apart than a share of the shape's
//! size. Lengths are mm, in the shape's frame. Cost: sampling is proportional to area over spacing²; a tree over n samples has 2n − 1 nodes.

use std::collections::HashMap;
use std::sync::Mutex;

use glam::DVec3;
use mortise_bake::{ExactSurface, Nearest, PointshellOptions, sample_pointshell};
use mortise_brep::{Curve, Shape};

/// Chord error between neighbouring samples inside a face, mm.
pub const SAMPLE_ERROR_MM: f64 = 0.01;
/// Smallest and largest spacing of samples inside faces, mm.
const FACE_SPACING_MM: [f64; 2] = [0.8, 8.0];
/// Smallest and largest spacing of samples along edges, mm.
const EDGE_SPACING_MM: [f64; 2] = [0.25, 2.0];
/// Share of the box's diagonal that is the spacing inside faces and along edges, between these limits.
const SHARES: [f64; 2] = [1.0 / 40.0, 1.0 / 160.0];
/// Cells of the cached distances along the box's diagonal.
const CELLS: f64 = 160.0;
/// Most cached cells of a shape: about 40 MB.
const MOST_CELLS: usize = 1_000_000;

/// Distance below which the line to the nearest point has no reliable direction, mm.
const ON_SURFACE_MM: f64 = 1e-6;

/// A sample of a shape's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position, mm.
    pub position: DVec3,
    /// Outward unit normal inside a face; `None` on an edge or corner.
    pub normal: Option<DVec3>,
    /// Face it lies on (one of them on an edge).
    pub face: u32,
}

/// A sphere that contains a consecutive range of samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub center: DVec3,
    pub radius: f64,
    /// First child, the second follows its subtree; of a leaf the sample.
    pub first: u32,
    /// Second child; `u32::MAX` for a leaf.
    pub second: u32,
}

impl Node {
    pub fn is_leaf(&self) -> bool {
        self.second == u32::MAX
    }
}

/// A shape prepared for clearance queries.
pub struct Body {
    surface: ExactSurface,
    samples: Vec<Sample>,
    nodes: Vec<Node>,
    low: DVec3,
    high: DVec3,
    cell_mm: f64,
    cells: Mutex<HashMap<[i32; 3], f64>>,
}

impl Body {
    /// Prepares `shape`; `None` for a shape without triangles.
    pub fn new(shape: &Shape) -> Option<Self> {
        let surface = ExactSurface::new(shape);
        let mesh = &surface.shape().mesh;
        let used = || mesh.triangles.iter().flatten().map(|&v| mesh.vertices[v as usize]);
        let (low, high) = used().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        if !low.is_finite() || !high.is_finite() {
            return None;
        }
        let size = low.distance(high).max(1e-3);
        let samples = sample(&surface, size);
        let mut order: Vec<u32> = (0..samples.len() as u32).collect();
        let mut nodes = Vec::with_capacity(2 * samples.len());
        if !order.is_empty() {
            split(&samples, &mut order, &mut nodes);
        }
        let chord = surface.chord_error_mm();
        Some(Self {
            low: low - chord,
            high: high + chord,
            cell_mm: size / CELLS,
            cells: Mutex::default(),
            surface,
            samples,
            nodes,
        })
    }

    /// The exact surface.
    pub fn surface(&self) -> &ExactSurface {
        &self.surface
    }

    /// The samples.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Box of the shape: low and high corner, mm.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        (self.low, self.high)
    }

    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Nearest point of the exact surface; infinitely far for a shape without triangles.
    pub(crate) fn nearest(&self, p: DVec3) -> Option<Nearest> {
        self.surface.nearest(p)
    }

    /// Signed distance of `p`, mm, negative inside.
    pub(crate) fn distance(&self, p: DVec3) -> f64 {
        self.nearest(p).map_or(f64::INFINITY, |n| n.distance)
    }

    /// Direction in which the signed distance of `p` grows, unit length: from its nearest point, or the face's normal where it lies on the surface; zero
    /// where that is unknown.
    pub(crate) fn outward(&self, p: DVec3) -> DVec3 {
        let Some(near) = self.nearest(p) else {
            return DVec3::ZERO;
        };
        if near.distance.abs() > ON_SURFACE_MM {
            return ((p - near.point) * near.distance.signum()).normalize_or_zero();
        }
        self.face_normal(near.face, p).unwrap_or(DVec3::ZERO)
    }

    /// Outward unit normal of a face at the foot of `p`; `None` for a free-form face.
    pub(crate) fn face_normal(&self, face: u32, p: DVec3) -> Option<DVec3> {
        let face = self.surface.shape().faces.get(face as usize)?;
        let (_, natural) = face.surface.distance(p)?;
        Some(if face.reversed { -natural } else { natural })
    }

    /// Whether the signed distance of `p` exceeds `least`. The distance changes by no more than its point moves, so the distance at the middle of the
    /// cell of `p`, which is kept, decides most questions.
    pub(crate) fn exceeds(&self, p: DVec3, least: f64) -> bool {
        // Distance to the box, a lower bound outside of it.
        let off = p.clamp(self.low, self.high).distance(p);
        if off > 0.0 && off > least {
            return true;
        }
        let cell = (p / self.cell_mm).floor();
        let middle = (cell + 0.5) * self.cell_mm;
        let key = cell.to_array().map(|c| c as i32);
        let Ok(mut cells) = self.cells.lock() else {
            return self.distance(p) > least;
        };
        let at_middle = match cells.get(&key) {
            Some(&known) => known,
            None => {
                let found = self.distance(middle);
                if cells.len() < MOST_CELLS {
                    cells.insert(key, found);
                }
                found
            }
        };
        drop(cells);
        let apart = p.distance(middle);
        if at_middle - apart > least {
            return true;
        }
        if at_middle + apart <= least {
            return false;
        }
        self.distance(p) > least
    }
}

fn sample(surface: &ExactSurface, size: f64) -> Vec<Sample> {
    let [inside, along] = [
        (size * SHARES[0]).clamp(FACE_SPACING_MM[0], FACE_SPACING_MM[1]),
        (size * SHARES[1]).clamp(EDGE_SPACING_MM[0], EDGE_SPACING_MM[1]),
    ];
    let mut options = PointshellOptions::everywhere(SAMPLE_ERROR_MM, inside);
    options.least_spacing_mm = along;
    let shell = sample_pointshell(surface, &options);
    let mut samples: Vec<Sample> = (shell.points.iter().enumerate())
        .map(|(i, p)| Sample {
            position: p.position,
            normal: (i < shell.face_points).then_some(p.normal),
            face: u32::from(p.face),
        })
        .collect();
    for edge in &surface.shape().edges {
        let Some(&face) = edge.faces.first() else { continue };
        for pair in edge.polyline.windows(2) {
            let steps = (pair[0].distance(pair[1]) / along).ceil().clamp(1.0, 1e4) as usize;
            for i in 0..steps {
                let chord = pair[0].lerp(pair[1], i as f64 / steps as f64);
                let position = match edge.curve {
                    Curve::Line { origin, direction } => origin + direction * (chord - origin).dot(direction),
                    Curve::Circle { frame, radius } => {
                        let across = (chord - frame.origin).reject_from_normalized(frame.z);
                        across.try_normalize().map_or(chord, |out| frame.origin + out * radius)
                    }
                    Curve::Other => surface.nearest(chord).map_or(chord, |n| n.point),
                };
                samples.push(Sample { position, normal: None, face });
            }
        }
    }
    samples
}

/// Builds the tree of `order` in preorder and returns the index of its root. Splits along the longest axis at the median.
fn split(samples: &[Sample], order: &mut [u32], nodes: &mut Vec<Node>) -> u32 {
    let at = nodes.len() as u32;
    let position = |i: u32| samples[i as usize].position;
    if let [only] = order {
        nodes.push(Node { center: position(*only), radius: 0.0, first: *only, second: u32::MAX });
        return at;
    }
    let (low, high) = order.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &i| {
        (low.min(position(i)), high.max(position(i)))
    });
    let center = (low + high) / 2.0;
    let radius = order.iter().map(|&i| position(i).distance(center)).fold(0.0, f64::max);
    nodes.push(Node { center, radius, first: 0, second: 0 });
    let extent = high - low;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    let half = order.len() / 2;
    order.select_nth_unstable_by(half, |&a, &b| position(a)[axis].total_cmp(&position(b)[axis]));
    let (left, right) = order.split_at_mut(half);
    let first = split(samples, left, nodes);
    let second = split(samples, right, nodes);
    nodes[at as usize].first = first;
    nodes[at as usize].second = second;
    at
}

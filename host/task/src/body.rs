//! A shape prepared for clearance queries: its exact surface, and samples of that surface under a tree of spheres.
//!
//! Samples inside faces are as dense as a chord error of [`SAMPLE_ERROR_MM`] requires, samples along edges no farther apart than a share of the shape's
//! size. Lengths are mm, in the shape's frame. Cost: sampling is proportional to area over spacing²; a tree over n samples has 2n − 1 nodes.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec3;
use mortise_bake::{ExactSurface, Nearest, PointshellOptions, sample_pointshell};
use mortise_brep::{Curve, Face, Shape, Surface};

/// Chord error between neighbouring samples inside a face, mm.
pub const SAMPLE_ERROR_MM: f64 = 0.01;
/// Smallest and largest spacing of samples inside faces, mm.
const FACE_SPACING_MM: [f64; 2] = [0.8, 8.0];
/// Smallest and largest spacing of samples along edges, mm.
const EDGE_SPACING_MM: [f64; 2] = [0.25, 2.0];
/// Share of the box's diagonal that is the spacing inside faces and along edges, between these limits.
const SHARES: [f64; 2] = [1.0 / 40.0, 1.0 / 160.0];
/// Most kept distances of a shape: 8 MB.
const CELLS: f64 = 2e6;
/// Margin of the kept distances around the shape's box, as a share of its diagonal.
const MARGIN: f64 = 0.1;

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
    /// Tree over the samples that can be the first to meet another part.
    nodes: Vec<Node>,
    low: DVec3,
    high: DVec3,
    kept: Kept,
}

/// Distances at the middles of cells, evaluated when first needed.
struct Kept {
    origin: DVec3,
    cell_mm: f64,
    counts: [usize; 3],
    /// Bits of an `f32`; NaN: not known yet.
    values: Vec<AtomicU32>,
}

impl Kept {
    fn new(low: DVec3, high: DVec3) -> Self {
        let margin = MARGIN * low.distance(high);
        let (origin, extent) = (low - margin, high - low + 2.0 * margin);
        let cell_mm = (extent.element_product() / CELLS).cbrt();
        let counts = extent.to_array().map(|e| (e / cell_mm).ceil().max(1.0) as usize);
        let values = (0..counts.iter().product()).map(|_| AtomicU32::new(f32::NAN.to_bits())).collect();
        Self { origin, cell_mm, counts, values }
    }

    /// Index of the cell of `p` and its middle; `None` outside.
    fn cell(&self, p: DVec3) -> Option<(usize, DVec3)> {
        let at = ((p - self.origin) / self.cell_mm).floor();
        let inside = |i: usize| at[i] >= 0.0 && at[i] < self.counts[i] as f64;
        if !(inside(0) && inside(1) && inside(2)) {
            return None;
        }
        let index = (at.z as usize * self.counts[1] + at.y as usize) * self.counts[0] + at.x as usize;
        Some((index, self.origin + (at + 0.5) * self.cell_mm))
    }
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
        let meets = |s: &Sample| s.normal.is_none() || surface.shape().faces.get(s.face as usize).is_none_or(bulges);
        let mut order: Vec<u32> = (0..samples.len() as u32).filter(|&i| meets(&samples[i as usize])).collect();
        let mut nodes = Vec::with_capacity(2 * samples.len());
        if !order.is_empty() {
            split(&samples, &mut order, &mut nodes);
        }
        let chord = surface.chord_error_mm();
        Some(Self {
            low: low - chord,
            high: high + chord,
            kept: Kept::new(low, high),
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
        let Some((index, middle)) = self.kept.cell(p) else {
            return self.distance(p) > least;
        };
        let slot = &self.kept.values[index];
        let mut known = f32::from_bits(slot.load(Ordering::Relaxed));
        if known.is_nan() {
            known = self.distance(middle) as f32;
            slot.store(known.to_bits(), Ordering::Relaxed);
        }
        // The value is rounded to seven digits.
        let at_middle = f64::from(known);
        let rounding = at_middle.abs() * 1e-6;
        let apart = p.distance(middle) + rounding;
        if at_middle - apart > least {
            return true;
        }
        if at_middle + apart <= least {
            return false;
        }
        self.distance(p) > least
    }
}

/// Whether the inside of a face can be what first meets another part: it is convex in some direction. Planes, bores and sockets are met by the edges and
/// bulging faces of the other part, which has samples there.
fn bulges(face: &Face) -> bool {
    match face.surface {
        Surface::Plane { .. } => false,
        Surface::Cylinder { .. } | Surface::Cone { .. } | Surface::Sphere { .. } => !face.reversed,
        Surface::Torus { .. } | Surface::Spline => true,
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
    // Points along edges are sampled below, at even spacing.
    let mut samples: Vec<Sample> = (shell.points.iter().take(shell.face_points).map(|p| (p, Some(p.normal))))
        .chain(shell.points.iter().skip(shell.face_points + shell.edge_points).map(|p| (p, None)))
        .map(|(p, normal)| Sample { position: p.position, normal, face: u32::from(p.face) })
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

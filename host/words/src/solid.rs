//! Overlap and swept overlap of two placed shapes, on their exact surfaces.
//!
//! Sample points of each shape (vertices, edges, facets, a fraction of its size apart) are moved against the exact signed distance of the other
//! ([`ExactSurface`]). Along a straight sweep each point's line is cut where it crosses the other's tessellation, and the pieces are judged by the
//! exact distance, so a peg that slides in a bore with less clearance than the tessellation's error is free. A piece is skipped where the distance
//! at its middle exceeds half its length.
//!
//! Limits: overlap between sample points is not seen: bars that cross within a sample's spacing, with no sample inside. Overlap up to
//! [`TOLERANCE_MM`] counts as contact.
//!
//! Cost: a query takes one to a few microseconds; a shape has at most [`MOST_SAMPLES`] sample points.

use glam::{DAffine3, DVec2, DVec3};
use mortise_bake::ExactSurface;
use mortise_brep::Shape;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

/// Largest overlap that counts as contact, mm: files round coordinates to seven digits, recognised splines err by up to a micrometre.
pub const TOLERANCE_MM: f64 = 5e-3;
/// Largest number of sample points of a shape.
pub const MOST_SAMPLES: usize = 6000;
/// Overlap at which a sliding point has reached its stop, mm.
const STOP_MM: f64 = 1e-5;

/// A shape prepared for queries, in its own frame.
pub struct Solid {
    exact: ExactSurface,
    samples: Vec<DVec3>,
    low: DVec3,
    high: DVec3,
}

impl Solid {
    /// Prepares `shape`.
    pub fn new(shape: &Shape) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &v in &shape.mesh.vertices {
            low = low.min(v);
            high = high.max(v);
        }
        Self {
            exact: ExactSurface::new(shape),
            samples: samples(shape, low.distance(high)),
            low,
            high,
        }
    }

    /// Box of the placed shape: of the corners of its own box, so not smaller than the exact one.
    pub fn bounds(&self, placement: &DAffine3) -> (DVec3, DVec3) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in 0..8 {
            let pick = |axis: usize| {
                if corner >> axis & 1 == 0 {
                    self.low[axis]
                } else {
                    self.high[axis]
                }
            };
            let p = placement.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
            low = low.min(p);
            high = high.max(p);
        }
        (low, high)
    }

    /// Signed distance of a point in the shape's frame, mm; beyond its box a lower bound.
    fn distance(&self, p: DVec3) -> f64 {
        let outside = (self.low - p).max(p - self.high).max(DVec3::ZERO).length();
        if outside > 1.0 {
            return outside;
        }
        self.exact.nearest(p).map_or(f64::INFINITY, |n| n.distance)
    }

    /// Deepest sample point of `other` in this solid, mm (0: none); `other_in_this`: its placement in this shape's frame.
    fn depth_of(&self, other: &Self, other_in_this: &DAffine3) -> f64 {
        let mut deepest: f64 = 0.0;
        for &sample in &other.samples {
            let p = other_in_this.transform_point3(sample);
            if p.cmpge(self.low).all() && p.cmple(self.high).all() {
                deepest = deepest.max(-self.distance(p));
            }
        }
        deepest
    }

    /// First time at which a sample point of `other`, moving along `direction` (unit, this shape's frame) by at most `limit`, is deeper than
    /// allowed.
    fn first_hit(&self, other: &Self, other_in_this: &DAffine3, direction: DVec3, limit: f64) -> f64 {
        let columns = Columns::new(self.exact.shape(), direction);
        let mut best = limit;
        let mut crossings = Vec::new();
        for &sample in &other.samples {
            let start = other_in_this.transform_point3(sample);
            let uv = columns.flat(start);
            if uv.cmplt(columns.low).any() || uv.cmpgt(columns.high).any() {
                continue;
            }
            let w = start.dot(direction);
            crossings.clear();
            columns.crossings(uv, &mut crossings);
            crossings.retain(|&c| c > w && c < w + best);
            crossings.sort_by(f64::total_cmp);
            let mut from = w.max(columns.near);
            let ends = crossings.iter().copied().chain([f64::min(w + best, columns.far)]);
            for to in ends {
                if to - from > 1e-6
                    && let Some(hit) = self.piece(start, direction, from - w, to - w)
                {
                    best = best.min(hit);
                    break;
                }
                from = from.max(to);
            }
        }
        best
    }

    /// The same on one piece of a point's line, between its crossings of the tessellation.
    fn piece(&self, start: DVec3, direction: DVec3, from: f64, to: f64) -> Option<f64> {
        let at = |t: f64| self.distance(start + direction * t);
        let middle = (from + to) / 2.0;
        let half = (to - from) / 2.0;
        let d = at(middle);
        if d > half - TOLERANCE_MM {
            return None;
        }
        let tried = [0.02, 0.25, 0.5, 0.75, 0.98].map(|share| from + share * (to - from));
        let hit = tried.into_iter().find(|&t| at(t) < -TOLERANCE_MM)?;
        // A point that starts deeper, by the file's own overlap, may stay as deep.
        let allowed = (-at(0.0) + 1e-3).max(TOLERANCE_MM);
        if allowed > TOLERANCE_MM && !tried.into_iter().any(|t| at(t) < -allowed) {
            return None;
        }
        let bisect = |depth: f64| {
            let (mut free, mut deep) = (from, hit);
            for _ in 0..40 {
                let t = (free + deep) / 2.0;
                if at(t) < -depth { deep = t } else { free = t }
            }
            free
        };
        if at(from) < -STOP_MM {
            return Some(bisect(allowed));
        }
        Some(bisect(STOP_MM))
    }
}

/// Depth to which two placed solids overlap at their sample points, mm; 0 when they do not.
pub fn overlap(a: (&Solid, &DAffine3), b: (&Solid, &DAffine3)) -> f64 {
    if !boxes_meet(a.0.bounds(a.1), b.0.bounds(b.1), 0.0) {
        return 0.0;
    }
    let b_in_a = a.1.inverse() * *b.1;
    a.0.depth_of(b.0, &b_in_a).max(b.0.depth_of(a.0, &b_in_a.inverse()))
}

/// Travel of `moving` along the unit vector `direction`, at most `limit`, until it would overlap `fixed`, mm.
pub fn travel(moving: (&Solid, &DAffine3), fixed: (&Solid, &DAffine3), direction: DVec3, limit: f64) -> f64 {
    let (mut low, mut high) = moving.0.bounds(moving.1);
    low = low.min(low + direction * limit);
    high = high.max(high + direction * limit);
    if !boxes_meet((low, high), fixed.0.bounds(fixed.1), 0.0) {
        return limit;
    }
    let moving_in_fixed = fixed.1.inverse() * *moving.1;
    let in_fixed = fixed.1.inverse().transform_vector3(direction);
    let free = fixed.0.first_hit(moving.0, &moving_in_fixed, in_fixed, limit);
    let in_moving = moving.1.inverse().transform_vector3(-direction);
    moving.0.first_hit(fixed.0, &moving_in_fixed.inverse(), in_moving, free)
}

/// Whether two boxes meet when one is grown by `margin`.
pub fn boxes_meet(a: (DVec3, DVec3), b: (DVec3, DVec3), margin: f64) -> bool {
    a.0.cmple(b.1 + margin).all() && b.0.cmple(a.1 + margin).all()
}

/// Triangles of a shape seen along a direction, to find what a line along it crosses.
struct Columns {
    u: DVec3,
    v: DVec3,
    low: DVec2,
    high: DVec2,
    near: f64,
    far: f64,
    tree: Bvh,
    /// Corners as (u, v, w).
    corners: Vec<[DVec3; 3]>,
}

impl Columns {
    fn new(shape: &Shape, w: DVec3) -> Self {
        let u = w.any_orthonormal_vector();
        let v = w.cross(u);
        let flat: Vec<DVec3> = shape
            .mesh
            .vertices
            .iter()
            .map(|p| DVec3::new(p.dot(u), p.dot(v), p.dot(w)))
            .collect();
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &p in &flat {
            low = low.min(p);
            high = high.max(p);
        }
        let corners: Vec<[DVec3; 3]> = shape
            .mesh
            .triangles
            .iter()
            .map(|t| t.map(|i| flat[i as usize]))
            .collect();
        let boxes: Vec<Aabb> = corners
            .iter()
            .map(|&[a, b, c]| {
                let (low, high) = (a.min(b).min(c), a.max(b).max(c));
                Aabb::new([low.x, low.y, 0.0].into(), [high.x, high.y, 0.0].into())
            })
            .collect();
        Self {
            u,
            v,
            low: low.truncate() - TOLERANCE_MM,
            high: high.truncate() + TOLERANCE_MM,
            near: low.z - TOLERANCE_MM,
            far: high.z + TOLERANCE_MM,
            tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
            corners,
        }
    }

    fn flat(&self, p: DVec3) -> DVec2 {
        DVec2::new(p.dot(self.u), p.dot(self.v))
    }

    /// Heights at which the line through `p` crosses triangles.
    fn crossings(&self, p: DVec2, out: &mut Vec<f64>) {
        const NEAR: f64 = 1e-9;
        let point = Aabb::new([p.x - NEAR, p.y - NEAR, 0.0].into(), [p.x + NEAR, p.y + NEAR, 0.0].into());
        for leaf in self.tree.intersect_aabb(&point) {
            let [a, b, c] = self.corners[leaf as usize];
            let (ab, ac) = (b.truncate() - a.truncate(), c.truncate() - a.truncate());
            let area = ab.perp_dot(ac);
            if area.abs() < 1e-12 {
                continue;
            }
            let ap = p - a.truncate();
            let (s, t) = (ap.perp_dot(ac) / area, ab.perp_dot(ap) / area);
            if s >= -NEAR && t >= -NEAR && s + t <= 1.0 + NEAR {
                out.push(a.z + s * (b.z - a.z) + t * (c.z - a.z));
            }
        }
    }
}

/// Vertices, points along edges and points of facets, about a sixtieth of the shape's size apart.
fn samples(shape: &Shape, size: f64) -> Vec<DVec3> {
    let mut spacing = f64::max(size / 60.0, 0.05);
    loop {
        let mut out = shape.mesh.vertices.clone();
        for edge in &shape.edges {
            for pair in edge.polyline.windows(2) {
                let n = (pair[0].distance(pair[1]) / spacing).floor() as usize;
                out.extend((1..=n).map(|i| pair[0].lerp(pair[1], i as f64 / (n + 1) as f64)));
            }
        }
        for (triangle, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
            // Inside facets of curved faces there are no points of the surface.
            let flat = matches!(shape.faces[face as usize].surface, mortise_brep::Surface::Plane { .. });
            if flat {
                facet(triangle.map(|v| shape.mesh.vertices[v as usize]), spacing, &mut out);
            }
        }
        if out.len() <= MOST_SAMPLES || spacing > size {
            return out;
        }
        if shape.mesh.vertices.len() * 5 > MOST_SAMPLES * 4 && spacing > size / 20.0 {
            // The tessellation alone has too many: every n-th vertex, evenly, is enough of it.
            let step = out.len().div_ceil(MOST_SAMPLES);
            return out.into_iter().step_by(step).collect();
        }
        spacing *= 1.3;
    }
}

fn facet([a, b, c]: [DVec3; 3], spacing: f64, out: &mut Vec<DVec3>) {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let n = (longest / spacing).ceil() as usize;
    for i in 1..n {
        for j in 1..n - i {
            let (s, t) = (i as f64 / n as f64, j as f64 / n as f64);
            out.push(a + (b - a) * s + (c - a) * t);
        }
    }
}

//! The inside of a part as a graph: points deep in the material and segments between them that stay in it.

use glam::DVec3;
use mortise_brep::{Curve, Shape, Surface};

use crate::body::Body;
use crate::line::{Line, same_line};

/// Cells along the diagonal of the box at first, most divisions, and most cells of a level.
const FIRST: f64 = 16.0;
const LEVELS: usize = 3;
const MOST_CELLS: usize = 8_000;
/// Most points that are made deeper by an ascent.
const BALLS: usize = 8;
/// Pieces in which the segments of such points are looked at.
const PIECES: u32 = 8;
/// Most points on axes.
const AXIAL: usize = 32;
/// Last step of such an ascent, mm.
const LAST_MM: f64 = 1e-4;
/// Smallest depth of a segment, mm.
const LEAST_MM: f64 = 0.02;

/// Points inside a part, in its frame, and segments between them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Skeleton {
    pub points: Vec<DVec3>,
    /// Depth of each point below the surface, mm.
    pub depths: Vec<f64>,
    pub segments: Vec<Segment>,
    /// Index of the first point on the axis of circles, halfway between two of them: middles of heads, collars and discs, to the end of the points.
    pub axial: usize,
}

/// A segment inside the material.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment {
    pub ends: [u32; 2],
    /// No point of it is less deep, mm.
    pub depth: f64,
}

/// The skeleton of a body, as fine as its number of cells allows. The depth changes by no more than its point moves, which bounds it on the segments.
pub(crate) fn skeleton(body: &Body) -> Skeleton {
    let (low, high) = body.bounds();
    let mut cell = low.distance(high) / FIRST;
    let counts = ((high - low) / cell).ceil().max(DVec3::ONE);
    let middle = |at: &[i32; 3], cell: f64| low + DVec3::from_array(at.map(|i| f64::from(i) + 0.5)) * cell;
    let with_depth = |at: [i32; 3], cell: f64| (at, -body.distance_once(middle(&at, cell)));
    let mut cells: Vec<([i32; 3], f64)> = Vec::new();
    for x in 0..counts.x as i32 {
        for y in 0..counts.y as i32 {
            cells.extend((0..counts.z as i32).map(|z| with_depth([x, y, z], cell)));
        }
    }
    for _ in 0..LEVELS {
        let partly: Vec<[i32; 3]> = (cells.iter())
            .filter(|c| c.1 > -0.87 * cell)
            .map(|c| c.0)
            .collect();
        if partly.len() * 8 > MOST_CELLS {
            break;
        }
        cell /= 2.0;
        cells = partly
            .iter()
            .flat_map(|at| (0..8).map(move |c| [0, 1, 2].map(|i| 2 * at[i] + ((c >> i) & 1))))
            .map(|at| with_depth(at, cell))
            .collect();
    }
    let mut found = Skeleton::default();
    let mut index = std::collections::HashMap::new();
    for (at, depth) in cells.into_iter().filter(|c| c.1 > 0.0) {
        index.insert(at, found.points.len() as u32);
        found.points.push(middle(&at, cell));
        found.depths.push(depth);
    }
    for (at, &i) in &index {
        for axis in 0..3 {
            let mut next = *at;
            next[axis] += 1;
            if let Some(&j) = index.get(&next) {
                found.join(i, j);
            }
        }
    }
    let centres: Vec<DVec3> = (body.surface().shape().faces.iter())
        .filter_map(|f| match &f.surface {
            Surface::Sphere { frame, .. } => Some(frame.origin),
            _ => None,
        })
        .collect();
    // The deepest places: centres of the largest balls inside.
    let mut order: Vec<usize> = (0..found.points.len()).collect();
    order.sort_by(|&a, &b| found.depths[b].total_cmp(&found.depths[a]));
    let mut balls: Vec<(DVec3, f64)> = Vec::new();
    for i in order {
        if balls.len() >= BALLS {
            break;
        }
        let p = found.points[i];
        if balls.iter().all(|(c, r)| c.distance(p) > *r) {
            let centre = centres.iter().copied().find(|c| c.distance(p) < cell);
            balls.push(match centre {
                Some(c) => (c, -body.distance_once(c)),
                None => ascend(body, p, cell),
            });
        }
    }
    for (p, depth) in balls {
        found.add(body, p, depth, cell);
    }
    found.axial = found.points.len();
    for p in between_circles(body.surface().shape()) {
        let depth = -body.distance_once(p);
        if depth > 0.0 {
            found.add(body, p, depth, cell);
        }
    }
    // Order of a map is not repeatable.
    found
        .segments
        .sort_by(|a, b| b.depth.total_cmp(&a.depth).then(a.ends.cmp(&b.ends)));
    found
}

impl Skeleton {
    /// Adds a point, with segments to those nearby, whose depth is looked at along their length.
    fn add(&mut self, body: &Body, p: DVec3, depth: f64, cell: f64) {
        let id = self.points.len() as u32;
        self.points.push(p);
        self.depths.push(depth);
        for j in 0..id {
            let (q, end) = (self.points[j as usize], self.depths[j as usize]);
            if q.distance(p) >= 2.0 * cell {
                continue;
            }
            let inside = |i: u32| -body.distance_once(p.lerp(q, f64::from(i) / f64::from(PIECES)));
            let depths: Vec<f64> = (std::iter::once(depth))
                .chain((1..PIECES).map(inside))
                .chain([end])
                .collect();
            let least = depths
                .windows(2)
                .map(|w| w[0] + w[1])
                .fold(f64::INFINITY, f64::min);
            self.connect([id, j], (least - p.distance(q) / f64::from(PIECES)) / 2.0);
        }
    }

    /// A segment whose depth is known from that of its ends alone.
    fn join(&mut self, i: u32, j: u32) {
        let [a, b] = [i, j].map(|k| k as usize);
        let depth = (self.depths[a] + self.depths[b] - self.points[a].distance(self.points[b])) / 2.0;
        self.connect([i, j], depth);
    }

    fn connect(&mut self, ends: [u32; 2], depth: f64) {
        if depth > LEAST_MM {
            self.segments.push(Segment { ends, depth });
        }
    }
}

/// Places halfway between the middles of circles that follow each other on an axis, of the axes with most circles first.
fn between_circles(shape: &Shape) -> Vec<DVec3> {
    let mut axes: Vec<(Line, Vec<f64>)> = Vec::new();
    for edge in &shape.edges {
        let Curve::Circle { frame, .. } = edge.curve else {
            continue;
        };
        let line = Line {
            point: frame.origin,
            direction: frame.z,
        };
        let known = axes.iter().position(|(known, _)| same_line(*known, line));
        let at = known.unwrap_or_else(|| {
            axes.push((line, Vec::new()));
            axes.len() - 1
        });
        let (axis, heights) = &mut axes[at];
        heights.push((frame.origin - axis.point).dot(axis.direction));
    }
    axes.sort_by_key(|(_, heights)| std::cmp::Reverse(heights.len()));
    let mut found = Vec::new();
    for (axis, mut heights) in axes {
        heights.sort_by(f64::total_cmp);
        heights.dedup_by(|a, b| (*a - *b).abs() < LEAST_MM);
        let middles = heights.windows(2).map(|w| (w[0] + w[1]) / 2.0);
        found.extend(middles.map(|h| axis.point + axis.direction * h));
    }
    found.truncate(AXIAL);
    found
}

/// The deepest place near `p`, by ever smaller steps, and its depth.
fn ascend(body: &Body, mut p: DVec3, cell: f64) -> (DVec3, f64) {
    let mut depth = -body.distance_once(p);
    let mut step = cell / 2.0;
    while step > LAST_MM {
        let mut best = None;
        for d in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|d| [d, -d]) {
            let q = p + d * step;
            let there = -body.distance_once(q);
            if there > depth + 1e-9 {
                (best, depth) = (Some(q), there);
            }
        }
        match best {
            Some(q) => p = q,
            None => step /= 2.0,
        }
    }
    (p, depth)
}

//! Where the nearest face is certain: a tree over a shape's triangles that tells whether a ball meets those of one face alone.
//!
//! The nearest point of the exact surface to any point of a cell lies within a known distance of the cell's middle. Where all triangles within that distance (and the chord error) are those of one
//! face, the nearest point is inside that face, and the distance is that of its plane, cylinder, cone, sphere or torus: some nanoseconds instead of microseconds.

use glam::DVec3;
use mortise_brep::Mesh;

/// A node: box of its triangles, and their face where they have one in common.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// `u32::MAX`: several.
    face: u32,
    /// First triangle of the order and number of them; of an inner node its second child (the first follows), and 0.
    first: u32,
    count: u32,
}

/// Triangles of a leaf.
const LEAF: usize = 4;

/// The tree.
#[derive(Debug)]
pub(crate) struct Hints {
    nodes: Vec<Node>,
    corners: Vec<[DVec3; 3]>,
    faces: Vec<u32>,
}

impl Hints {
    pub fn new(mesh: &Mesh) -> Self {
        let corners: Vec<[DVec3; 3]> = (mesh.triangles.iter())
            .map(|t| t.map(|v| mesh.vertices[v as usize]))
            .collect();
        let mut order: Vec<u32> = (0..corners.len() as u32).collect();
        let mut nodes = Vec::new();
        if !order.is_empty() {
            split(&corners, &mesh.triangle_face, &mut order, 0, &mut nodes);
        }
        Self {
            nodes,
            faces: order.iter().map(|&i| mesh.triangle_face[i as usize]).collect(),
            corners: order.iter().map(|&i| corners[i as usize]).collect(),
        }
    }

    /// Whether no triangle of another face than `face` is within `radius` of `p`.
    pub fn alone(&self, p: DVec3, radius: f64, face: u32) -> bool {
        let mut stack = vec![0u32];
        while let Some(i) = stack.pop() {
            let Some(node) = self.nodes.get(i as usize) else {
                continue;
            };
            if node.face == face || p.clamp(node.low, node.high).distance(p) > radius {
                continue;
            }
            if node.count == 0 {
                stack.extend([i + 1, node.first]);
                continue;
            }
            let range = node.first as usize..(node.first + node.count) as usize;
            let other = |t: usize| self.faces[t] != face && distance(p, self.corners[t]) <= radius;
            if range.into_iter().any(other) {
                return false;
            }
        }
        true
    }
}

/// Builds the tree of `order`, the part of the whole order from `start`, in preorder.
fn split(corners: &[[DVec3; 3]], faces: &[u32], order: &mut [u32], start: u32, nodes: &mut Vec<Node>) -> u32 {
    let at = nodes.len() as u32;
    let mut node = Node {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        face: faces[order[0] as usize],
        first: start,
        count: order.len() as u32,
    };
    for &t in order.iter() {
        for c in corners[t as usize] {
            (node.low, node.high) = (node.low.min(c), node.high.max(c));
        }
        if faces[t as usize] != node.face {
            node.face = u32::MAX;
        }
    }
    nodes.push(node);
    if order.len() > LEAF {
        let extent = node.high - node.low;
        let axis = (0..3)
            .max_by(|&a, &b| extent[a].total_cmp(&extent[b]))
            .unwrap_or(0);
        let key = |t: u32| corners[t as usize].iter().map(|c| c[axis]).sum::<f64>();
        let half = order.len() / 2;
        order.select_nth_unstable_by(half, |&a, &b| key(a).total_cmp(&key(b)));
        let (left, right) = order.split_at_mut(half);
        split(corners, faces, left, start, nodes);
        let second = split(corners, faces, right, start + half as u32, nodes);
        nodes[at as usize].first = second;
        nodes[at as usize].count = 0;
    }
    at
}

/// Distance of a point from a triangle (Ericson 2005, 5.1.5).
fn distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.length();
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return bp.length();
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return p.distance(a + ab * (d1 / (d1 - d3)));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return cp.length();
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return p.distance(a + ac * (d2 / (d2 - d6)));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return p.distance(b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))));
    }
    let sum = va + vb + vc;
    p.distance(a + ab * (vb / sum) + ac * (vc / sum))
}

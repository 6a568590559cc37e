//! Generalised winding number: inside or outside, also for shells with gaps.
//!
//! w(p) = Σ Ω_t(p) / 4π over all triangles: 1 inside and 0 outside a closed mesh, between these near a gap, so that w > ½ is the best estimate. Far
//! clusters of triangles are approximated by dipoles (Barill, Dickson, Schmidt, Levin, Jacobson 2018, "Fast Winding Numbers for Soups and Clouds",
//! first order): cost grows with the logarithm of the number of triangles.

use std::f64::consts::PI;

use glam::DVec3;
use mortise_brep::Mesh;

/// Distance, in radii, from which a cluster is approximated by a dipole: first-order error below 0.02 for closed meshes (property-tested).
const FAR: f64 = 2.5;
const LEAF: usize = 8;

struct Node {
    center: DVec3,
    radius: f64,
    /// Sum of area vectors, mm².
    dipole: DVec3,
    first: u32,
    count: u32,
    /// Index after the whole subtree (preorder).
    skip: u32,
}

/// Triangles in a tree of dipoles.
pub(crate) struct WindingTree {
    nodes: Vec<Node>,
    triangles: Vec<[DVec3; 3]>,
}

impl WindingTree {
    /// Builds the tree over all triangles of `mesh`.
    pub fn new(mesh: &Mesh) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            triangles: mesh
                .triangles
                .iter()
                .map(|t| t.map(|v| mesh.vertices[v as usize]))
                .collect(),
        };
        let count = tree.triangles.len();
        if count > 0 {
            tree.build(0, count);
        }
        tree
    }

    fn build(&mut self, first: usize, count: usize) {
        let run = &mut self.triangles[first..first + count];
        let (mut area, mut weighted, mut dipole) = (0.0, DVec3::ZERO, DVec3::ZERO);
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for t in run.iter() {
            let vector = (t[1] - t[0]).cross(t[2] - t[0]) / 2.0;
            area += vector.length();
            weighted += (t[0] + t[1] + t[2]) / 3.0 * vector.length();
            dipole += vector;
            lo = lo.min((t[0] + t[1] + t[2]) / 3.0);
            hi = hi.max((t[0] + t[1] + t[2]) / 3.0);
        }
        let center = if area > 0.0 { weighted / area } else { run[0][0] };
        let radius = run
            .iter()
            .flatten()
            .map(|v| v.distance(center))
            .fold(0.0, f64::max);
        let index = self.nodes.len();
        self.nodes.push(Node {
            center,
            radius,
            dipole,
            first: first as u32,
            count: count as u32,
            skip: 0,
        });
        if count > LEAF {
            let extent = hi - lo;
            let axis = (0..3)
                .max_by(|&a, &b| extent[a].total_cmp(&extent[b]))
                .unwrap_or(0);
            let key = |t: &[DVec3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
            let half = count / 2;
            run.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)));
            self.build(first, half);
            self.build(first + half, count - half);
        }
        self.nodes[index].skip = self.nodes.len() as u32;
    }

    /// Winding number at `p`.
    pub fn at(&self, p: DVec3) -> f64 {
        let mut sum = 0.0;
        let mut angles = Angles::default();
        let mut i = 0;
        while i < self.nodes.len() {
            let node = &self.nodes[i];
            let d = node.center - p;
            let distance = d.length();
            if distance > FAR * node.radius {
                sum += d.dot(node.dipole) / (distance * distance * distance);
                i = node.skip as usize;
            } else {
                if node.skip as usize == i + 1 {
                    for t in &self.triangles[node.first as usize..][..node.count as usize] {
                        angles.add(half_solid_angle(t, p));
                    }
                }
                i += 1;
            }
        }
        (sum + 2.0 * angles.sum()) / (4.0 * PI)
    }
}

/// A sum of angles, each given by a vector in the plane: the vectors are multiplied as complex numbers, and one arc tangent is taken at the end.
struct Angles {
    product: [f64; 2],
    turns: f64,
}

impl Default for Angles {
    fn default() -> Self {
        Self {
            product: [1.0, 0.0],
            turns: 0.0,
        }
    }
}

impl Angles {
    /// Adds the angle of the vector (x, y), from −π to π.
    fn add(&mut self, [x, y]: [f64; 2]) {
        let [re, im] = self.product;
        let (a, b) = (re * x - im * y, re * y + im * x);
        // Two angles of one half-plane whose sum is in the other one have gone round by π.
        if im >= 0.0 && y >= 0.0 && b < 0.0 {
            self.turns += 1.0;
        } else if im < 0.0 && y < 0.0 && b >= 0.0 {
            self.turns -= 1.0;
        }
        let size = a.abs() + b.abs();
        // A point on a triangle's corner sees it at no angle.
        if size > 0.0 {
            self.product = [a / size, b / size];
        }
    }

    fn sum(&self) -> f64 {
        self.product[1].atan2(self.product[0]) + 2.0 * PI * self.turns
    }
}

/// Vector whose angle is half the signed solid angle of a triangle seen from `p`, positive from its back (Van Oosterom & Strackee 1983).
fn half_solid_angle(t: &[DVec3; 3], p: DVec3) -> [f64; 2] {
    let [a, b, c] = t.map(|v| v - p);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let determinant = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    [denominator, determinant]
}

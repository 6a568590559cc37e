//! Smallest translation that separates two convex shapes that overlap: expanding polytope (van den Bergen 2001).
//!
//! A polytope of points of the shapes' difference contains the origin and grows where its face nearest to the origin is. That face bounds the
//! translation from below; the support mapping along its normal bounds it from above. Both bounds hold when the search ends early. Cost: one step for
//! a pair of boxes' faces, some thirty for curved shapes; each step passes over all faces.

use glam::DVec3;

use crate::probe::gjk::Simplex;
use crate::probe::support::{Support, Vertex, farthest};

/// Difference of the bounds at which the search ends, m.
const CLOSE_M: f64 = 1e-8;
/// A face is visible from a point this far above it, m.
const ABOVE_M: f64 = 1e-12;
/// Most points and faces of the polytope: a closed surface of triangles has 2 · points − 4 faces, and removed faces are reused.
const POINTS: usize = 160;
const FACES: usize = 2 * POINTS;
/// Most edges around the faces visible from a point.
const HORIZON: usize = 96;

/// Memory for the search.
#[derive(Clone, Debug)]
pub(crate) struct Epa {
    points: heapless::Vec<Vertex, POINTS>,
    faces: heapless::Vec<Face, FACES>,
    horizon: heapless::Vec<[u16; 2], HORIZON>,
}

#[derive(Clone, Copy, Debug)]
struct Face {
    corners: [u16; 3],
    /// Outward unit normal.
    normal: DVec3,
    /// Distance of its plane from the origin, m; infinite for a triangle without area.
    distance: f64,
}

/// Depth of two shapes in each other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Depth {
    /// Bounds of the smallest translation, m.
    pub lower: f64,
    pub upper: f64,
    /// Direction in which the first shape leaves the second by `upper`.
    pub out: DVec3,
    /// Deepest point of the first shape in the second, m.
    pub a: DVec3,
}

impl Epa {
    /// No polytope.
    pub const fn new() -> Self {
        Self {
            points: heapless::Vec::new(),
            faces: heapless::Vec::new(),
            horizon: heapless::Vec::new(),
        }
    }

    /// Depth of `a` in `b`, given a simplex of their difference that contains the origin.
    pub fn depth(&mut self, a: &Support<'_>, b: &Support<'_>, simplex: &Simplex) -> Depth {
        let mut best = Depth {
            lower: 0.0,
            upper: f64::INFINITY,
            out: DVec3::X,
            a: simplex.points[0].a,
        };
        if !self.begin(a, b, simplex, &mut best) {
            return best;
        }
        for _ in 0..POINTS {
            let Some(face) = (self.faces.iter()).min_by(|f, g| f.distance.total_cmp(&g.distance)) else {
                break;
            };
            let (normal, distance) = (face.normal, face.distance);
            let corners = face.corners;
            best.lower = best.lower.max(distance);
            let found = farthest(a, b, normal);
            let height = found.w.dot(normal);
            if height < best.upper {
                best = Depth {
                    upper: height,
                    out: -normal,
                    a: self.above_origin(corners, normal * distance),
                    ..best
                };
            }
            if height - distance <= CLOSE_M || !self.add(found) {
                break;
            }
        }
        best
    }

    /// Starts from a simplex, completed to a body around the origin. False where the shapes only touch.
    fn begin(&mut self, a: &Support<'_>, b: &Support<'_>, simplex: &Simplex, best: &mut Depth) -> bool {
        self.points.clear();
        self.faces.clear();
        self.points
            .extend(simplex.points[..simplex.count].iter().copied());
        let [p, q, r, _] = simplex.points.map(|v| v.w);
        // A point has the directions of three axes; a segment three around it; a triangle its two normals.
        let axis = if simplex.count == 2 {
            (q - p).normalize_or_zero()
        } else {
            DVec3::Z
        };
        let aside = axis.any_orthonormal_vector();
        let (cos, sin) = (-0.5, 0.866_025_403_784_438_6);
        let across = axis.cross(aside);
        let normal = (q - p).cross(r - p).normalize_or_zero();
        let directions: &[DVec3] = match simplex.count {
            4 => &[],
            3 => &[normal, -normal],
            2 => &[aside, aside * cos + across * sin, aside * cos - across * sin],
            _ => &[],
        };
        if simplex.count == 1 {
            // The origin is a corner of the difference: the shapes touch in a point.
            best.upper = 0.0;
            return false;
        }
        for &direction in directions {
            let found = farthest(a, b, direction);
            let height = found.w.dot(direction);
            if height < best.upper {
                *best = Depth {
                    upper: height,
                    out: -direction,
                    a: found.a,
                    ..*best
                };
            }
            let _ = self.points.push(found);
        }
        if best.upper <= CLOSE_M {
            best.upper = best.upper.max(0.0);
            return false;
        }
        let triangles: &[[u16; 3]] = match simplex.count {
            4 => &[[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
            // Both sides of the triangle, to each of the two points.
            3 => &[[0, 1, 3], [1, 2, 3], [2, 0, 3], [1, 0, 4], [2, 1, 4], [0, 2, 4]],
            // Both ends of the segment, to each side of the triangle around it.
            _ => &[[0, 2, 3], [0, 3, 4], [0, 4, 2], [1, 3, 2], [1, 4, 3], [1, 2, 4]],
        };
        let middle = self.points.iter().map(|v| v.w).sum::<DVec3>() / self.points.len() as f64;
        for &[i, j, k] in triangles {
            let corner = |i: u16| self.points[usize::from(i)].w;
            let outward = (corner(j) - corner(i)).cross(corner(k) - corner(i));
            let turned = outward.dot(corner(i) - middle) < 0.0;
            let _ = self.push_face(if turned { [i, k, j] } else { [i, j, k] });
        }
        true
    }

    fn push_face(&mut self, corners: [u16; 3]) -> bool {
        let [p, q, r] = corners.map(|i| self.points.get(usize::from(i)).map_or(DVec3::ZERO, |v| v.w));
        let across = (q - p).cross(r - p);
        let area = across.length();
        let longest = (q - p).length_squared().max((r - p).length_squared());
        let (normal, distance) = if area > 1e-12 * longest {
            let normal = across / area;
            (normal, normal.dot(p).max(0.0))
        } else {
            (DVec3::ZERO, f64::INFINITY)
        };
        let face = Face {
            corners,
            normal,
            distance,
        };
        self.faces.push(face).is_ok()
    }

    /// Adds a point of the difference: the faces visible from it are replaced by those between it and their border. False when nothing is visible or
    /// memory is used up.
    fn add(&mut self, point: Vertex) -> bool {
        let index = self.points.len() as u16;
        if self.points.push(point).is_err() {
            return false;
        }
        self.horizon.clear();
        let mut i = 0;
        let mut seen = false;
        while let Some(face) = self.faces.get(i).copied() {
            if face.normal.dot(point.w) - face.distance <= ABOVE_M {
                i += 1;
                continue;
            }
            seen = true;
            let [p, q, r] = face.corners;
            for side in [[p, q], [q, r], [r, p]] {
                // A side of two visible faces is not on their border.
                match self.horizon.iter().position(|&[a, b]| [b, a] == side) {
                    Some(at) => {
                        self.horizon.swap_remove(at);
                    }
                    None => {
                        if self.horizon.push(side).is_err() {
                            return false;
                        }
                    }
                }
            }
            self.faces.swap_remove(i);
        }
        let mut k = 0;
        while let Some(&[p, q]) = self.horizon.get(k) {
            if !self.push_face([p, q, index]) {
                return false;
            }
            k += 1;
        }
        seen
    }

    /// The point of the first shape that belongs to the point `foot` of a face.
    fn above_origin(&self, corners: [u16; 3], foot: DVec3) -> DVec3 {
        let [p, q, r] = corners.map(|i| self.points.get(usize::from(i)).copied().unwrap_or_default());
        let (e, f, d) = (q.w - p.w, r.w - p.w, foot - p.w);
        let (ee, ef, ff) = (e.length_squared(), e.dot(f), f.length_squared());
        let inverse = 1.0 / (ee * ff - ef * ef);
        let t = (d.dot(e) * ff - d.dot(f) * ef) * inverse;
        let u = (d.dot(f) * ee - d.dot(e) * ef) * inverse;
        p.a + (q.a - p.a) * t + (r.a - p.a) * u
    }
}

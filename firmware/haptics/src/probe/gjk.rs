//! Distance of two convex shapes: Gilbert, Johnson & Keerthi 1988, on the difference of the shapes.
//!
//! A simplex of points of the difference approaches the origin. Its point nearest to the origin bounds the distance from above, the plane through the
//! farthest point in the opposite direction from below: both bounds hold whatever the number of steps. The nearest point is found by trying all
//! faces of the simplex. Cost: some ten steps, each two support mappings and at most 15 small solves.

use glam::DVec3;

use crate::probe::support::{Support, Vertex, farthest};

/// Difference of the bounds at which the search ends, m.
const CLOSE_M: f64 = 1e-8;
/// Distance below which the shapes count as touching, m.
const TOUCHING_M: f64 = 1e-10;
/// Most steps: curved shapes take some twenty.
const STEPS: usize = 64;

/// Result of the search.
pub(crate) enum Gjk {
    /// The shapes are apart.
    Apart {
        /// Nearest point of the first shape, and vector to it from that of the second, m.
        a: DVec3,
        v: DVec3,
        /// Lower bound of the distance, m; its upper bound is the length of `v`.
        lower: f64,
    },
    /// The shapes overlap or touch: the origin lies in this simplex.
    Together(Simplex),
}

/// Up to four points of the difference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Simplex {
    pub points: [Vertex; 4],
    pub count: usize,
}

/// Distance of two shapes.
pub(crate) fn gjk(a: &Support<'_>, b: &Support<'_>) -> Gjk {
    let first = farthest(a, b, DVec3::X);
    let mut simplex = Simplex {
        points: [first; 4],
        count: 1,
    };
    let mut nearest = first;
    let mut lower = f64::NEG_INFINITY;
    for _ in 0..STEPS {
        let length = nearest.w.length();
        if length <= TOUCHING_M {
            return Gjk::Together(simplex);
        }
        let found = farthest(a, b, -nearest.w);
        lower = lower.max(found.w.dot(nearest.w) / length);
        let known = simplex.points[..simplex.count].iter().any(|p| p.w == found.w);
        if length - lower <= CLOSE_M || known {
            break;
        }
        simplex.points[simplex.count] = found;
        simplex.count += 1;
        let (reduced, closer) = closest(&simplex);
        if reduced.count == 4 {
            return Gjk::Together(reduced);
        }
        // Rounding may let the point come no closer.
        if closer.w.length() >= length {
            break;
        }
        (simplex, nearest) = (reduced, closer);
    }
    Gjk::Apart {
        a: nearest.a,
        v: nearest.w,
        lower,
    }
}

/// The smallest face of the simplex that contains its point nearest to the origin, and that point.
fn closest(simplex: &Simplex) -> (Simplex, Vertex) {
    let mut best = (*simplex, simplex.points[0]);
    let mut least = f64::INFINITY;
    for set in 1u32..1 << simplex.count {
        let mut face = Simplex {
            points: simplex.points,
            count: 0,
        };
        for (i, point) in simplex.points.iter().enumerate() {
            if set >> i & 1 == 1 {
                face.points[face.count] = *point;
                face.count += 1;
            }
        }
        if let Some(point) = foot_of_origin(&face)
            && point.w.length_squared() < least
        {
            least = point.w.length_squared();
            best = (face, point);
        }
    }
    best
}

/// The foot of the perpendicular from the origin on the hull of all points, if it lies inside.
fn foot_of_origin(face: &Simplex) -> Option<Vertex> {
    let [p, q, r, s] = face.points;
    let weights = match face.count {
        1 => [1.0, 0.0, 0.0, 0.0],
        2 => {
            let e = q.w - p.w;
            let t = -p.w.dot(e) / e.length_squared();
            [1.0 - t, t, 0.0, 0.0]
        }
        3 => {
            let (e, f) = (q.w - p.w, r.w - p.w);
            let (ee, ef, ff) = (e.length_squared(), e.dot(f), f.length_squared());
            let determinant = ee * ff - ef * ef;
            let (pe, pf) = (-p.w.dot(e), -p.w.dot(f));
            let (t, u) = (
                (pe * ff - pf * ef) / determinant,
                (pf * ee - pe * ef) / determinant,
            );
            [1.0 - t - u, t, u, 0.0]
        }
        _ => {
            let (e, f, g) = (q.w - p.w, r.w - p.w, s.w - p.w);
            let determinant = e.dot(f.cross(g));
            let t = -p.w.dot(f.cross(g)) / determinant;
            let u = -e.dot(p.w.cross(g)) / determinant;
            let v = -e.dot(f.cross(p.w)) / determinant;
            [1.0 - t - u - v, t, u, v]
        }
    };
    let mut point = Vertex::default();
    for (weight, vertex) in weights.iter().zip(&face.points).take(face.count) {
        // NaN: the points do not span the face.
        if *weight < 0.0 || weight.is_nan() {
            return None;
        }
        point.w += vertex.w * *weight;
        point.a += vertex.a * *weight;
    }
    if face.count == 4 {
        point.w = DVec3::ZERO;
    }
    Some(point)
}

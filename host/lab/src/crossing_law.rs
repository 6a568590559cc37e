//! Places where edges of two parts cross, by the exact pieces of their edges in double precision: the other half of the contact law on the exact
//! surfaces, see [`crate::contact_law`].
//!
//! Two edges touch at the feet of their common perpendicular, where its direction lies in the cones of the normals at both edges. The feet are found by
//! Newton's method from the nearest of a grid of points, without the bounds, the travel and the memory of the tick.

use glam::{DAffine3, DMat3, DVec3};
use mortise_protocol::image::{EdgeRecord, oct_decode};
use mortise_scenario::wire::vector;

/// Stiffness of a crossing, and of a span, as a multiple of a point's.
pub(crate) const STIFFNESS: f64 = 4.0;
/// Sine of the smallest angle between edges that cross, and between two curved ones.
const LEAST_SINE: f64 = 0.005;
const LEAST_SINE_OF_CURVES: f64 = 0.1;
/// Sine by which the normal may lie outside of a cone.
const CONE_SINE: f64 = 0.02;
/// Points of a piece from which the search starts, and its steps.
const STARTS: [f64; 5] = [-0.8, -0.4, 0.0, 0.4, 0.8];
const STEPS: usize = 12;
/// Distance between the feet across the normal beyond which the steps have not converged, mm.
const BESIDE_MM: f64 = 1e-6;

/// Piece of a sharp convex edge: p(t) = center + t·half + t²·bend, mm.
pub(crate) struct Piece {
    center: DVec3,
    half: DVec3,
    bend: DVec3,
    normals: [DVec3; 2],
    radius: f64,
}

/// An overlap or gap of two edges.
pub(crate) struct Crossing {
    /// Distance along the normal, mm.
    pub gap: f64,
    /// Its change over the tick, mm.
    pub change: f64,
    /// Unit normal out of the other part, in its frame.
    pub normal: DVec3,
}

impl Piece {
    /// The piece of a record.
    pub fn of(record: &EdgeRecord) -> Self {
        Self {
            center: 1e3 * vector(record.center),
            half: 1e3 * vector(record.half),
            bend: 1e3 * vector(record.bend),
            normals: record.normals.map(|n| vector(oct_decode(n)).normalize()),
            radius: 1e3 * f64::from(record.radius),
        }
    }

    fn turned(&self, to: &DAffine3) -> Self {
        let turn: DMat3 = to.matrix3;
        Self {
            center: to.transform_point3(self.center),
            half: turn * self.half,
            bend: turn * self.bend,
            normals: self.normals.map(|n| turn * n),
            radius: self.radius,
        }
    }

    fn at(&self, t: f64) -> DVec3 {
        self.center + t * self.half + t * t * self.bend
    }

    fn tangent(&self, t: f64) -> DVec3 {
        self.half + 2.0 * t * self.bend
    }

    fn is_straight(&self) -> bool {
        self.bend == DVec3::ZERO
    }

    /// Whether `n` lies in the cone of its normals about the tangent at `t`.
    fn faces(&self, t: f64, n: DVec3) -> bool {
        let along = self.tangent(t).normalize();
        let [a, b] = self.normals.map(|v| v.reject_from_normalized(along).normalize());
        let sense = a.cross(b).dot(along).signum();
        let past = |from: DVec3, to: DVec3| sense * from.cross(to).dot(along) > -CONE_SINE;
        past(a, n) && past(n, b) && n.dot(a + b) > 0.0
    }
}

/// Crossings of the pieces `own`, which a tick brings from the first of `to_other` to the second, with the pieces `other`, nearer than `reach` mm.
pub(crate) fn crossings(
    own: &[Piece],
    to_other: &[DAffine3; 2],
    other: &[Piece],
    reach: f64,
) -> Vec<Crossing> {
    let mut found = Vec::new();
    for piece in own {
        let [before, after] = to_other.map(|to| piece.turned(&to));
        for fixed in other {
            let farthest = after.radius + fixed.radius + reach;
            if after.center.distance_squared(fixed.center) > farthest * farthest {
                continue;
            }
            let Some((t, s, normal)) = cross(&after, fixed) else {
                continue;
            };
            let gap_of = |own: &Piece| normal.dot(own.at(t) - fixed.at(s));
            let gap = gap_of(&after);
            if gap.abs() <= reach {
                found.push(Crossing {
                    gap,
                    change: gap - gap_of(&before),
                    normal,
                });
            }
        }
    }
    found
}

/// Parameters of the feet of the common perpendicular of two pieces, and its direction out of the second.
fn cross(own: &Piece, other: &Piece) -> Option<(f64, f64, DVec3)> {
    let grid = STARTS.iter().flat_map(|&t| STARTS.iter().map(move |&s| (t, s)));
    let apart = |&(t, s): &(f64, f64)| own.at(t).distance_squared(other.at(s));
    let (mut t, mut s) = grid.min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    for _ in 0..STEPS {
        let (d, e) = (own.tangent(t), other.tangent(s));
        let apart = own.at(t) - other.at(s);
        let (dd, ee, de) = (d.length_squared(), e.length_squared(), d.dot(e));
        let sine2 = dd * ee - de * de;
        if sine2 <= 1e-6 * dd * ee {
            return None;
        }
        t = (t + (de * e.dot(apart) - ee * d.dot(apart)) / sine2).clamp(-2.0, 2.0);
        s = (s + (dd * e.dot(apart) - de * d.dot(apart)) / sine2).clamp(-2.0, 2.0);
    }
    let across = own.tangent(t).cross(other.tangent(s));
    let sine = across.length() / (own.tangent(t).length() * other.tangent(s).length());
    let least = if own.is_straight() || other.is_straight() {
        LEAST_SINE
    } else {
        LEAST_SINE_OF_CURVES
    };
    if sine < least || t.abs() > 1.0 || s.abs() > 1.0 {
        return None;
    }
    let unit = across.normalize();
    let normal = [unit, -unit]
        .into_iter()
        .find(|&n| other.faces(s, n) && own.faces(t, -n))?;
    // Curves that pass beside each other have no common perpendicular here.
    let beside = (own.at(t) - other.at(s)).reject_from_normalized(normal);
    (beside.length() < BESIDE_MM).then_some((t, s, normal))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Edges of two blocks, crosswise and 3 µm into each other: closed form.
    #[test]
    fn two_blocks_overlap_by_their_depth() {
        let edge = |half: DVec3, normals: [DVec3; 2]| Piece {
            center: DVec3::ZERO,
            half,
            bend: DVec3::ZERO,
            normals,
            radius: half.length(),
        };
        let own = [edge(10.0 * DVec3::X, [-DVec3::Z, DVec3::Y])];
        let other = [edge(10.0 * DVec3::Y, [DVec3::Z, DVec3::X])];
        let to = [1e-3, -3e-3].map(|z| DAffine3::from_translation(DVec3::new(4.0, -2.0, z)));
        let found = crossings(&own, &to, &other, 0.02);
        assert_eq!(found.len(), 1);
        assert!((found[0].gap + 3e-3).abs() < 1e-12);
        assert!((found[0].change + 4e-3).abs() < 1e-12);
        assert!((found[0].normal - DVec3::Z).length() < 1e-12);
        let beside = to.map(|to| DAffine3::from_translation(20.0 * DVec3::X) * to);
        assert!(crossings(&own, &beside, &other, 0.02).is_empty());
    }
}

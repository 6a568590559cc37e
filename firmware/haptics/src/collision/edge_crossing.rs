//! Crossing of two edges: where two pieces of sharp convex edges touch, and in which direction they part.
//!
//! Two edges touch at the feet of their common perpendicular. Its direction n = ±tA × tB is the contact's normal where it lies in the cone between
//! the normals of the two faces at the other part's edge, and −n in the cone at the own edge: then a plane of normal n separates the two wedges of
//! material, and the distance along n is their gap. The distance field answers whether and where two thin parts overlap, but not in which direction
//! they part: inside a thin bar its gradient points to the nearest face, which may be the far side.
//!
//! Source: contact of edges in Ortega et al. 2007, "A Six Degree-of-Freedom God-Object Method"; normal cones after Johnson & Cohen 2001. Cost: some
//! 250 instructions for two straight pieces on a Cortex-M7.

use glam::{Mat3, Vec3};
use mortise_protocol::image::{EdgeRecord, oct_decode};

use crate::math::scalar::inverse_sqrt;
use crate::math::vector::length;

/// Sine of the smallest angle between edges that cross: those more nearly parallel touch along a line, which the points along them find.
const LEAST_SINE: f32 = 0.05;
/// Sine of the angle by which a normal may lie outside of a cone: rounding, and the change of a face's normal along a piece.
const CONE_SINE: f32 = 0.02;
/// How far past its ends a piece still counts, as a share of its half length: consecutive pieces leave no gap.
const PAST_END: f32 = 0.01;
/// Steps to the common perpendicular of curved pieces: the first starts from tangents at most 0.2 rad off, each later one squares the error.
const STEPS: usize = 4;

/// A piece of an edge in the frame of the other part's field.
#[derive(Clone, Copy)]
pub(crate) struct Piece {
    center: Vec3,
    half: Vec3,
    bend: Vec3,
    /// Outward normals of the two faces at its middle; not normalised.
    normals: [Vec3; 2],
    straight: bool,
}

impl Piece {
    /// Piece in its own frame.
    pub fn new(record: &EdgeRecord) -> Self {
        Self {
            center: Vec3::from_array(record.center),
            half: Vec3::from_array(record.half),
            bend: Vec3::from_array(record.bend),
            normals: record.normals.map(|n| Vec3::from_array(oct_decode(n))),
            straight: record.is_straight(),
        }
    }

    /// The piece turned by `rotation`, with its middle at `center`.
    pub fn placed(self, rotation: &Mat3, center: Vec3) -> Self {
        Self {
            center,
            half: *rotation * self.half,
            bend: *rotation * self.bend,
            normals: self.normals.map(|n| *rotation * n),
            straight: self.straight,
        }
    }

    fn at(&self, t: f32) -> Vec3 {
        self.center + (self.half + self.bend * t) * t
    }

    fn tangent(&self, t: f32) -> Vec3 {
        self.half + self.bend * (2.0 * t)
    }

    /// Lower bound of the distance from the piece to `p`, m: that to the segment `center` ± `half`, less the piece's bulge.
    #[inline]
    pub fn distance_to(&self, p: [f32; 3]) -> f32 {
        let from = Vec3::from_array(p) - self.center;
        let length2 = self.half.length_squared();
        let along = from.dot(self.half);
        let t = if along >= length2 {
            1.0
        } else if along <= -length2 {
            -1.0
        } else {
            along / length2
        };
        length(from - self.half * t) - self.bulge()
    }

    /// Radius of a sphere about its middle that contains it, m.
    pub fn reach(&self) -> f32 {
        length(self.half) + self.bulge()
    }

    /// Largest distance of the piece from the segment `center` ± `half`, m.
    fn bulge(&self) -> f32 {
        if self.straight { 0.0 } else { length(self.bend) }
    }

    /// Whether `n` lies in the cone between the normals of the two faces at an edge of tangent `along`, within [`CONE_SINE`].
    fn in_cone(&self, along: Vec3, n: Vec3) -> bool {
        let inverse2 = 1.0 / along.length_squared();
        let across = |v: Vec3| {
            let flat = v - along * (v.dot(along) * inverse2);
            flat * inverse_sqrt(flat.length_squared() + f32::MIN_POSITIVE)
        };
        let [a, b] = self.normals.map(across);
        let unit = along * inverse_sqrt(along.length_squared());
        let sense = if a.cross(b).dot(unit) < 0.0 { -1.0 } else { 1.0 };
        let (past_a, before_b) = (a.cross(n).dot(unit) * sense, n.cross(b).dot(unit) * sense);
        past_a > -CONE_SINE && before_b > -CONE_SINE && n.dot(a + b) > 0.0
    }
}

/// A contact of two edges, in the field's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    /// Distance along the normal, m, negative when they overlap.
    pub gap: f32,
    /// Unit normal, out of the field's part.
    pub normal: Vec3,
    /// Foot on the tree's piece, m.
    pub point: Vec3,
}

/// Contact of the piece `own` with the piece `other` of the field's part; `None` where they do not cross, hardly cross, or do not face each other.
pub(crate) fn crossing(own: &Piece, other: &Piece) -> Option<Crossing> {
    let (mut t, mut s) = (0.0f32, 0.0f32);
    let steps = if own.straight && other.straight { 1 } else { STEPS };
    for _ in 0..steps {
        let (d, e) = (own.tangent(t), other.tangent(s));
        let apart = own.at(t) - other.at(s);
        let (dd, ee, de) = (d.length_squared(), e.length_squared(), d.dot(e));
        let sine2 = dd * ee - de * de;
        if sine2 <= LEAST_SINE * LEAST_SINE * dd * ee {
            return None;
        }
        let inverse = 1.0 / sine2;
        let (da, ea) = (d.dot(apart), e.dot(apart));
        t += (de * ea - ee * da) * inverse;
        s += (dd * ea - de * da) * inverse;
        // Far past the ends the quadratic is no longer the edge.
        if !(t.abs() <= 2.0 && s.abs() <= 2.0) {
            return None;
        }
    }
    if t.abs() > 1.0 + PAST_END || s.abs() > 1.0 + PAST_END {
        return None;
    }
    let (d, e) = (own.tangent(t), other.tangent(s));
    let (point, apart) = (own.at(t), own.at(t) - other.at(s));
    let across = d.cross(e);
    let squared = across.length_squared();
    if squared < f32::MIN_POSITIVE {
        return None;
    }
    let across = across * inverse_sqrt(squared);
    let facing = |n: Vec3| other.in_cone(e, n) && own.in_cone(d, -n);
    let normal = if facing(across) {
        across
    } else if facing(-across) {
        -across
    } else {
        return None;
    };
    Some(Crossing {
        gap: normal.dot(apart),
        normal,
        point,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mortise_protocol::image::oct_encode;
    use proptest::prelude::*;

    fn edge(center: [f32; 3], half: [f32; 3], bend: [f32; 3], normals: [[f32; 3]; 2]) -> Piece {
        Piece::new(&EdgeRecord {
            center,
            half,
            bend,
            normals: normals.map(oct_encode),
            ..EdgeRecord::default()
        })
    }

    /// An edge along x below a block, above an edge along y of a block below: the gap is the height.
    #[test]
    fn crossed_blocks_are_their_height_apart() {
        let other = edge(
            [0.0; 3],
            [0.0, 0.1, 0.0],
            [0.0; 3],
            [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
        );
        for height in [1e-3f32, -50e-6] {
            let own = edge(
                [0.0, 0.0, height],
                [0.1, 0.0, 0.0],
                [0.0; 3],
                [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
            );
            let found = crossing(&own, &other).expect("they cross");
            assert!((found.gap - height).abs() < 1e-8, "{found:?}");
            assert!((found.normal - Vec3::Z).length() < 1e-6, "{found:?}");
        }
        // The upper edges of both do not face each other.
        let upper = edge(
            [0.0, 0.0, 1e-3],
            [0.1, 0.0, 0.0],
            [0.0; 3],
            [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
        );
        assert!(crossing(&upper, &other).is_none());
        // Past its end an edge does not touch.
        let beside = edge(
            [0.11, 0.0, 1e-3],
            [0.1, 0.0, 0.0],
            [0.0; 3],
            [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
        );
        assert!(crossing(&beside, &other).is_none());
    }

    proptest! {
        /// A circle's quadratic pieces against a straight edge: the gap is that of the closed form, whatever the part of the circle.
        #[test]
        fn an_arc_crosses_a_line(angle in -0.19f32..0.19, height in -40e-6f32..1e-3, slant in -0.6f32..0.6) {
            let r = 0.01f32;
            // Rim of a peg's lower end, at its point (r, 0, height); faces: below, and outward.
            let (turn, a) = (0.2f32, 0.2f32);
            let at = |phi: f32| Vec3::new(r * libm::cosf(phi), r * libm::sinf(phi), 0.0);
            let (p, m, q) = (at(-a), at(0.0), at(turn));
            let own = edge(
                (m + Vec3::Z * height).to_array(),
                ((q - p) * 0.5).to_array(),
                ((p + q) * 0.5 - m).to_array(),
                [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]],
            );
            // A straight edge across the rim at `angle`, not along it.
            let foot = at(angle);
            let radial = foot * (1.0 / r);
            let around = Vec3::new(-radial.y, radial.x, 0.0);
            let along = radial * libm::cosf(slant) + around * libm::sinf(slant);
            let side = Vec3::new(-along.y, along.x, 0.0);
            let other = edge(foot.to_array(), (along * 0.02).to_array(), [0.0; 3], [[0.0, 0.0, 1.0], side.to_array()]);
            let found = crossing(&own, &other).expect("they cross");
            // Both lie in parallel planes, so the height is the gap.
            prop_assert!((found.gap - height).abs() < 0.5e-6, "{:?}", found);
            prop_assert!(found.normal.z > 0.999);
        }
    }
}

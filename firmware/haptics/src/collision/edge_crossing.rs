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

use crate::math::scalar::{inverse_sqrt, larger, smaller};
use crate::math::vector::quick_length;

/// Sine of the smallest angle between edges that cross. Points along the edges find those more nearly parallel: halfway between two points 5 mm apart
/// they err by 13 µm.
pub const LEAST_SINE: f32 = 0.005;
/// The same for two curved pieces: rims of nearly one radius run along each other, and their points are as dense as the accuracy asks.
const LEAST_SINE_OF_CURVES: f32 = 0.1;
/// Sine of the angle by which a normal may lie outside of a cone: rounding, and the change of a face's normal along a piece.
const CONE_SINE: f32 = 0.02;
/// How far past its ends a piece still counts, m: consecutive pieces leave no gap. Less than the clearance of any fit: at the corner of a hole the edges
/// of a plug's end, prolonged by the clearance, cross those of the hole's rim.
const PAST_END_M: f32 = 2e-6;
/// Distance between the feet across the normal, m, beyond which the steps have not converged: rounding at the flattest angle is a fifth of it.
const BESIDE_M: f32 = 10e-6;
/// Steps to the common perpendicular of curved pieces: the first starts from tangents at most 0.2 rad off, each later one squares the error.
const STEPS: usize = 4;

/// A piece of an edge in the frame of the other part's field.
pub(crate) struct Piece<'a> {
    pub record: &'a EdgeRecord,
    center: Vec3,
    half: Vec3,
    bend: Vec3,
    straight: bool,
    /// Largest distance of the piece from the segment `center` ± `half`, m.
    bulge: f32,
    /// Squared length of `half`, m².
    half2: f32,
}

impl<'a> Piece<'a> {
    /// A piece of the field's own part.
    #[inline]
    pub fn fixed(record: &'a EdgeRecord) -> Self {
        let [center, half, bend] = [record.center, record.half, record.bend].map(Vec3::from_array);
        Self::new(record, center, half, bend)
    }

    /// A piece of the tree's part, with its middle at `center`, turned by `rotation`.
    #[inline]
    pub fn placed(record: &'a EdgeRecord, center: Vec3, rotation: &Mat3) -> Self {
        let [half, bend] = [record.half, record.bend].map(|v| *rotation * Vec3::from_array(v));
        Self::new(record, center, half, bend)
    }

    #[inline]
    fn new(record: &'a EdgeRecord, center: Vec3, half: Vec3, bend: Vec3) -> Self {
        let straight = record.is_straight();
        Self {
            record,
            center,
            half,
            bend,
            straight,
            bulge: if straight { 0.0 } else { quick_length(bend) },
            half2: half.length_squared(),
        }
    }

    fn at(&self, t: f32) -> Vec3 {
        self.center + (self.half + self.bend * t) * t
    }

    fn tangent(&self, t: f32) -> Vec3 {
        self.half + self.bend * (2.0 * t)
    }

    /// Whether it and a sphere (centre, radius, m) are at most `reach` apart, by its segment: a long piece is not near all that its own sphere contains.
    #[inline]
    pub fn is_near(&self, (center, radius): (Vec3, f32), reach: f32) -> bool {
        let apart = center - self.center;
        let t = share(apart.dot(self.half), self.half2);
        let farthest = self.bulge + radius + reach;
        (apart - self.half * t).length_squared() <= farthest * farthest
    }

    /// Centre and radius of a sphere that contains it, m.
    #[inline]
    pub fn sphere(&self) -> (Vec3, f32) {
        (self.center, self.record.radius)
    }

    /// Outward unit normals of its two faces across a unit tangent `along`, turned by `rotation`.
    fn normals(&self, rotation: &Mat3, along: Vec3) -> [Vec3; 2] {
        (self.record.normals).map(|n| {
            let normal = *rotation * Vec3::from_array(oct_decode(n));
            let across = normal - along * normal.dot(along);
            across * inverse_sqrt(across.length_squared() + f32::MIN_POSITIVE)
        })
    }
}

/// Whether two spheres (centre, radius, m) are at most `reach` apart.
#[inline]
pub(crate) fn are_within(a: (Vec3, f32), b: (Vec3, f32), reach: f32) -> bool {
    let farthest = a.1 + b.1 + reach;
    (a.0 - b.0).length_squared() <= farthest * farthest
}

/// Sine, or less, of the angle by which `n` lies outside of the cone between the `normals` of the two faces at an edge of unit tangent `along`, or on the far side of
/// it; not positive inside of it, within [`CONE_SINE`].
fn outside(normals: [Vec3; 2], along: Vec3, n: Vec3) -> f32 {
    let [a, b] = normals;
    let sense = if a.cross(b).dot(along) < 0.0 { -1.0 } else { 1.0 };
    let (past_a, before_b) = (a.cross(n).dot(along) * sense, n.cross(b).dot(along) * sense);
    larger(-CONE_SINE - smaller(past_a, before_b), -0.5 * n.dot(a + b))
}

/// `above`/`below`, at least −1 and at most 1; `below` is not negative.
#[inline]
fn share(above: f32, below: f32) -> f32 {
    if above >= below {
        1.0
    } else if above <= -below {
        -1.0
    } else {
        above / below
    }
}

/// Circle that osculates a curved piece at its middle.
pub(crate) struct Circle {
    center: Vec3,
    /// Unit vector across its plane.
    axis: Vec3,
    /// 1/√radius, m^-½.
    inverse_root: f32,
}

impl Circle {
    /// Circle of a piece, `None` for a straight one.
    pub fn of(piece: &Piece<'_>) -> Option<Self> {
        if piece.straight {
            return None;
        }
        let (half, bend) = (piece.half, piece.bend);
        let across = half.cross(bend);
        // Curvature κ = 2·|half × bend|/|half|³, towards the part of `bend` across `half`.
        let inverse_half = inverse_sqrt(piece.half2);
        let curvature = 2.0 * quick_length(across) * inverse_half * inverse_half * inverse_half;
        let inward = across.cross(half);
        Some(Self {
            center: piece.center
                + inward * (inverse_sqrt(inward.length_squared()) / (curvature + f32::MIN_POSITIVE)),
            axis: across * inverse_sqrt(across.length_squared()),
            inverse_root: root(curvature),
        })
    }

    /// What a part can travel, m, until two pieces with these circles can cross, at most 0 when they may cross now; `turn` is the most by which it turns
    /// over any way, 1/m.
    ///
    /// Circles of radii R and r in parallel planes whose axes are e apart cross, seen along the axes, at an angle ψ with
    /// e² = R² + r² − 2·R·r·cos ψ, so 2·sin(ψ/2) ≤ e/√(R·r). A tilt adds its angle. Below [`LEAST_SINE_OF_CURVES`] they run along each other.
    pub fn travel(&self, other: &Self, turn: f32) -> f32 {
        let apart = self.center - other.center;
        let aside = apart - other.axis * apart.dot(other.axis);
        let per_m = self.inverse_root * other.inverse_root;
        let sine = quick_length(aside) * per_m + quick_length(self.axis.cross(other.axis));
        (LEAST_SINE_OF_CURVES - sine) / (per_m + turn)
    }
}

/// Square root of a number that is not negative.
#[inline]
fn root(x: f32) -> f32 {
    x * inverse_sqrt(x + f32::MIN_POSITIVE)
}

/// Whether two curved pieces run along each other at the [`nearest`] points of their segments.
#[inline]
pub(crate) fn run_along(own: &Piece<'_>, other: &Piece<'_>, [t, s]: [f32; 2]) -> bool {
    if own.straight || other.straight {
        return false;
    }
    let (d, e) = (own.tangent(t), other.tangent(s));
    let lengths2 = d.length_squared() * e.length_squared();
    d.cross(e).length_squared() <= LEAST_SINE_OF_CURVES * LEAST_SINE_OF_CURVES * lengths2
}

/// Nearest points of the segments of two pieces, by their parameters, and a lower bound of the distance of the pieces, m (Ericson 2005, "Real-Time
/// Collision Detection", section 5.1.9).
#[inline]
pub(crate) fn nearest(own: &Piece<'_>, other: &Piece<'_>) -> ([f32; 2], f32) {
    let (d, e, apart) = (own.half, other.half, own.center - other.center);
    let (dd, ee, de) = (own.half2, other.half2, d.dot(e));
    let (da, ea) = (d.dot(apart), e.dot(apart));
    let sine2 = dd * ee - de * de;
    let first = if sine2 > 1e-6 * dd * ee {
        share(de * ea - ee * da, sine2)
    } else {
        0.0
    };
    let s = share(de * first + ea, ee);
    let t = share(de * s - da, dd);
    let distance = quick_length(apart + d * t - e * s) - (own.bulge + other.bulge);
    ([t, s], distance)
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
    /// Sine of the angle between the edges.
    pub sine: f32,
}

/// What [`crossing`] found.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Meeting {
    /// They cross.
    Crossing(Crossing),
    /// They do not face each other, and cannot before one turns against the other by this angle, rad.
    Averted(f32),
    /// They do not cross, or hardly.
    Beside,
}

/// Parameters of the feet of the common perpendicular of two pieces, searched from the parameters `from`, those of the [`nearest`] points of their segments. Where
/// it is beyond their ends, or they hardly cross, the travel within which that remains so, m, at most 0 where it is not known; `turn` is the most by which the
/// held part turns over any way, 1/m.
#[inline]
pub(crate) fn feet(own: &Piece<'_>, other: &Piece<'_>, from: [f32; 2], turn: f32) -> Result<[f32; 2], f32> {
    let [mut t, mut s] = from;
    let least = least_sine2(own, other);
    let straight = own.straight && other.straight;
    let mut share2 = 0.0;
    for _ in 0..feet_steps(own, other) {
        let (d, e) = (own.tangent(t), other.tangent(s));
        let (dd, ee, de) = (d.length_squared(), e.length_squared(), d.dot(e));
        let sine2 = dd * ee - de * de;
        if sine2 <= least * dd * ee {
            return Err(0.0);
        }
        let apart = own.at(t) - other.at(s);
        let inverse = 1.0 / sine2;
        let (da, ea) = (d.dot(apart), e.dot(apart));
        t += (de * ea - ee * da) * inverse;
        s += (dd * ea - de * da) * inverse;
        share2 = sine2 / (dd * ee);
        // Far past the ends the quadratic is no longer the edge.
        if !(straight || t.abs() <= 2.0 && s.abs() <= 2.0) {
            return Err(0.0);
        }
    }
    let past = |t: f32, piece: &Piece<'_>| (t.abs() - 1.0) * piece.record.radius - PAST_END_M;
    let past = larger(past(t, own), past(s, other));
    if past <= 0.0 {
        return Ok([t, s]);
    }
    // A foot moves by the travel over the sine of the angle, by a quarter more where it lies beyond the part, and by another where the edges are apart and turn.
    let apart2 = (own.at(t) - other.at(s)).length_squared();
    let is_known = straight && 16.0 * apart2 * turn * turn < share2;
    Err(if is_known {
        0.5 * smaller(past, 0.25 / turn) * root(share2)
    } else {
        0.0
    })
}

/// Steps that [`feet`] takes at most.
#[inline]
pub(crate) fn feet_steps(own: &Piece<'_>, other: &Piece<'_>) -> usize {
    if own.straight && other.straight { 1 } else { STEPS }
}

/// Square of the sine of the smallest angle at which two pieces cross.
#[inline]
fn least_sine2(own: &Piece<'_>, other: &Piece<'_>) -> f32 {
    if own.straight || other.straight {
        LEAST_SINE * LEAST_SINE
    } else {
        LEAST_SINE_OF_CURVES * LEAST_SINE_OF_CURVES
    }
}

/// Contact of the piece `own`, turned by `rotation` into this frame, with the piece `other` of the field's part, at the [`feet`] of their common
/// perpendicular.
pub(crate) fn crossing(own: &Piece<'_>, other: &Piece<'_>, rotation: &Mat3, [t, s]: [f32; 2]) -> Meeting {
    let (d, e) = (own.tangent(t), other.tangent(s));
    let across = d.cross(e);
    let lengths2 = [d.length_squared(), e.length_squared()];
    let squared = across.length_squared();
    if squared <= least_sine2(own, other) * lengths2[0] * lengths2[1] {
        return Meeting::Beside;
    }
    let unit = across * inverse_sqrt(squared);
    let [along, other_along] = [d * inverse_sqrt(lengths2[0]), e * inverse_sqrt(lengths2[1])];
    let sine = squared * inverse_sqrt(squared) * inverse_sqrt(lengths2[0]) * inverse_sqrt(lengths2[1]);
    let cone = other.normals(&Mat3::IDENTITY, other_along);
    // The other sense points away from the middle of the cone.
    let middle = 0.5 * unit.dot(cone[0] + cone[1]);
    let normal = if middle < 0.0 { -unit } else { unit };
    let off = larger(
        outside(cone, other_along, normal),
        outside(own.normals(rotation, along), along, -normal),
    );
    if off >= 0.0 {
        // Neither sense may come to lie in both cones. The normal turns by the angle of the edges over its sine, which falls by as much.
        let off = smaller(off, middle.abs());
        let still = own.straight && other.straight;
        return Meeting::Averted(if still { off * sine / (1.0 + off) } else { 0.0 });
    }
    let point = own.at(t);
    let apart = point - other.at(s);
    let gap = normal.dot(apart);
    // Curves that pass beside each other have no common perpendicular here, and the steps do not converge.
    if (apart - normal * gap).length_squared() > BESIDE_M * BESIDE_M {
        return Meeting::Beside;
    }
    Meeting::Crossing(Crossing {
        gap,
        normal,
        point,
        sine,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mortise_protocol::image::oct_encode;
    use proptest::prelude::*;

    fn edge(center: [f32; 3], half: [f32; 3], bend: [f32; 3], normals: [[f32; 3]; 2]) -> EdgeRecord {
        EdgeRecord {
            center,
            half,
            bend,
            normals: normals.map(oct_encode),
            radius: Vec3::from_array(half).length() + Vec3::from_array(bend).length(),
            ..EdgeRecord::default()
        }
    }

    fn meeting(own: &EdgeRecord, other: &EdgeRecord) -> Meeting {
        let [own, other] = [own, other].map(Piece::fixed);
        let (from, _) = nearest(&own, &other);
        feet(&own, &other, from, 1.0).map_or(Meeting::Beside, |feet| {
            super::crossing(&own, &other, &Mat3::IDENTITY, feet)
        })
    }

    fn crossing(own: &EdgeRecord, other: &EdgeRecord) -> Option<Crossing> {
        let Meeting::Crossing(found) = meeting(own, other) else {
            return None;
        };
        let [own, other] = [own, other].map(Piece::fixed);
        let (_, distance) = nearest(&own, &other);
        assert!(distance <= found.gap.abs() + 1e-8, "{distance} {found:?}");
        Some(found)
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

    /// The end of a plug over the corner of its hole, held in its middle: the plug's edge, prolonged by the clearance, crosses the rim, but it ends before.
    #[test]
    fn edges_that_end_before_a_corner_do_not_cross_there() {
        for clearance in [5e-6f32, 38e-6, 0.1e-3] {
            for length in [5e-3f32, 20e-3, 0.2] {
                let half = 0.5 * length;
                let own = edge(
                    [-clearance - half, -clearance, 1e-6],
                    [half, 0.0, 0.0],
                    [0.0; 3],
                    [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
                );
                let rim = edge(
                    [0.0, -half, 0.0],
                    [0.0, half, 0.0],
                    [0.0; 3],
                    [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]],
                );
                assert!(crossing(&own, &rim).is_none(), "{clearance} {length}");
            }
        }
    }

    /// Two pieces of one edge that meet leave no place at which another edge passes between them.
    #[test]
    fn pieces_that_meet_leave_no_gap() {
        let faces = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
        let pieces = [-0.03f32, 0.01].map(|x| edge([x, 0.0, 1e-6], [0.02, 0.0, 0.0], [0.0; 3], faces));
        for step in -50..=50 {
            let x = -0.01 + 1e-8 * step as f32;
            let other = edge(
                [x, 0.0, 0.0],
                [0.0, 0.02, 0.0],
                [0.0; 3],
                [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
            );
            let crosses = |piece: &EdgeRecord| matches!(meeting(piece, &other), Meeting::Crossing(_));
            assert!(pieces.iter().any(crosses), "{x}");
        }
    }

    /// Rims in one plane, one outside of the other, do not touch, however near they are.
    #[test]
    fn rims_side_by_side_do_not_cross() {
        let arc = |center: Vec3, from: f32, normals: [[f32; 3]; 2]| {
            let at = |phi: f32| center + Vec3::new(libm::cosf(phi), libm::sinf(phi), 0.0) * 0.01;
            let (p, m, q) = (at(from - 0.2), at(from), at(from + 0.2));
            edge(
                m.to_array(),
                ((q - p) * 0.5).to_array(),
                ((p + q) * 0.5 - m).to_array(),
                normals,
            )
        };
        for beside in [0.05e-3f32, 0.2e-3, 0.5e-3] {
            for step in -20..=20 {
                let turn = 0.01 * step as f32;
                let own = arc(
                    Vec3::ZERO,
                    turn,
                    [[0.0, 0.0, -1.0], [libm::cosf(turn), libm::sinf(turn), 0.0]],
                );
                let center = Vec3::new(0.02 + beside, 0.0, -1e-6);
                let other = arc(center, 3.0, [[0.0, 0.0, 1.0], [-0.99, 0.14, 0.0]]);
                assert!(crossing(&own, &other).is_none(), "{beside} {turn}");
            }
        }
    }

    proptest! {
        /// No place of a piece is in a sphere that the piece is not near to, and a sphere whose nearest place on the chord is beyond the bulge is not near.
        #[test]
        fn a_piece_is_near_where_it_reaches(
            center in prop::array::uniform3(-0.02f32..0.02),
            half in prop::array::uniform3(-0.05f32..0.05),
            bend in prop::array::uniform3(-0.01f32..0.01),
            sphere in prop::array::uniform3(-0.1f32..0.1),
            radius in 1e-4f32..0.05,
            reach in 0f32..2e-3,
        ) {
            let record = edge(center, half, bend, [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
            let piece = Piece::fixed(&record);
            let sphere = Vec3::from_array(sphere);
            let (mut on_piece, mut on_chord) = (f32::INFINITY, f32::INFINITY);
            for i in -200..=200 {
                let t = i as f32 / 200.0;
                on_piece = on_piece.min((piece.at(t) - sphere).length());
                on_chord = on_chord.min((piece.center + piece.half * t - sphere).length());
            }
            let near = piece.is_near((sphere, radius), reach);
            // Rounding of lengths below a metre.
            prop_assert!(near || on_piece > radius + reach - 1e-6);
            // The places tried on the chord are half a step from the nearest at most.
            let step = piece.half.length() / 200.0;
            prop_assert!(!near || on_chord <= piece.bulge + radius + reach + step + 1e-6);
        }

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

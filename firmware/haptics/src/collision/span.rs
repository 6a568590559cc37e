//! Span of a sharp convex edge: the place on it that is nearest to the other part's surface.
//!
//! A span is the curve x(u) = m + a·u + b·u²·(1 − k·(1 − u²)) for −1 ≤ u ≤ 1. Along it the signed distance to a plane, a cylinder or a sphere is a
//! polynomial, or the root of one, whose first terms lead from the middle to the lowest place and whose other terms bound the error of that; for cones
//! and tori the second derivative is n·x'' + x'ᵀ·H·x' with the normal n and the Hessian H of the surface. Where another surface is nearest there, or
//! none of this is known, secant steps follow, and across a kink the intersection of both tangents. So a rim of any size needs as many spans as its
//! tangent turns, not as many points as an error bound asks: a tilted rim's lowest place is found to a nanometre from 0.4 rad beside it (Macklin et
//! al. 2020, "Local Optimization for Robust Signed Distance Field Collision").
//!
//! Cost: [`crate::collision::cost::SPAN`], and a field query for each place evaluated beside the middle: one in most spans that may touch.

use glam::{Mat3, Vec3};
use mortise_protocol::image::{FaceRecord, SpanRecord, Surface, Surfaces, surface_kind};

use crate::collision::exact_surface::{OnFace, bending};
use crate::math::scalar::{larger, smaller};
use crate::math::vector::quick_length;

/// When the search along a span ends.
#[derive(Clone, Copy)]
pub(crate) struct Effort {
    /// Places evaluated beside the middle, at most.
    pub steps: usize,
    /// A step that lowers the distance by less is not taken, m.
    pub least_gain_m: f32,
}

/// In a tick.
pub(crate) const IN_TICK: Effort = Effort {
    steps: 3,
    least_gain_m: 0.5e-6,
};
/// Share of a span's length by which third derivatives can lower the distance to a cone or a torus below the parabola: a sixth of its turn, 0.4 rad,
/// squared.
const BEYOND_PARABOLA: f32 = 0.027;
/// Share of the middle's distance that a bound from its surface alone may use: another surface may come nearer along the span.
const BOUND_SHARE: f32 = 0.5;

/// Even places to either side of the middle at which [`deepest`] looks, and its steps, each of which leaves two thirds of the interval.
const PLACES: i32 = 8;
const THIRDS: u32 = 24;

/// A span in the frame of the field.
pub(crate) struct Span {
    middle: Vec3,
    along: Vec3,
    bend: Vec3,
    round: f32,
}

/// Weight of b at `u`.
#[inline(always)]
pub(crate) fn weight(round: f32, u: f32) -> f32 {
    let square = u * u;
    square * (1.0 - round * (1.0 - square))
}

impl Span {
    /// The span of a record about a point at `middle` (m), turned by `rotation`.
    #[inline(always)]
    pub fn placed(record: &SpanRecord, middle: Vec3, rotation: &Mat3) -> Self {
        let [along, bend] = [record.along, record.bend].map(|v| *rotation * Vec3::from_array(v));
        Self {
            middle,
            along,
            bend,
            round: record.round,
        }
    }

    /// Its middle in the frame of the field, m.
    #[inline(always)]
    pub fn middle(&self) -> Vec3 {
        self.middle
    }

    /// Whether it is of a straight edge.
    #[inline]
    pub fn is_straight(&self) -> bool {
        self.bend == Vec3::ZERO
    }

    /// Distance from the middle within which it lies, m.
    #[inline]
    pub fn reach(&self) -> f32 {
        quick_length(self.along) + quick_length(self.bend)
    }

    /// Upper bound of the length of any stretch of it whose parameter changes by `change`, m.
    pub fn longest(&self, change: f32) -> f32 {
        change * (quick_length(self.along) + (2.0 + 2.0 * self.round) * quick_length(self.bend))
    }

    /// Half of the size of a box about the middle, along the axes of the field's frame, that contains it, m.
    pub fn half_size(&self) -> Vec3 {
        self.along.abs() + self.bend.abs()
    }

    #[inline(always)]
    fn at(&self, u: f32) -> Vec3 {
        self.middle + self.along * u + self.bend * weight(self.round, u)
    }

    /// Slope of the distance at `u` where the surface has this normal, m.
    #[inline(always)]
    fn slope(&self, u: f32, normal: Vec3) -> f32 {
        let bend = u * (2.0 * (1.0 - self.round) + 4.0 * self.round * u * u);
        normal.dot(self.along + self.bend * bend)
    }
}

/// Parameter of the lowest place of a span where the distance has several minima: the least at even places and at `lowest` (a parameter and the
/// distance there, m), then by thirds between the places beside it. `at`: distance at a parameter, m.
pub(crate) fn deepest(mut lowest: (f32, f32), at: impl Fn(f32) -> f32) -> f32 {
    for k in -PLACES..=PLACES {
        let u = k as f32 / PLACES as f32;
        let distance = at(u);
        if distance < lowest.1 {
            lowest = (u, distance);
        }
    }
    let step = 1.0 / PLACES as f32;
    let [mut from, mut to] = [lowest.0 - step, lowest.0 + step].map(|u| u.clamp(-1.0, 1.0));
    for _ in 0..THIRDS {
        let third = (to - from) / 3.0;
        if at(from + third) < at(to - third) {
            to -= third;
        } else {
            from += third;
        }
    }
    let u = 0.5 * (from + to);
    if at(u) < lowest.1 { u } else { lowest.0 }
}

/// Surface nearest to a place, and whether its cell names no other.
#[derive(Clone, Copy)]
pub(crate) struct Near {
    pub found: OnFace,
    pub alone: bool,
}

/// The distance along a span, from that at its middle: slope·u + half·u², where `half` stands for all even powers, which it meets at the ends; and, at
/// most, `rest` below.
#[derive(Clone, Copy)]
struct Powers {
    slope: f32,
    half: f32,
    rest: f32,
}

impl Powers {
    /// Along a span whose middle is nearest to `found`; `None` where `found` is on a face without closed form.
    #[inline(always)]
    fn of(surfaces: Surfaces<'_>, span: &Span, found: &OnFace) -> Option<Self> {
        let Some(Surface::Face(face)) = surfaces.get(found.face) else {
            return None;
        };
        match face.kind {
            surface_kind::PLANE => {
                let bend = found.normal.dot(span.bend);
                Some(Self {
                    slope: found.normal.dot(span.along),
                    half: bend,
                    rest: larger(0.25 * span.round * bend, 0.0),
                })
            }
            surface_kind::CYLINDER => Some(Self::round(face, span, found, Vec3::from_array(face.axis))),
            surface_kind::SPHERE => Some(Self::round(face, span, found, Vec3::ZERO)),
            _ => {
                let by_surface = bending(face, span.middle, found, span.along)?;
                Some(Self {
                    slope: found.normal.dot(span.along),
                    half: (1.0 - span.round) * found.normal.dot(span.bend) + 0.5 * by_surface,
                    rest: BEYOND_PARABOLA * span.along.abs().element_sum(),
                })
            }
        }
    }

    /// Along a span beside a cylinder with this axis, or a sphere (zero).
    ///
    /// With y the offset from the axis and ρ = |y| at the middle, ρ(u)² is a polynomial with coefficients q₁ … q₈, and
    /// ρ(u) − ρ = (ρ(u)² − ρ²)/2ρ − (ρ(u) − ρ)²/2ρ.
    #[inline(always)]
    fn round(face: &FaceRecord, span: &Span, found: &OnFace, axis: Vec3) -> Self {
        let k = span.round;
        let inverse = 1.0 / (found.distance * face.sense + face.radius);
        let [a, b] = [span.along, span.bend].map(|v| v - axis * axis.dot(v));
        let slope = found.normal.dot(a);
        let (yb, bb) = (found.normal.dot(b), face.sense * b.length_squared() * inverse);
        // Each is the coefficient over 2ρ, times the sense.
        let second = 0.5 * face.sense * a.length_squared() * inverse + (1.0 - k) * yb;
        let odd = (a.dot(b) * inverse).abs();
        let fourth = 0.5 * (1.0 - k) * (1.0 - k) * bb + k * yb;
        let (sixth, eighth) = (k * (1.0 - k) * bb, 0.5 * k * k * bb);
        let even = fourth + sixth + eighth;
        let half = second + even;
        // Between the middle and the ends, what is left is u²·(1 − u²) times what lies between these two.
        let left = even + sixth + 2.0 * eighth;
        let rest = odd + 0.25 * larger(even.abs(), left.abs());
        let change = 2.0 * (slope.abs() + half.abs() + rest);
        let beyond = if face.sense > 0.0 {
            0.5 * change * change * inverse
        } else {
            0.0
        };
        Self {
            slope,
            half,
            rest: rest + beyond,
        }
    }

    /// The place at which the first two terms are least, and their value there, m.
    #[inline(always)]
    fn least(&self) -> (f32, f32) {
        let downward = if self.slope > 0.0 { -1.0 } else { 1.0 };
        let u = if 2.0 * self.half > self.slope.abs() {
            -0.5 * self.slope / self.half
        } else {
            downward
        };
        (u, (self.slope + self.half * u) * u)
    }
}

/// The distance along a span, seen from its middle.
pub(crate) struct Course {
    /// Surface nearest to the middle.
    first: Near,
    /// `None` where the surface has no closed form.
    powers: Option<Powers>,
}

impl Course {
    /// Of a span whose middle is nearest to `first`.
    #[inline(always)]
    pub fn new(surfaces: Surfaces<'_>, span: &Span, first: Near) -> Self {
        Self {
            powers: Powers::of(surfaces, span, &first.found),
            first,
        }
    }

    /// Lower bound of the distance along the span, m, which is tight where one surface is near. `only`: no other surface is near the span.
    #[inline(always)]
    pub fn lower_bound(&self, span: &Span, only: bool) -> f32 {
        let distance = self.first.found.distance;
        let Some(powers) = self.powers else {
            return distance - span.reach();
        };
        let by_surface = distance + powers.least().1 - powers.rest;
        if only {
            by_surface
        } else {
            smaller(by_surface, BOUND_SHARE * distance)
        }
    }

    /// Parameter of the lowest place, from −1 to 1, and the surface there: 0 where no other place is lower by the least gain. `eval`: surface nearest
    /// to a point.
    #[inline(always)]
    pub fn lowest(
        &self,
        span: &Span,
        effort: Effort,
        mut eval: impl FnMut(Vec3) -> Option<Near>,
    ) -> (f32, Near) {
        let mut lowest = (0.0, self.first);
        let slope = span.slope(0.0, self.first.found.normal);
        let powers = self.powers.unwrap_or(Powers {
            slope,
            half: 0.0,
            rest: 0.0,
        });
        let (mut u, gain) = powers.least();
        if gain > -effort.least_gain_m {
            return lowest;
        }
        let mut last = (0.0, self.first.found, slope);
        for _ in 0..effort.steps {
            let Some(here) = eval(span.at(u)) else { break };
            if here.found.distance < lowest.1.found.distance {
                lowest = (u, here);
            }
            let slope = span.slope(u, here.found.normal);
            let next = next_place(last, (u, here.found, slope));
            if ((next - u) * slope).abs() < effort.least_gain_m {
                break;
            }
            last = (u, here.found, slope);
            u = next;
        }
        lowest
    }
}

/// The place to evaluate after two others, each a parameter, its surface and the slope there.
fn next_place(last: (f32, OnFace, f32), here: (f32, OnFace, f32)) -> f32 {
    let (u0, first, g0) = last;
    let (u, found, g) = here;
    let down = if g > 0.0 { -1.0 } else { 1.0 };
    let next = if g0 * g < 0.0 && first.face != found.face {
        // Across a kink: where the tangents meet.
        (found.distance - first.distance + g0 * u0 - g * u) / (g0 - g)
    } else if (g - g0) * (u - u0) > 0.0 {
        u - g * (u - u0) / (g - g0)
    } else {
        // Not convex: on downhill.
        down
    };
    // False for NaN too.
    if next.abs() <= 1.0 { next } else { down }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn span(middle: Vec3, along: Vec3, bend: Vec3) -> Span {
        let round = bend.length_squared() / along.length_squared();
        Span {
            middle,
            along,
            bend,
            round,
        }
    }

    fn plane(normal: Vec3, offset: f32, face: u16) -> impl Fn(Vec3) -> OnFace {
        move |p| OnFace {
            distance: normal.dot(p) - offset,
            normal,
            face,
            edge_face: 0,
        }
    }

    fn find(span: &Span, powers: Option<Powers>, eval: impl Fn(Vec3) -> OnFace) -> (f32, f32) {
        let first = eval(span.middle);
        let near = |found| Near { found, alone: true };
        let course = Course {
            first: near(first),
            powers,
        };
        let (u, lowest) = course.lowest(span, IN_TICK, |p| Some(near(eval(p))));
        assert_eq!(lowest.found.distance, eval(span.at(u)).distance);
        (lowest.found.distance, course.lower_bound(span, true))
    }

    /// Least distance by dense samples.
    fn dense(span: &Span, eval: impl Fn(Vec3) -> OnFace) -> f32 {
        (-1000..=1000)
            .map(|i| eval(span.at(i as f32 / 1000.0)).distance)
            .fold(f32::INFINITY, f32::min)
    }

    proptest! {
        /// The rim of a peg, tilted, in a bore that it nearly fills, or outside of a shaft.
        #[test]
        fn a_rim_and_a_cylinder(
            (r, room) in (1e-3f32..0.35, -1e-3f32..1e-3),
            (aside, tilt) in (-1.0f32..1.0, -0.02f32..0.02),
            about in 0.0f32..6.2,
            sense in prop::bool::ANY.prop_map(|outward| if outward { 1.0f32 } else { -1.0 }),
        ) {
            // As far as the formula follows an arc within a quarter of a micrometre, to either side.
            let half_angle = libm::powf(320.0 * 0.25e-6 / r, 1.0 / 6.0).min(0.39);
            let (s, c) = (libm::sinf(half_angle), libm::cosf(half_angle));
            let turn = glam::Quat::from_rotation_y(tilt) * glam::Quat::from_rotation_z(about);
            let middle = turn * (Vec3::X * r) + Vec3::X * (aside * room * r);
            let span = span(middle, turn * Vec3::Y * (r * s), turn * Vec3::X * (r * (c - 1.0)));
            let face = FaceRecord { kind: surface_kind::CYLINDER, sense, axis: [0.0, 0.0, 1.0], radius: r * (1.0 + room), ..FaceRecord::default() };
            let eval = |p: Vec3| {
                let out = Vec3::new(p.x, p.y, 0.0);
                let length = out.length();
                OnFace { distance: sense * (length - face.radius), normal: sense * out / length, face: 0, edge_face: 0 }
            };
            let powers = Powers::round(&face, &span, &eval(middle), Vec3::Z);
            let (found, bound) = find(&span, Some(powers), eval);
            let least = dense(&span, eval);
            let rounding = 4.0 * f32::EPSILON * r;
            // Of two minima at its ends it may find the higher: the next span, whose distance falls on from there, finds the lower.
            let ends = [-1.0, 1.0].map(|u| eval(span.at(u)).distance);
            let falls_on = least >= ends[0].min(ends[1]);
            prop_assert!(found <= if falls_on { ends[0].max(ends[1]) } else { least } + 1e-6 + rounding, "{found} {least}");
            prop_assert!(bound <= least + 1e-7 + rounding, "{least} {bound}");
            // Tight where the rim runs along the surface: but for fourth powers of its turn.
            prop_assert!(least - bound <= 1e-3 * r, "{least} {bound}");
        }
        /// A rim over a tilted plane: the plane adds no bending, so the span's own is all.
        #[test]
        fn a_rim_on_a_plane(about in 0.0f32..6.2, tilt in 0.0f32..1.5, r in 1e-3f32..0.35) {
            let (s, c) = (libm::sinf(0.39), libm::cosf(0.39));
            // An arc of ±0.39 rad about x.
            let span = span(Vec3::X * r, Vec3::Y * (r * s), Vec3::X * (r * (c - 1.0)));
            let normal = Vec3::new(libm::sinf(tilt) * libm::cosf(about), libm::sinf(tilt) * libm::sinf(about), libm::cosf(tilt));
            let eval = plane(normal, 0.0, 0);
            let (slope, bend) = (normal.dot(span.along), normal.dot(span.bend));
            let powers = Powers { slope, half: bend, rest: larger(0.25 * span.round * bend, 0.0) };
            let (found, bound) = find(&span, Some(powers), &eval);
            let least = dense(&span, &eval);
            prop_assert!(found <= least + 0.55e-6 && bound <= least + 1e-7, "{found} {least} {bound}");
        }

        /// Two planes that form a ridge: the lowest place is at the kink, which no parabola shows.
        #[test]
        fn a_kink_between_two_faces(left in 0.05f32..1.0, right in 0.05f32..1.0, at in -0.9f32..0.9) {
            let span = span(Vec3::ZERO, Vec3::X * 2e-3, Vec3::ZERO);
            let a = Vec3::new(-left, 0.0, 1.0).normalize();
            let b = Vec3::new(right, 0.0, 1.0).normalize();
            let kink = 2e-3 * at;
            let (a, b) = (plane(a, a.x * kink, 0), plane(b, b.x * kink, 1));
            let eval = |p: Vec3| { let (a, b) = (a(p), b(p)); if a.distance > b.distance { a } else { b } };
            let powers = Powers { slope: eval(Vec3::ZERO).normal.dot(span.along), half: 0.0, rest: 0.0 };
            let (found, _) = find(&span, Some(powers), eval);
            let least = dense(&span, eval);
            prop_assert!(found <= least + 0.7e-6, "{found} {least}");
        }

        /// A straight edge across a cylinder, of which the second derivative is not known.
        #[test]
        fn a_line_across_a_cylinder(r in 3e-3f32..0.1, beside in -1.0f32..1.0, height in -20e-6f32..1e-3) {
            let span = span(Vec3::new(beside * 1e-3, 0.0, r + height), Vec3::X * 1e-3, Vec3::ZERO);
            let eval = |p: Vec3| {
                let length = libm::hypotf(p.x, p.z);
                OnFace { distance: length - r, normal: Vec3::new(p.x, 0.0, p.z) / length, face: 0, edge_face: 0 }
            };
            let (found, bound) = find(&span, None, eval);
            let least = dense(&span, eval);
            prop_assert!(found <= least + 0.7e-6 && bound <= least + 1e-7, "{found} {least} {bound}");
        }
    }
}

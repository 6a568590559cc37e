//! Distance from a point to a local patch of a free-form face: a cubic height over a tangent plane.
//!
//! The foot (s, t) of a point (u, v, w) minimises (s − u)² + (t − v)² + (h(s, t) − w)²; from s = u, t = v it is reached by [`STEPS`] Newton steps. The
//! distance is taken along the normal there, so its error is of second order in that of the foot.
//!
//! Metres, shape frame. The baker verifies each cell that names a patch with this very function, so that its error includes the steps and the
//! rounding here. Cost: about 250 instructions on a Cortex-M7.

use glam::Vec3;
use mortise_protocol::image::{PatchRecord, patch_kind};

use crate::math::scalar::inverse_sqrt;
use crate::math::vector::quick_length;

/// Newton steps to the foot: each squares the error.
const STEPS: usize = 2;
/// Farthest that the two steps may end beside the foot: a share of the distance, and a length, m². Farther aside the steps have not converged, as at
/// a point that has no foot on the patch; the distance would be that of another point.
const MOST_ASIDE: f32 = 0.05;
const ASIDE_M2: f32 = 1e-12;
/// Least determinant of the Hessian, which is 1 on a plane: below it the point is at the centre of curvature and has no unique foot.
const LEAST_DETERMINANT: f32 = 1e-3;

/// Height and its derivatives at a point of the tangent plane.
struct Jet {
    h: f32,
    /// ∂h/∂u, ∂h/∂v.
    slope: [f32; 2],
    /// ∂²h/∂u², ∂²h/∂u∂v, ∂²h/∂v².
    bend: [f32; 3],
}

/// Height and derivatives of a patch at (u, v), m.
#[inline(always)]
fn jet(c: &[f32; 10], u: f32, v: f32) -> Jet {
    // h = a₀(v) + u·(a₁(v) + u·(a₂(v) + u·a₃)).
    let a0 = c[0] + v * (c[2] + v * (c[5] + v * c[9]));
    let a1 = c[1] + v * (c[4] + v * c[8]);
    let a2 = c[3] + v * c[7];
    let a3 = c[6];
    let d0 = c[2] + v * (2.0 * c[5] + 3.0 * v * c[9]);
    let d1 = c[4] + 2.0 * v * c[8];
    Jet {
        h: a0 + u * (a1 + u * (a2 + u * a3)),
        slope: [a1 + u * (2.0 * a2 + 3.0 * u * a3), d0 + u * (d1 + u * c[7])],
        bend: [
            2.0 * a2 + 6.0 * u * a3,
            d1 + 2.0 * u * c[7],
            2.0 * c[5] + 6.0 * v * c[9] + 2.0 * u * c[8],
        ],
    }
}

/// Magnitude of a side's distance, m: beyond that of any surface in a scene.
pub const SIDE_M: f32 = 1e3;

/// Distance by which a side of an edge counts at `p`, m: see [`patch_kind::SIDE`]. About 30 instructions on a Cortex-M7.
#[inline]
fn side(patch: &PatchRecord, p: Vec3) -> f32 {
    let axis = Vec3::from_array(patch.normal);
    let from = p - Vec3::from_array(patch.origin);
    let along = from.dot(axis);
    let [radius, out, height] = [patch.height[0], patch.height[1], patch.height[2]];
    let mut beyond = along * height;
    if out != 0.0 {
        beyond += (quick_length(from - axis * along) - radius) * out;
    }
    if beyond > 0.0 { SIDE_M } else { -SIDE_M }
}

/// Signed distance from `p` (m, shape frame), outward positive, and outward unit normal; `None` where the foot is not unique, is not reached, or is
/// beyond the patch's radius.
#[inline(never)]
pub fn distance_to_patch(patch: &PatchRecord, p: Vec3) -> Option<(f32, Vec3)> {
    let (x, normal) = (Vec3::from_array(patch.x), Vec3::from_array(patch.normal));
    if patch.kind == patch_kind::SIDE {
        return Some((side(patch, p), normal));
    }
    let y = normal.cross(x);
    let q = p - Vec3::from_array(patch.origin);
    let (u, v, w) = (q.dot(x), q.dot(y), q.dot(normal));
    let (mut s, mut t) = (u, v);
    let mut at = jet(&patch.height, s, t);
    for _ in 0..STEPS {
        let over = at.h - w;
        let [hs, ht] = at.slope;
        let (gs, gt) = (s - u + over * hs, t - v + over * ht);
        let ss = 1.0 + hs * hs + over * at.bend[0];
        let st = hs * ht + over * at.bend[1];
        let tt = 1.0 + ht * ht + over * at.bend[2];
        let determinant = ss * tt - st * st;
        // False for NaN too.
        if !(determinant > LEAST_DETERMINANT && ss > 0.0) {
            return None;
        }
        let inverse = 1.0 / determinant;
        s -= (tt * gs - st * gt) * inverse;
        t -= (ss * gt - st * gs) * inverse;
        at = jet(&patch.height, s, t);
    }
    let [hs, ht] = at.slope;
    let over = at.h - w;
    let (aside_s, aside_t) = (s - u + over * hs, t - v + over * ht);
    let most = MOST_ASIDE * over;
    let is_reached = aside_s * aside_s + aside_t * aside_t <= most * most + ASIDE_M2;
    // False for NaN too.
    if !(is_reached && s * s + t * t <= patch.radius * patch.radius) {
        return None;
    }
    let scale = inverse_sqrt(1.0 + hs * hs + ht * ht);
    let distance = (w - at.h - (u - s) * hs - (v - t) * ht) * scale;
    Some((distance, (normal - x * hs - y * ht) * scale))
}

#[cfg(test)]
mod tests {
    extern crate std;

    use proptest::prelude::*;

    use super::*;

    /// A patch of about 4 mm over which a curved sheet has slopes up to 0.3 and radii of 5 mm and more.
    fn patch(k: [f32; 7], turn: f32) -> PatchRecord {
        let (sin, cos) = (libm::sinf(turn), libm::cosf(turn));
        PatchRecord {
            origin: [0.02, -0.01, 0.03],
            x: [cos, sin, 0.0],
            normal: [-sin * 0.6, cos * 0.6, 0.8],
            height: [
                0.0,
                0.0,
                0.0,
                100.0 * k[0],
                100.0 * k[1],
                100.0 * k[2],
                8e3 * k[3],
                8e3 * k[4],
                8e3 * k[5],
                8e3 * k[6],
            ],
            radius: 0.004,
            face: 3,
            kind: patch_kind::HEIGHT,
        }
    }

    /// Point and unit normal of a patch at (s, t), in double precision.
    fn surface(patch: &PatchRecord, s: f64, t: f64) -> ([f64; 3], [f64; 3]) {
        let c = patch.height.map(f64::from);
        let h = c[0]
            + c[1] * s
            + c[2] * t
            + c[3] * s * s
            + c[4] * s * t
            + c[5] * t * t
            + c[6] * s * s * s
            + c[7] * s * s * t
            + c[8] * s * t * t
            + c[9] * t * t * t;
        let hs = c[1] + 2.0 * c[3] * s + c[4] * t + 3.0 * c[6] * s * s + 2.0 * c[7] * s * t + c[8] * t * t;
        let ht = c[2] + c[4] * s + 2.0 * c[5] * t + c[7] * s * s + 2.0 * c[8] * s * t + 3.0 * c[9] * t * t;
        let [x, n, o] = [patch.x, patch.normal, patch.origin].map(|v| v.map(f64::from));
        let y = [
            n[1] * x[2] - n[2] * x[1],
            n[2] * x[0] - n[0] * x[2],
            n[0] * x[1] - n[1] * x[0],
        ];
        let scale = 1.0 / libm::sqrt(1.0 + hs * hs + ht * ht);
        (
            core::array::from_fn(|k| o[k] + x[k] * s + y[k] * t + n[k] * h),
            core::array::from_fn(|k| (n[k] - x[k] * hs - y[k] * ht) * scale),
        )
    }

    proptest! {
        /// A point placed on the normal over a point of the patch has that distance and that normal. Within 0.3 mm of a sheet with radii of at least
        /// 2 mm (both kinds of curvature together) the two steps leave less than 0.05 µm, most of it rounding at 40 mm from the origin.
        #[test]
        fn a_point_over_the_patch_has_its_height(
            k in prop::array::uniform7(-1.0f32..1.0),
            turn in -3.0f32..3.0,
            foot in prop::array::uniform2(-0.002f64..0.002),
            distance in -0.0003f64..0.0003,
        ) {
            let patch = patch(k, turn);
            let (at, normal) = surface(&patch, foot[0], foot[1]);
            let p = Vec3::from_array(core::array::from_fn(|i| (at[i] + normal[i] * distance) as f32));
            let (found, direction) = distance_to_patch(&patch, p).expect("nearer than the radius");
            prop_assert!((f64::from(found) - distance).abs() < 5e-8, "{found} {distance}");
            let cosine: f64 = (0..3).map(|i| f64::from(direction[i]) * normal[i]).sum();
            prop_assert!(cosine > 1.0 - 1e-5, "{cosine}");
        }
    }

    proptest! {
        /// Wherever there is an answer, the point at that distance along the normal is on the patch, within its radius: at most a twentieth of the distance
        /// beside the foot, which bends away from its tangent plane by less than that.
        #[test]
        fn an_answer_leads_to_the_patch(
            k in prop::array::uniform7(-1.0f32..1.0),
            turn in -3.0f32..3.0,
            at in prop::array::uniform3(-0.02f32..0.02),
        ) {
            let patch = patch(k, turn);
            let p = Vec3::from_array(patch.origin) + Vec3::from_array(at);
            if let Some((distance, normal)) = distance_to_patch(&patch, p) {
                let (x, up) = (Vec3::from_array(patch.x), Vec3::from_array(patch.normal));
                let q = p - normal * distance - Vec3::from_array(patch.origin);
                let (u, v, w) = (q.dot(x), q.dot(up.cross(x)), q.dot(up));
                let off = (jet(&patch.height, u, v).h - w).abs();
                prop_assert!(off <= 0.1 * distance.abs() + 2e-6, "{off} at {distance}");
                prop_assert!(u.hypot(v) <= patch.radius + 0.06 * distance.abs() + 2e-6);
            }
        }
    }

    /// Sides of planes, cylinders and cones about an axis, against the sign of the distance to them; none of them depends on what is along the edge.
    #[test]
    fn sides_are_those_of_the_swept_surface() {
        let of = |height: [f32; 3]| PatchRecord {
            height: core::array::from_fn(|i| height.get(i).copied().unwrap_or(0.0)),
            kind: patch_kind::SIDE,
            ..patch([0.0; 7], 0.4)
        };
        let plane = of([0.0, 0.0, 1.0]);
        let (axis, x) = (Vec3::from_array(plane.normal), Vec3::from_array(plane.x));
        let origin = Vec3::from_array(plane.origin);
        let at = |rho: f32, along: f32| origin + x * rho + axis * along;
        let on = |side: [f32; 3], p: Vec3| distance_to_patch(&of(side), p).map(|(distance, _)| distance);
        let diagonal = core::f32::consts::FRAC_1_SQRT_2;
        for (rho, along) in [
            (0.004, 0.001),
            (0.006, 0.001),
            (0.004, -0.001),
            (0.0, 0.002),
            (0.0045, -0.002),
        ] {
            let p = at(rho, along);
            let sign = |beyond: f32| Some(if beyond > 0.0 { SIDE_M } else { -SIDE_M });
            assert_eq!(on([0.0, 0.0, 1.0], p), sign(along));
            assert_eq!(on([0.0, 0.0, -1.0], p), sign(-along));
            assert_eq!(on([0.005, 1.0, 0.0], p), sign(rho - 0.005));
            assert_eq!(on([0.005, -1.0, 0.0], p), sign(0.005 - rho));
            assert_eq!(on([0.005, diagonal, diagonal], p), sign(rho - 0.005 + along));
        }
    }

    #[test]
    fn at_the_centre_of_curvature_there_is_no_foot() {
        let bowl = patch([1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 0.0);
        let normal = Vec3::from_array(bowl.normal);
        let origin = Vec3::from_array(bowl.origin);
        assert!(distance_to_patch(&bowl, origin + normal * 0.0051).is_none());
        assert!(distance_to_patch(&bowl, origin + Vec3::splat(f32::NAN)).is_none());
        assert!(distance_to_patch(&bowl, origin + normal * 0.001).is_some());
    }
}

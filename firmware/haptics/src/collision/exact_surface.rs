//! Distance from a point to a baked shape by its analytic faces: exact where the field interpolates or has ended.
//!
//! A face record is an unbounded surface; the cells of the field name those that give the distance there. The nearest point of an edge is that of the
//! two surfaces' intersection, by Newton steps.
//!
//! Faces without closed form answer by their local patches ([`super::patch`]), where cells name them.
//!
//! Metres, shape frame. Every loop is bounded by the number of faces of a cell. Cost: one projection per face.

use glam::Vec3;
use mortise_protocol::image::{
    FaceRecord, Group, NO_FACE, Nearby, Place, Shape, Surface, Surfaces, surface_kind,
};

use crate::collision::patch::distance_to_patch;
use crate::math::scalar::{inverse_sqrt, sin_cos};
use crate::math::vector::length;

/// Sine of the smallest angle between faces that form an edge: below it one face continues the other.
const LEAST_EDGE_SINE: f32 = 0.05;
/// A touching point within this distance of an edge touches the edge, m: several times the depth of a contact.
const AT_EDGE_M: f32 = 10e-6;
/// A foot is on a face's side of an edge within this distance, m: rounding.
const BESIDE_M: f32 = 0.1e-6;
/// Newton steps to an edge: each squares the error, which starts below the radius of curvature.
const EDGE_STEPS: usize = 6;

/// A point on a face's unbounded surface.
#[derive(Clone, Copy)]
struct Foot {
    /// Signed distance to it, outside positive, m.
    distance: f32,
    point: Vec3,
    /// Outward unit normal there.
    normal: Vec3,
}

/// Signed distance, outside positive, and foot of the perpendicular from `p`; none for a face without closed form, or where the foot is
/// not unique.
#[inline(never)]
fn foot(face: &FaceRecord, p: Vec3) -> Option<Foot> {
    let (distance, normal) = signed(face, p)?;
    Some(Foot {
        distance,
        point: p - normal * distance,
        normal,
    })
}

/// Signed distance, outside positive, and outward unit normal; `None` as in [`foot`].
#[inline(always)]
pub(crate) fn signed(face: &FaceRecord, p: Vec3) -> Option<(f32, Vec3)> {
    let axis = Vec3::from_array(face.axis);
    let from = p - Vec3::from_array(face.origin);
    if face.kind == surface_kind::SPHERE {
        let (r, out) = polar(from)?;
        return Some(((r - face.radius) * face.sense, out * face.sense));
    }
    let along = from.dot(axis);
    if face.kind == surface_kind::PLANE {
        return Some((along * face.sense, axis * face.sense));
    }
    let (r, out) = polar(from - axis * along)?;
    let (natural, normal) = match face.kind {
        surface_kind::CYLINDER => (r - face.radius, out),
        surface_kind::CONE => {
            let (sin, cos) = sin_cos(face.second);
            ((r - face.radius) * cos - along * sin, out * cos - axis * sin)
        }
        surface_kind::TORUS => {
            let (r, out) = polar(from - out * face.radius)?;
            (r - face.second, out)
        }
        _ => return None,
    };
    Some((natural * face.sense, normal * face.sense))
}

/// vᵀ·H·v, with the Hessian H of the signed distance to `face` at `p`, where it is as `found`, m for `v` in m; `None` for a face without closed form
/// and where the foot is not unique. About 40 instructions on a Cortex-M7 but for cones and tori.
#[inline]
pub(crate) fn bending(face: &FaceRecord, p: Vec3, found: &OnFace, v: Vec3) -> Option<f32> {
    let squared = v.length_squared();
    let natural = found.distance * face.sense;
    let across = found.normal.dot(v);
    let axis = Vec3::from_array(face.axis);
    match face.kind {
        surface_kind::PLANE => Some(0.0),
        surface_kind::SPHERE => Some((squared - across * across) * face.sense / (natural + face.radius)),
        surface_kind::CYLINDER => {
            let axial = axis.dot(v);
            let around = squared - across * across - axial * axial;
            Some(around * face.sense / (natural + face.radius))
        }
        surface_kind::CONE | surface_kind::TORUS => {
            let from = p - Vec3::from_array(face.origin);
            let (r, out) = polar(from - axis * from.dot(axis))?;
            let (radial, axial) = (out.dot(v), axis.dot(v));
            // Square of the component round the axis.
            let around = squared - radial * radial - axial * axial;
            let outward = found.normal.dot(out) / r;
            if face.kind == surface_kind::CONE {
                return Some(around * outward);
            }
            let in_section = squared - around - across * across;
            Some(in_section * face.sense / (natural + face.second) + around * outward)
        }
        _ => None,
    }
}

/// Length and direction of `v`, unless it is zero.
#[inline]
fn polar(v: Vec3) -> Option<(f32, Vec3)> {
    let squared = v.length_squared();
    (squared > 1e-18).then(|| {
        let inverse = inverse_sqrt(squared);
        (squared * inverse, v * inverse)
    })
}

/// Largest curvature of a face's surface near `p`, 1/m.
fn curvature(face: &FaceRecord, p: Vec3) -> f32 {
    let radius = match face.kind {
        surface_kind::PLANE => return 0.0,
        surface_kind::TORUS => face.second,
        surface_kind::CONE => {
            let axis = Vec3::from_array(face.axis);
            let from = p - Vec3::from_array(face.origin);
            length(from - axis * from.dot(axis))
        }
        _ => face.radius,
    };
    1.0 / if radius > 1e-9 { radius } else { 1e-9 }
}

/// Distance, normal and faces of the exact surface nearest to a point.
#[derive(Clone, Copy)]
pub(crate) struct OnFace {
    /// Signed distance, outside positive, m.
    pub distance: f32,
    /// Outward unit normal there.
    pub normal: Vec3,
    /// Face of that surface.
    pub face: u16,
    /// The second face where the point is at an edge, else [`NO_FACE`].
    pub edge_face: u16,
}

/// Distance and normal of one surface at `p`, by its surface index, if it is a patch or has a closed form. About 60 instructions on a Cortex-M7, 250
/// for a patch.
#[inline(always)]
pub(crate) fn on_surface_of(surfaces: Surfaces<'_>, surface: u16, p: Vec3) -> Option<OnFace> {
    let (face, (distance, normal)) = match surfaces.get(surface)? {
        Surface::Face(face) => (surface, signed(face, p)?),
        Surface::Patch(patch) => (patch.face, distance_to_patch(patch, p)?),
    };
    Some(OnFace {
        distance,
        normal,
        face,
        edge_face: NO_FACE,
    })
}

/// Distance of a shape at a point as the tick computes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rendered {
    /// Signed distance, outside positive, m.
    pub distance: f32,
    /// Surfaces that the point's cell names.
    pub nearby: Nearby,
    /// Whether the distance is interpolated, because the surfaces do not give it.
    pub interpolated: bool,
}

/// Distance of `shape` at `p` (m, shape frame) as the tick computes it; `None` outside of all cells. For measurement, not for the tick.
pub fn rendered_distance(shape: &Shape<'_>, p: Vec3) -> Option<Rendered> {
    let Place::Cell(cell) = shape.field.place(p.to_array()) else {
        return None;
    };
    let nearby = shape.field.nearby(&cell);
    let by_surfaces = exact(shape.surfaces(), nearby, p);
    Some(Rendered {
        distance: by_surfaces.map_or_else(|| shape.field.distance(&cell), |(distance, _)| distance),
        nearby,
        interpolated: by_surfaces.is_none(),
    })
}

/// Signed distance (outside positive, m) at `p` by the surfaces that `nearby` names, and the surface it belongs to; `None` where the interpolated
/// distance is to be used. Outside an edge or corner it is a lower bound of the distance. About 50 instructions per face on a Cortex-M7.
#[inline]
pub(crate) fn exact(surfaces: Surfaces<'_>, nearby: Nearby, p: Vec3) -> Option<(f32, u16)> {
    let (group, sign) = match nearby {
        Nearby::Face(face) => return distance(surfaces, face, p).map(|d| (d, face)),
        Nearby::Convex(group) => (group, 1.0),
        Nearby::Reentrant(group) => (group, -1.0),
        Nearby::Roughly(_) | Nearby::Unknown => return None,
    };
    let eval = |face| Some((distance(surfaces, face, p)?, face));
    fold(
        group,
        sign,
        eval,
        |a: (f32, u16), b, sign| {
            if (b.0 - a.0) * sign > 0.0 { b } else { a }
        },
    )
}

/// The value of a group: `extreme` of its clauses with `sign`, each clause `extreme` of its faces with −`sign`. `None` where a face has none.
#[inline(always)]
fn fold<T: Copy>(
    group: Group,
    sign: f32,
    mut eval: impl FnMut(u16) -> Option<T>,
    extreme: impl Fn(T, T, f32) -> T,
) -> Option<T> {
    let (mut all, mut clause) = (None, None);
    for (face, joined) in group.faces() {
        let own = eval(face)?;
        let so_far = clause.map_or(own, |clause| extreme(clause, own, -sign));
        if joined {
            clause = Some(so_far);
        } else {
            clause = None;
            all = Some(all.map_or(so_far, |all| extreme(all, so_far, sign)));
        }
    }
    all
}

/// As [`exact`], with the normal of the face found, and the second face if its distance is equal to within [`AT_EDGE_M`]. About 80 instructions per
/// face on a Cortex-M7.
#[inline]
pub(crate) fn exact_on_face(surfaces: Surfaces<'_>, nearby: Nearby, p: Vec3) -> Option<OnFace> {
    let (group, sign) = match nearby {
        Nearby::Face(face) => return on_surface_of(surfaces, face, p),
        Nearby::Convex(group) => (group, 1.0),
        Nearby::Reentrant(group) => (group, -1.0),
        Nearby::Roughly(_) | Nearby::Unknown => return None,
    };
    fold(
        group,
        sign,
        |face| on_surface_of(surfaces, face, p),
        |mut found, other, sign| {
            let ahead = (other.distance - found.distance) * sign;
            let at_edge = ahead.abs() < AT_EDGE_M;
            if ahead > 0.0 {
                let edge_face = if at_edge { found.face } else { NO_FACE };
                found = OnFace { edge_face, ..other };
            } else if at_edge && found.edge_face == NO_FACE {
                found.edge_face = other.face;
            }
            found
        },
    )
}

/// The result that [`exact_on_face`] would give if every face were farther off by its `allowance_m`; `found` is the result without allowances, and
/// is returned where a face has no closed form. About 60 instructions per face.
#[inline(never)]
pub(crate) fn with_allowance(
    found: OnFace,
    surfaces: Surfaces<'_>,
    nearby: Nearby,
    p: Vec3,
    mut allowance_m: impl FnMut(u16) -> f32,
) -> OnFace {
    let (group, sign) = match nearby {
        Nearby::Convex(group) => (group, 1.0),
        Nearby::Reentrant(group) => (group, -1.0),
        _ => return found,
    };
    let eval = |face| {
        let own = on_surface_of(surfaces, face, p)?;
        Some((own.distance + allowance_m(own.face), own))
    };
    let chosen = fold(
        group,
        sign,
        eval,
        |a: (f32, OnFace), b, sign| {
            if (b.0 - a.0) * sign > 0.0 { b } else { a }
        },
    );
    match chosen {
        Some((_, other)) if other.face != found.face => other,
        _ => found,
    }
}

/// Signed distance (outside positive, m) at `p` where an edge or corner of a cell may be nearest: outside a convex one, inside a re-entrant one. It is
/// that of the extreme face where the foot on it is on the other faces' side, else that of the edge with the face it is farthest beyond; at least the
/// faces' distance in magnitude. `None` for groups with clauses, and where neither point belongs to all faces.
pub(crate) fn beside_edge(surfaces: Surfaces<'_>, nearby: Nearby, p: Vec3) -> Option<f32> {
    let (group, sign) = match nearby {
        Nearby::Convex(group) => (group, 1.0),
        Nearby::Reentrant(group) => (group, -1.0),
        _ => return None,
    };
    if !group.is_plain() {
        return None;
    }
    let all = || group.faces().map(|(face, _)| face);
    // Of all faces but two the one that a point is farthest beyond, and by how much.
    let farthest = |p: Vec3, but: [u16; 2]| {
        let mut most = (f32::NEG_INFINITY, NO_FACE);
        for face in all().filter(|face| !but.contains(face)) {
            let beyond = sign * distance(surfaces, face, p)?;
            if beyond > most.0 {
                most = (beyond, face);
            }
        }
        Some(most)
    };
    let (_, first) = farthest(p, [NO_FACE; 2])?;
    let on = on_surface_of(surfaces, first, p)?;
    let (beyond, second) = farthest(p - on.normal * on.distance, [first, NO_FACE])?;
    if beyond <= BESIDE_M {
        return Some(on.distance);
    }
    let (Surface::Face(a), Surface::Face(b)) = (surfaces.get(first)?, surfaces.get(second)?) else {
        return None;
    };
    let edge = edge_foot(a, b, p)?;
    (farthest(edge, [first, second])?.0 <= BESIDE_M).then(|| sign * length(p - edge))
}

#[inline]
fn distance(surfaces: Surfaces<'_>, surface: u16, p: Vec3) -> Option<f32> {
    let face = match surfaces.get(surface)? {
        Surface::Face(face) => face,
        Surface::Patch(patch) => return distance_to_patch(patch, p).map(|(distance, _)| distance),
    };
    let from = p - Vec3::from_array(face.origin);
    let along = from.dot(Vec3::from_array(face.axis));
    match face.kind {
        surface_kind::PLANE => Some(along * face.sense),
        surface_kind::CYLINDER => {
            let squared = from.length_squared() - along * along;
            if squared > 1e-12 {
                return Some((squared * inverse_sqrt(squared) - face.radius) * face.sense);
            }
            off_center(face, p)
        }
        _ => match foot(face, p) {
            Some(foot) => Some(foot.distance),
            None => off_center(face, p),
        },
    }
}

/// Signed distance where the foot is not unique: on the axis of a cylinder, cone or torus, on the circle within a torus, at the centre of a sphere.
/// `None` for a face without closed form.
#[cold]
#[inline(never)]
fn off_center(face: &FaceRecord, p: Vec3) -> Option<f32> {
    let from = p - Vec3::from_array(face.origin);
    let along = from.dot(Vec3::from_array(face.axis));
    let natural = match face.kind {
        surface_kind::CONE => {
            let (sin, cos) = sin_cos(face.second);
            -face.radius * cos - along * sin
        }
        surface_kind::TORUS => {
            let out = length(from - Vec3::from_array(face.axis) * along) - face.radius;
            libm::sqrtf(out * out + along * along) - face.second
        }
        surface_kind::CYLINDER | surface_kind::SPHERE => -face.radius,
        _ => return None,
    };
    Some(natural * face.sense)
}

/// Distance to the surface of `face` when it agrees with the field's `distance` at `p` within the error of interpolation: twice cell²·κ/8 in each of
/// two directions, and two steps of a sample. Then no edge lies between.
pub(crate) fn agreeing(shape: &Shape<'_>, face: u16, p: Vec3, distance: f32) -> Option<f32> {
    let face = shape.faces.get(usize::from(face))?;
    let exact = foot(face, p)?.distance;
    let record = shape.field.record();
    let tolerance = 0.5 * record.cell * record.cell * curvature(face, p) + 2.0 * record.scale;
    ((exact - distance).abs() <= tolerance).then_some(exact)
}

/// Whether every face has a closed form.
pub(crate) fn closed_form(shape: &Shape<'_>) -> bool {
    shape.faces.iter().all(|face| face.kind != surface_kind::OTHER)
}

/// The point nearest to `p` on the intersection of two surfaces: Newton steps, each the point nearest to `p` on the line in which the tangent planes
/// meet. `None` where the surfaces do not intersect, or hardly.
pub(crate) fn edge_foot(a: &FaceRecord, b: &FaceRecord, p: Vec3) -> Option<Vec3> {
    let mut x = p;
    let mut residual = f32::INFINITY;
    for _ in 0..EDGE_STEPS {
        let (fa, fb) = (foot(a, x)?, foot(b, x)?);
        residual = fa.distance.abs() + fb.distance.abs();
        let cosine = fa.normal.dot(fb.normal);
        let sine2 = 1.0 - cosine * cosine;
        if sine2 < LEAST_EDGE_SINE * LEAST_EDGE_SINE {
            return None;
        }
        // From p, to the plane through each foot.
        let (da, db) = ((fa.point - p).dot(fa.normal), (fb.point - p).dot(fb.normal));
        let along_a = (da - cosine * db) * (1.0 / sine2);
        let along_b = (db - cosine * da) * (1.0 / sine2);
        x = p + fa.normal * along_a + fb.normal * along_b;
    }
    // A hundredth of a micrometre in a tenth of a metre: single precision.
    (residual <= 1e-7 * (1.0 + 10.0 * length(x))).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cylinder(sense: f32) -> FaceRecord {
        FaceRecord {
            kind: surface_kind::CYLINDER,
            sense,
            origin: [0.0; 3],
            axis: [0.0, 0.0, 1.0],
            radius: 0.01,
            second: 0.0,
        }
    }

    #[test]
    fn rim_of_a_cylinder() {
        let top = FaceRecord {
            kind: surface_kind::PLANE,
            sense: 1.0,
            origin: [0.0, 0.0, 0.02],
            axis: [0.0, 0.0, 1.0],
            radius: 0.0,
            second: 0.0,
        };
        let p = Vec3::new(0.0090, 0.0110, 0.025);
        let edge = edge_foot(&cylinder(1.0), &top, p).expect("they cross");
        let expected = Vec3::new(0.0090, 0.0110, 0.0) * (0.01 / libm::hypotf(0.0090, 0.0110))
            + Vec3::new(0.0, 0.0, 0.02);
        assert!(length(edge - expected) < 1e-8, "{edge} {expected}");
        let parallel = FaceRecord {
            origin: [0.0, 0.0, 0.03],
            ..top
        };
        assert!(edge_foot(&parallel, &top, p).is_none());
    }

    /// Where the foot is not unique the distance is that of the places beside it, to a micrometre aside.
    #[test]
    fn distances_are_continuous_at_centers() {
        let plain = cylinder(-1.0);
        let of = |kind| FaceRecord {
            kind,
            second: 0.3,
            ..plain
        };
        let tube = FaceRecord {
            second: 0.002,
            ..of(surface_kind::TORUS)
        };
        let on_axis = Vec3::new(0.0, 0.0, 0.004);
        for (face, center) in [
            (plain, on_axis),
            (of(surface_kind::CONE), on_axis),
            (of(surface_kind::SPHERE), Vec3::ZERO),
            (tube, on_axis),
            (tube, Vec3::new(0.01, 0.0, 0.0)),
        ] {
            let faces = [face];
            let surfaces = Surfaces {
                faces: &faces,
                patches: &[],
            };
            let at = |p: Vec3| distance(surfaces, 0, p).expect("a closed form");
            let beside = at(center + Vec3::new(1.5e-6, 1.5e-6, 0.0));
            assert!((at(center) - beside).abs() < 3e-6, "{} at {center}", face.kind);
        }
    }

    /// The Hessian agrees with second differences of the distance.
    #[test]
    fn bending_is_the_second_derivative() {
        for (kind, second) in [
            (surface_kind::PLANE, 0.0),
            (surface_kind::CYLINDER, 0.0),
            (surface_kind::CONE, 0.3),
            (surface_kind::SPHERE, 0.0),
            (surface_kind::TORUS, 0.002),
        ] {
            let face = FaceRecord {
                kind,
                second,
                ..cylinder(-1.0)
            };
            let (p, v) = (
                Vec3::new(0.012, -0.004, 0.003),
                Vec3::new(0.3e-3, 0.5e-3, -0.4e-3),
            );
            let at = |u: f32| {
                f64::from(
                    distance(
                        Surfaces {
                            faces: &[face],
                            patches: &[],
                        },
                        0,
                        p + v * u,
                    )
                    .unwrap(),
                )
            };
            let differences = at(1.0) - 2.0 * at(0.0) + at(-1.0);
            let surfaces = Surfaces {
                faces: &[face],
                patches: &[],
            };
            let found = f64::from(bending(&face, p, &on_surface_of(surfaces, 0, p).unwrap(), v).unwrap());
            // Rounding of distances of a centimetre, and fourth derivatives.
            assert!(
                (found - differences).abs() < 6e-9 + 0.02 * found.abs(),
                "{kind}: {found} {differences}"
            );
        }
    }

    #[test]
    fn feet_lie_on_their_surfaces() {
        let plain = cylinder(-1.0);
        let kinds = [
            plain,
            FaceRecord {
                kind: surface_kind::SPHERE,
                ..plain
            },
            FaceRecord {
                kind: surface_kind::CONE,
                second: 0.3,
                ..plain
            },
            FaceRecord {
                kind: surface_kind::TORUS,
                second: 0.002,
                ..plain
            },
        ];
        for face in kinds {
            let p = Vec3::new(0.013, -0.004, 0.003);
            let f = foot(&face, p).expect("unique");
            assert!((length(p - f.point) - f.distance.abs()).abs() < 1e-8);
            let again = foot(&face, f.point).expect("unique");
            assert!(again.distance.abs() < 1e-8, "{} {}", face.kind, again.distance);
            // Outside the solid is where the surface's natural inside is.
            assert!((p - f.point).dot(f.normal) * f.distance > 0.0);
        }
    }
}

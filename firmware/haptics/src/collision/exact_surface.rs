//! Distance from a point to a baked shape by its analytic faces: exact where the field interpolates or has ended.
//!
//! A face record is an unbounded surface; the field determines which piece of it belongs to the shape: a foot of the perpendicular counts when the
//! field has the shape's surface there. Near an edge the field is not sharp enough, so there the other face decides: at a convex edge a foot outside
//! the other face's surface is beyond the edge, at a re-entrant edge one inside it. The nearest point of an edge is that of the two surfaces'
//! intersection, by Newton steps.
//!
//! Faces without closed form answer by their local patches ([`super::patch`]), where cells name them.
//!
//! Metres, shape frame. Every loop is bounded by the number of faces (squared, for edges). Cost: one projection per face, and a field query for each
//! face that could be nearest.

use glam::Vec3;
use mortise_protocol::image::{
    FaceRecord, Group, NO_FACE, Nearby, Place, Shape, Surface, Surfaces, surface_kind,
};

use crate::collision::patch::distance_to_patch;
use crate::math::scalar::inverse_sqrt;
use crate::math::vector::length;

/// A foot counts when the field's distance there is below this many cells: interpolation errs by 0.2 cells next to a right angle.
const ON_SURFACE_CELLS: f32 = 0.3;
/// The same by exact surfaces, m: single precision, and the micrometre within which surfaces are verified.
const ON_SURFACE_M: f32 = 2e-6;
/// Within this many cells of an edge the other face decides whether a foot is beyond it.
const NEAR_EDGE_CELLS: f32 = 2.0;
/// Sine of the smallest angle between faces that form an edge: below it one face continues the other.
const LEAST_EDGE_SINE: f32 = 0.05;
/// A touching point within this distance of an edge touches the edge, m: several times the depth of a contact.
const AT_EDGE_M: f32 = 10e-6;
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
            let (sin, cos) = (libm::sinf(face.second), libm::cosf(face.second));
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

/// Length and direction of `v`, unless it is zero.
#[inline]
fn polar(v: Vec3) -> Option<(f32, Vec3)> {
    let squared = v.length_squared();
    (squared > 1e-18).then(|| {
        let inverse = inverse_sqrt(squared);
        (squared * inverse, v * inverse)
    })
}

/// `v` over its length, unless that is zero.
fn unit(v: Vec3, length: f32) -> Option<Vec3> {
    (length > 1e-9).then(|| v * (1.0 / length))
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
        surface_kind::CONE => -face.radius * libm::cosf(face.second) - along * libm::sinf(face.second),
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

/// Whether every face has a closed form, the condition for [`unsigned_distance`].
pub(crate) fn closed_form(shape: &Shape<'_>) -> bool {
    shape.faces.iter().all(|face| face.kind != surface_kind::OTHER)
}

/// Distance from `p` to a shape's faces and edges, never negative; `None` when nothing was found. All faces must have a [`closed_form`]. Samples of
/// edges and corners are included where an edge ends before its foot, where there is no foot at all, or with `corners`: one corner against another is
/// found in no other way.
///
/// Distances of `enough` or more are returned as `enough`.
pub(crate) fn unsigned_distance(shape: &Shape<'_>, p: Vec3, mut corners: bool, enough: f32) -> Option<f32> {
    let near_edge = NEAR_EDGE_CELLS * shape.field.record().cell;
    let mut best = enough;
    // Faces that may be near, including those whose foot is not unique.
    let mut near = 0;
    for (a, face) in shape.faces.iter().enumerate() {
        let Some(foot_a) = foot(face, p) else {
            near += 1;
            continue;
        };
        let distance = foot_a.distance.abs();
        near += usize::from(distance < enough);
        if distance < best
            && on_surface(shape, foot_a.point)
            && !beyond(shape, [a; 2], foot_a.point, near_edge)
        {
            best = distance;
        }
    }
    // An edge or corner lies on at least two faces, and is no nearer than they are.
    if near < 2 {
        return best.is_finite().then_some(best);
    }
    for (a, face) in shape.faces.iter().enumerate() {
        let nearer = |face, best| foot(face, p).is_some_and(|f| f.distance.abs() < best);
        if !nearer(face, best) {
            continue;
        }
        for (b, other) in shape.faces.iter().enumerate().skip(a + 1) {
            if nearer(other, best)
                && let Some(edge) = edge_foot(face, other, p)
                && on_surface(shape, edge)
            {
                let distance = length(p - edge);
                if distance < best {
                    // Past a corner the two surfaces still intersect, but the edge has ended.
                    if [[a, b], [b, a]]
                        .iter()
                        .any(|&of| beyond(shape, of, edge, near_edge))
                    {
                        corners = true;
                    } else {
                        best = distance;
                    }
                }
            }
        }
    }
    if corners || best.is_infinite() {
        best = nearest_edge_point(shape, p, best);
    }
    best.is_finite().then_some(best)
}

/// Distance from `p` to the nearest sample of an edge or corner, an upper bound of the distance to the surface; `enough` when all are farther.
fn nearest_edge_point(shape: &Shape<'_>, p: Vec3, enough: f32) -> f32 {
    let mut best = enough;
    let mut index = 0;
    while let Some(node) = shape.nodes.get(index) {
        let reach = best + node.radius;
        if (Vec3::from_array(node.center) - p).length_squared() > reach * reach {
            index = node.skip as usize;
            continue;
        }
        index += 1;
        if node.skip as usize != index {
            continue;
        }
        let edges = node.points(shape.points).iter();
        for point in edges.filter(|point| point.edge_face != NO_FACE) {
            let squared = (Vec3::from_array(point.position) - p).length_squared();
            if squared < best * best {
                best = libm::sqrtf(squared);
            }
        }
    }
    best
}

/// Whether the field has the surface at `p`: within its resolution where it stores samples, else by the surfaces that it names.
fn on_surface(shape: &Shape<'_>, p: Vec3) -> bool {
    let Place::Cell(cell) = shape.field.place(p.to_array()) else {
        return false;
    };
    if cell.has_samples() {
        return shape.field.distance(&cell).abs() <= ON_SURFACE_CELLS * shape.field.record().cell;
    }
    exact(shape.surfaces(), shape.field.nearby(&cell), p)
        .is_some_and(|(distance, _)| distance.abs() <= ON_SURFACE_M)
}

/// Signed distance at `p` by the field, by the surfaces that it names where it stores no samples, or a signed lower bound of its magnitude, m.
pub(crate) fn field_bound(shape: &Shape<'_>, p: Vec3) -> f32 {
    if let Place::Cell(cell) = shape.field.place(p.to_array())
        && !cell.has_samples()
        && let Some((distance, _)) = exact(shape.surfaces(), shape.field.nearby(&cell), p)
    {
        return distance;
    }
    shape.field.bound(p.to_array())
}

/// Whether `p` on the surface of face `of[0]` lies beyond its edge with another near face; `of[1]` is ignored.
fn beyond(shape: &Shape<'_>, of: [usize; 2], p: Vec3, near_edge: f32) -> bool {
    let Some(face) = shape.faces.get(of[0]) else {
        return false;
    };
    shape.faces.iter().enumerate().any(|(b, other)| {
        !of.contains(&b)
            && foot(other, p).is_some_and(|o| o.distance.abs() < near_edge)
            && beyond_edge(shape, face, other, p, near_edge)
    })
}

/// Whether `p` on the surface of `face` lies beyond its edge with `other`, if there is one within `near_edge`.
fn beyond_edge(shape: &Shape<'_>, face: &FaceRecord, other: &FaceRecord, p: Vec3, near_edge: f32) -> bool {
    let Some(edge) = edge_foot(face, other, p) else {
        return false;
    };
    if length(edge - p) > near_edge || !on_surface(shape, edge) {
        return false;
    }
    let (Some(a), Some(b)) = (foot(face, edge), foot(other, edge)) else {
        return false;
    };
    // From the edge along the first normal and against the second: outside at a convex edge, inside at a re-entrant one.
    let across = a.normal - b.normal;
    let Some(across) = unit(across, length(across)) else {
        return false;
    };
    let convex = field_bound(shape, edge + across * near_edge) > 0.0;
    let side = foot(other, p).map_or(0.0, |f| f.distance);
    if convex { side > 0.0 } else { side < 0.0 }
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

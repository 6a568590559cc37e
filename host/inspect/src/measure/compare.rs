//! How two placed entities lie to each other.

use glam::DVec3;
use mortise_brep::Surface;

use super::entity::{Entity, Kind};
use super::least::{Least, Placed, least};
use super::line::{AxisLine, Straight, nearest_of};

/// Angle below which planes count as parallel, rad: over a metre they deviate by a micrometre.
const PARALLEL_RAD: f64 = 1e-6;
/// Angle and distance of axes below which cylinders count as coaxial: what a shaft has as play in a close fit.
const COAXIAL: (f64, f64) = (1e-3, 0.01);

/// The angle of two directions, 0 to π/2, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Angle {
    /// Of two edges or axes.
    Lines(f64),
    /// Of two planes: 0 where they are parallel.
    Planes(f64),
    /// Of an edge or axis and a plane: 0 where it is parallel to the plane.
    LinePlane(f64),
}

/// What two coaxial cylinders have between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Radial {
    /// Radius of the hole less that of the shaft, mm, below 0 for an interference; of two holes or two shafts the difference without sign.
    pub clearance_mm: f64,
    /// Whether one is a hole and the other a shaft.
    pub fit: bool,
}

/// How two entities lie to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Their least distance.
    pub least: Least,
    /// Bound of the error of the least distance, mm: 0 where all is exact.
    pub error_mm: f64,
    /// The angle of their directions, where both have one.
    pub angle: Option<Angle>,
    /// Distance of the axes of two round things, mm; `None` where the entities are the axes.
    pub axes_mm: Option<f64>,
    /// Distance of two parallel planes, mm.
    pub planes_mm: Option<f64>,
    /// Difference of the radii of two coaxial cylinders.
    pub radial: Option<Radial>,
}

/// Compares `a` and `b`. Cost: that of [`least`].
pub fn compare(a: Placed<'_>, b: Placed<'_>) -> Comparison {
    let axes = axes(a, b);
    Comparison {
        least: least(a, b),
        error_mm: a.entity.error_mm + b.entity.error_mm,
        angle: angle(a, b),
        axes_mm: axes,
        planes_mm: planes(a, b),
        radial: radial(a, b),
    }
}

/// A direction that an entity has, in world.
enum Direction {
    Along(DVec3),
    Across(DVec3),
}

fn direction(placed: Placed<'_>) -> Option<Direction> {
    let turned = |v: DVec3| placed.pose.transform_vector3(v);
    if let Some((_, normal)) = plane(placed.entity) {
        return Some(Direction::Across(turned(normal)));
    }
    let line = match &placed.entity.kind {
        Kind::Line { straight, .. } => straight.line,
        _ => placed.entity.axis()?,
    };
    Some(Direction::Along(turned(line.direction)))
}

/// A point and the normal of a flat face.
fn plane(entity: &Entity) -> Option<(DVec3, DVec3)> {
    match &entity.kind {
        Kind::Face(patch) => match patch.face.surface {
            Surface::Plane { frame } => Some((frame.origin, frame.z)),
            _ => None,
        },
        _ => None,
    }
}

/// Acute angle of two directions, exact also near 0 and π/2.
fn acute(u: DVec3, v: DVec3) -> f64 {
    u.cross(v).length().atan2(u.dot(v).abs())
}

fn angle(a: Placed<'_>, b: Placed<'_>) -> Option<Angle> {
    use Direction::{Across, Along};
    Some(match (direction(a)?, direction(b)?) {
        (Along(u), Along(v)) => Angle::Lines(acute(u, v)),
        (Across(u), Across(v)) => Angle::Planes(acute(u, v)),
        (Along(u), Across(v)) | (Across(u), Along(v)) => {
            Angle::LinePlane(u.dot(v).abs().atan2(u.cross(v).length()))
        }
    })
}

fn planes(a: Placed<'_>, b: Placed<'_>) -> Option<f64> {
    let placed = |side: Placed<'_>| {
        let (point, normal) = plane(side.entity)?;
        Some((
            side.pose.transform_point3(point),
            side.pose.transform_vector3(normal),
        ))
    };
    let ((p, u), (q, v)) = (placed(a)?, placed(b)?);
    (acute(u, v) <= PARALLEL_RAD).then(|| (q - p).dot(u).abs())
}

/// Axes of both, in world.
fn lines(a: Placed<'_>, b: Placed<'_>) -> Option<[AxisLine; 2]> {
    Some([a.entity.axis()?.placed(&a.pose), b.entity.axis()?.placed(&b.pose)])
}

fn axes(a: Placed<'_>, b: Placed<'_>) -> Option<f64> {
    let are_axes = [a, b]
        .iter()
        .all(|side| matches!(side.entity.kind, Kind::Axis { .. }));
    let lines = lines(a, b).filter(|_| !are_axes)?;
    let [p, q] = nearest_of(Straight::whole(lines[0]), Straight::whole(lines[1]));
    Some(p.distance(q))
}

fn radial(a: Placed<'_>, b: Placed<'_>) -> Option<Radial> {
    let cylinder = |side: Placed<'_>| match &side.entity.kind {
        Kind::Face(patch) => match patch.face.surface {
            Surface::Cylinder { radius, .. } => Some((radius, patch.face.reversed, patch.middle())),
            _ => None,
        },
        _ => None,
    };
    let ((r, hollow_a, middle), (s, hollow_b, _)) = (cylinder(a)?, cylinder(b)?);
    let [own, other] = lines(a, b)?;
    let on_own = own.nearest(a.pose.transform_point3(middle));
    let off = on_own.distance(other.nearest(on_own));
    if acute(own.direction, other.direction) > COAXIAL.0 || off > COAXIAL.1 {
        return None;
    }
    let fit = hollow_a != hollow_b;
    let clearance_mm = match (fit, hollow_a) {
        (true, true) => r - s,
        (true, false) => s - r,
        (false, _) => (r - s).abs(),
    };
    Some(Radial { clearance_mm, fit })
}

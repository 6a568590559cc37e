//! Plane ports: the larger flats of a part with the region that each covers (Jung 2003, section 3), and whether two lie on each other.

use glam::{DAffine3, DVec3};
use mortise_brep::Shape;
use mortise_mating::{MergedSurface, PlaneRegion, plane_regions};

use crate::flange::{ON_MM, PARALLEL};

/// Most flats of a part, the largest.
const MOST_FLATS: usize = 12;
/// Least common share of the smaller of two flats that lie on each other.
const LIES: f64 = 0.5;

/// The flats of a part, largest first, in its frame.
pub fn regions(shape: &Shape, surfaces: &[MergedSurface]) -> Vec<PlaneRegion> {
    let mut all = plane_regions(shape, surfaces);
    all.sort_by(|a, b| b.area_mm2.total_cmp(&a.area_mm2));
    all.truncate(MOST_FLATS);
    all
}

/// A part's flats and its placement.
pub type Laid<'a> = (&'a [PlaneRegion], DAffine3);

/// The normal of a flat of the first part that lies on a flat of the second.
pub fn laid((flats, by): Laid<'_>, (others, base): Laid<'_>) -> Option<DVec3> {
    let to_own = by.inverse() * base;
    let on = |p: &PlaneRegion, q: &PlaneRegion| {
        let (normal, offset) = (
            to_own.transform_vector3(q.normal),
            to_own.transform_point3(q.middle) - p.middle,
        );
        p.normal.dot(normal) < 0.0
            && p.normal.cross(normal).length() <= PARALLEL
            && offset.dot(p.normal).abs() <= ON_MM
            && offset.length() < p.reach_mm + q.reach_mm
            && p.common_mm2(q, &to_own) >= LIES * p.area_mm2.min(q.area_mm2)
    };
    (flats.iter())
        .find(|p| others.iter().any(|q| on(p, q)))
        .map(|p| by.transform_vector3(p.normal))
}

//! Flanges: a flat of one part on a flat of another, with two or more bores of each in line, as screws need them.
//!
//! The bores of a pattern may differ in diameter: one clears the screw, the other holds its thread. What fixes the place are the axes: across the flats the
//! pattern, along the bores the flats.

use glam::{DAffine3, DVec3};
use mortise_brep::Surface;
use mortise_mating::MergedSurface;

use crate::port::Port;

/// Least share of the part's largest flat that a flat has.
const FLAT_SHARE: f64 = 0.02;
/// Most flats of a part, the largest, and most bores of a pattern.
const MOST_FLATS: usize = 12;
const MOST_BORES: usize = 16;
/// Fewest bores in line: one leaves the angle about it open.
pub(crate) const FEWEST: usize = 2;
/// Largest ratio of the diameters of two bores in line.
const RATIO: f64 = 1.7;
/// Distance of two axes in line, mm, and sine of the angle of what is parallel.
pub(crate) const IN_LINE_MM: f64 = 0.02;
pub(crate) const PARALLEL: f64 = 1e-4;
/// Gap of two flats that lie on each other, mm.
pub(crate) const ON_MM: f64 = 2e-3;

/// A flat, in its part's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flat {
    /// A point of it.
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
}

impl Flat {
    /// The same flat placed by `placement`.
    pub fn placed(&self, placement: &DAffine3) -> Self {
        Self {
            point: placement.transform_point3(self.point),
            normal: placement.transform_vector3(self.normal),
        }
    }
}

/// The larger flats among merged surfaces, largest first.
pub fn flats(surfaces: &[MergedSurface]) -> Vec<Flat> {
    let mut found: Vec<(f64, Flat)> = (surfaces.iter())
        .filter_map(|surface| match surface.surface {
            Surface::Plane { frame } => Some((
                surface.area_mm2,
                Flat {
                    point: frame.origin,
                    normal: frame.z,
                },
            )),
            _ => None,
        })
        .collect();
    found.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let least = found.first().map_or(0.0, |(area, _)| FLAT_SHARE * area);
    found
        .into_iter()
        .filter(|(area, _)| *area >= least)
        .take(MOST_FLATS)
        .map(|(_, flat)| flat)
        .collect()
}

/// Bores along `normal`, the widest first.
pub(crate) fn bores(ports: &[Port], normal: DVec3) -> Vec<Port> {
    let mut found: Vec<Port> = (ports.iter())
        .filter(|port| !port.male && port.direction.cross(normal).length() <= PARALLEL)
        .copied()
        .collect();
    found.sort_by(|a, b| b.radius.total_cmp(&a.radius));
    found.truncate(MOST_BORES);
    found
}

pub(crate) fn may_be_in_line(a: &Port, b: &Port) -> bool {
    a.radius.max(b.radius) <= RATIO * a.radius.min(b.radius)
}

/// Offsets across `normal` from bores of `own`, moved by `by`, to bores of `other` in line with them.
pub(crate) fn in_line(own: &[Port], other: &[Port], by: &DAffine3, normal: DVec3) -> Vec<DVec3> {
    (own.iter())
        .filter_map(|a| {
            let at = by.transform_point3(a.origin);
            let offset = |b: &Port| (b.origin - at).reject_from_normalized(normal);
            (other.iter().filter(|b| may_be_in_line(a, b)).map(offset))
                .min_by(|x, y| x.length().total_cmp(&y.length()))
                .filter(|x| x.length() <= IN_LINE_MM)
        })
        .collect()
}

/// A part's flats and ports, and its placement.
pub type Placed<'a> = (&'a [Flat], &'a [Port], DAffine3);

/// The normal of a flat of the first part that lies on a flat of the second, with bores in line.
pub fn joined((flats, ports, by): Placed<'_>, (others, their_ports, base): Placed<'_>) -> Option<DVec3> {
    let on = |p: &Flat, q: &Flat| {
        p.normal.dot(q.normal) < 0.0
            && p.normal.cross(q.normal).length() <= PARALLEL
            && (q.point - p.point).dot(q.normal).abs() <= ON_MM
    };
    let others: Vec<Flat> = others.iter().map(|flat| flat.placed(&base)).collect();
    let placed =
        |ports: &[Port], by: &DAffine3| -> Vec<Port> { ports.iter().map(|port| port.placed(by)).collect() };
    let (own, other) = (placed(ports, &by), placed(their_ports, &base));
    let is_flange = |normal: &DVec3| {
        let [own, other] = [&own, &other].map(|ports| bores(ports, *normal));
        in_line(&own, &other, &DAffine3::IDENTITY, *normal).len() >= FEWEST
    };
    (flats.iter())
        .map(|flat| flat.placed(&by))
        .filter(|p| others.iter().any(|q| on(p, q)))
        .map(|flat| flat.normal)
        .find(is_flange)
}

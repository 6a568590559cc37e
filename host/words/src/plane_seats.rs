//! Places of a part on another by plane ports ([`crate::plane_port`]) alone: no shaft, bore or pattern of bores states where.
//!
//! Snap policy (Jung 2003, section 4): the largest common area, then the smallest rotation, then the nearest flat. The middle of one flat lies on the middle of the
//! other, and their longest edges are parallel or perpendicular.

use std::cmp::Ordering;
use std::f64::consts::FRAC_PI_2;

use glam::{DAffine3, DQuat};
use mortise_mating::PlaneRegion;

use crate::world::World;

/// Least share of the part's largest flat that a flat has by which the part is laid, and least share of it that lies on the other flat.
const LARGE: f64 = 0.5;
const COMMON: f64 = 0.9;
/// Largest area of the other flat over that of the part's: the middle of a larger one is no place.
const RATIO: f64 = 2.0;
/// Most places returned.
const MOST: usize = 16;

/// Places of `part` with one of its large flats wholly on a flat of `into` of a similar size, the best first. Overlap is not checked.
///
/// Cost: the common area of each pair of flats.
pub fn plane_seats(world: &World, part: usize, into: usize) -> Vec<DAffine3> {
    let (now, base) = (world.placement(part), world.placement(into));
    let (own, others) = (world.regions(part), world.regions(into));
    let largest = own.first().map_or(0.0, |region| region.area_mm2);
    let mut places: Vec<([f64; 3], DAffine3)> = Vec::new();
    for p in own.iter().filter(|p| p.area_mm2 >= LARGE * largest) {
        for q in others.iter().filter(|q| q.area_mm2 <= RATIO * p.area_mm2) {
            let rotation = onto(p, q, &now, &base);
            let (from, to) = (now.transform_point3(p.middle), base.transform_point3(q.middle));
            let pose = DAffine3::from_translation(to)
                * DAffine3::from_quat(rotation)
                * DAffine3::from_translation(-from)
                * now;
            let common = p.common_mm2(q, &(pose.inverse() * base));
            if common >= COMMON * p.area_mm2 {
                let angle = rotation.to_axis_angle().1;
                places.push((
                    [
                        -(common * 1e2 / largest).round(),
                        (angle * 1e3).round(),
                        from.distance(to),
                    ],
                    pose,
                ));
            }
        }
    }
    places.sort_by(|(a, _), (b, _)| {
        let each = a.iter().zip(b).map(|(x, y)| x.total_cmp(y));
        each.fold(Ordering::Equal, Ordering::then)
    });
    let mut found: Vec<DAffine3> = Vec::new();
    for (_, pose) in places {
        if found.len() < MOST && !found.iter().any(|known| world.same(part, known, &pose)) {
            found.push(pose);
        }
    }
    found
}

/// The smallest rotation that turns flat `p`, placed by `now`, against flat `q`, placed by `base`, with their longest edges parallel or perpendicular.
fn onto(p: &PlaneRegion, q: &PlaneRegion, now: &DAffine3, base: &DAffine3) -> DQuat {
    let normal = base.transform_vector3(q.normal);
    let arc = DQuat::from_rotation_arc(now.transform_vector3(p.normal), -normal);
    let (Some(own), Some(other)) = (p.edge, q.edge) else {
        return arc;
    };
    let own = arc * now.transform_vector3(own);
    let other = base.transform_vector3(other);
    let angle = normal.dot(own.cross(other)).atan2(own.dot(other));
    (0..4)
        .map(|quarter| DQuat::from_axis_angle(normal, angle + FRAC_PI_2 * f64::from(quarter)) * arc)
        .min_by(|a, b| {
            let turn = |q: &DQuat| q.w.abs();
            turn(b).total_cmp(&turn(a))
        })
        .unwrap_or(arc)
}

//! Flanges: a flat of one part on a flat of another, with two or more bores of each in line, as screws need them.
//!
//! The bores of a pattern may differ in diameter: one clears the screw, the other holds its thread. What fixes the place are the axes: across the flats the
//! pattern, along the bores the flats. Snap policy (Jung 2003, section 4): the most bores in line, then the smallest rotation, then the side on which the part
//! is, then as far in as possible.

use std::cmp::Ordering;

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::Surface;
use mortise_mating::MergedSurface;

use crate::port::Port;
use crate::world::World;

/// Least share of the part's largest flat that a flat has.
const FLAT_SHARE: f64 = 0.02;
/// Most flats of a part, the largest, and most bores of a pattern.
const MOST_FLATS: usize = 12;
const MOST_BORES: usize = 16;
/// Fewest bores in line: one leaves the angle about it open.
const FEWEST: usize = 2;
/// Largest ratio of the diameters of two bores in line.
const RATIO: f64 = 1.7;
/// Distance of two axes in line, mm, and sine of the angle of what is parallel.
const IN_LINE_MM: f64 = 0.02;
const PARALLEL: f64 = 1e-4;
/// Least distance of two bores that fix the angle, mm.
const LEVER_MM: f64 = 1.0;
/// Gap of two flats that lie on each other, mm.
const ON_MM: f64 = 2e-3;
/// Most places returned.
const MOST: usize = 16;

/// A flat, in its part's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flat {
    /// A point of it.
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
}

impl Flat {
    fn placed(&self, placement: &DAffine3) -> Self {
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
fn bores(ports: &[Port], normal: DVec3) -> Vec<Port> {
    let mut found: Vec<Port> = (ports.iter())
        .filter(|port| !port.male && port.direction.cross(normal).length() <= PARALLEL)
        .copied()
        .collect();
    found.sort_by(|a, b| b.radius.total_cmp(&a.radius));
    found.truncate(MOST_BORES);
    found
}

fn may_be_in_line(a: &Port, b: &Port) -> bool {
    a.radius.max(b.radius) <= RATIO * a.radius.min(b.radius)
}

/// Offsets across `normal` from bores of `own`, moved by `by`, to bores of `other` in line with them.
fn in_line(own: &[Port], other: &[Port], by: &DAffine3, normal: DVec3) -> Vec<DVec3> {
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

/// The normal of a flat of `a` that lies on a flat of `b` now, with bores in line.
pub fn joined(world: &World, a: usize, b: usize) -> Option<DVec3> {
    let (pa, pb) = (world.placement(a), world.placement(b));
    let placed = |part: usize, by: &DAffine3| -> Vec<Port> {
        world.ports(part).iter().map(|port| port.placed(by)).collect()
    };
    let on = |p: &Flat, q: &Flat| {
        p.normal.dot(q.normal) < 0.0
            && p.normal.cross(q.normal).length() <= PARALLEL
            && (q.point - p.point).dot(q.normal).abs() <= ON_MM
    };
    let others: Vec<Flat> = world.flats(b).iter().map(|flat| flat.placed(&pb)).collect();
    let flat = (world.flats(a).iter())
        .map(|flat| flat.placed(&pa))
        .find(|p| others.iter().any(|q| on(p, q)))?;
    let [own, other] = [(a, &pa), (b, &pb)].map(|(part, by)| bores(&placed(part, by), flat.normal));
    let count = in_line(&own, &other, &DAffine3::IDENTITY, flat.normal).len();
    (count >= FEWEST).then_some(flat.normal)
}

/// A way to bring bores in line: the motion from where the part is now, without its height along the normal.
struct Pattern {
    by: DAffine3,
    normal: DVec3,
    count: usize,
    angle: f64,
}

/// Places of `part` with a flat on a flat of `into` and bores in line, the best first. Flats that would not meet there are left out; overlap is not checked.
///
/// Cost: for each pair of directions of flats the square of the number of pairs of bores; a distance query for each place.
pub fn flanges(world: &mut World, part: usize, into: usize) -> Vec<DAffine3> {
    let (now, base) = (world.placement(part), world.placement(into));
    let own: Vec<Flat> = world.flats(part).iter().map(|flat| flat.placed(&now)).collect();
    let others: Vec<Flat> = world.flats(into).iter().map(|flat| flat.placed(&base)).collect();
    let [mine, theirs] = [(part, &now), (into, &base)].map(|(p, by)| {
        world
            .ports(p)
            .iter()
            .map(|port| port.placed(by))
            .collect::<Vec<_>>()
    });
    let mut patterns = Vec::new();
    for p in directions(&own) {
        for q in directions(&others) {
            patterns.extend(patterns_of((&mine, p), (&theirs, q)));
        }
    }
    let most = patterns.iter().map(|pattern| pattern.count).max().unwrap_or(0);
    patterns.retain(|pattern| pattern.count == most);
    let way = world.center(part) - world.center(into);
    let mut places: Vec<([f64; 3], DAffine3)> = Vec::new();
    for pattern in &patterns {
        let (normal, angle) = (pattern.normal, (pattern.angle * 1e3).round());
        let side = if way.dot(normal) > 0.0 { 0.0 } else { 1.0 };
        for q in others.iter().filter(|q| q.normal.dot(normal) > 1.0 - PARALLEL) {
            for p in &own {
                if pattern.by.transform_vector3(p.normal).dot(normal) > PARALLEL - 1.0 {
                    continue;
                }
                let height = (q.point - pattern.by.transform_point3(p.point)).dot(normal);
                let pose = DAffine3::from_translation(height * normal) * pattern.by * now;
                let depth = pose.transform_point3(DVec3::ZERO).dot(normal);
                if !places.iter().any(|(_, known)| world.same(part, known, &pose)) {
                    places.push(([angle, side, depth], pose));
                }
            }
        }
    }
    places.sort_by(|(a, _), (b, _)| {
        let each = a.iter().zip(b).map(|(x, y)| x.total_cmp(y));
        each.fold(Ordering::Equal, Ordering::then)
    });
    let mut found = Vec::new();
    for (_, pose) in places {
        if found.len() >= MOST {
            break;
        }
        world.set_placement(part, pose);
        if world.assembly().pair_gap(part, into, ON_MM).is_some() {
            found.push(pose);
        }
    }
    world.set_placement(part, now);
    found
}

/// Normals of flats, each direction once.
fn directions(flats: &[Flat]) -> Vec<DVec3> {
    let mut found: Vec<DVec3> = Vec::new();
    for flat in flats {
        if !found
            .iter()
            .any(|known| known.dot(flat.normal) > 1.0 - PARALLEL * PARALLEL)
        {
            found.push(flat.normal);
        }
    }
    found
}

/// Motions that bring bores in line after the direction `p` was turned against the direction `q`.
fn patterns_of((mine, p): (&[Port], DVec3), (theirs, q): (&[Port], DVec3)) -> Vec<Pattern> {
    let (own, other) = (bores(mine, p), bores(theirs, q));
    let arc = DQuat::from_rotation_arc(p, -q);
    let across = |a: &Port, b: &Port, by: DQuat| (by * (b.origin - a.origin)).reject_from_normalized(q);
    let mut found: Vec<Pattern> = Vec::new();
    for (i, a) in own.iter().enumerate() {
        for b in &own[i + 1..] {
            let from = across(a, b, arc);
            if from.length() < LEVER_MM {
                continue;
            }
            for c in other.iter().filter(|c| may_be_in_line(a, c)) {
                for d in other.iter().filter(|d| may_be_in_line(b, d)) {
                    let to = across(c, d, DQuat::IDENTITY);
                    if (from.length() - to.length()).abs() > IN_LINE_MM {
                        continue;
                    }
                    let angle = q.dot(from.cross(to)).atan2(from.dot(to));
                    let rotation = DQuat::from_axis_angle(q, angle) * arc;
                    let moved = |port: &Port| rotation * port.origin;
                    // Between the two bores of each part.
                    let offset = 0.5 * (c.origin + d.origin - moved(a) - moved(b));
                    let by = DAffine3::from_rotation_translation(rotation, offset.reject_from_normalized(q));
                    let offsets = in_line(&own, &other, &by, q);
                    if offsets.len() < FEWEST {
                        continue;
                    }
                    let mean = offsets.iter().sum::<DVec3>() / offsets.len() as f64;
                    let by = DAffine3::from_translation(mean) * by;
                    let same = |known: &Pattern| known.by.abs_diff_eq(by, 1e-6);
                    if !found.iter().any(same) {
                        found.push(Pattern {
                            by,
                            normal: q,
                            count: offsets.len(),
                            angle: rotation.to_axis_angle().1,
                        });
                    }
                }
            }
        }
    }
    found
}

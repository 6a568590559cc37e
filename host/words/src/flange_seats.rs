//! Places of a part as a flange of another ([`crate::flange`]).
//!
//! Snap policy (Jung 2003, section 4): the most bores in line, then the smallest rotation, then the side on which the part is, then as far in as possible.

use std::cmp::Ordering;

use glam::{DAffine3, DQuat, DVec3};

use crate::flange::{FEWEST, Flat, IN_LINE_MM, PARALLEL, bores, in_line, may_be_in_line};
use crate::port::Port;
use crate::world::World;

/// Least distance of two bores that fix the angle, mm.
const LEVER_MM: f64 = 1.0;

/// A way to bring bores in line: the motion from where the part is now, without its height along the normal.
struct Pattern {
    by: DAffine3,
    normal: DVec3,
    count: usize,
    angle: f64,
}

/// Places of `part` with a flat in the plane of a flat of `into` and bores in line, the best first. Whether the flats meet and whether the parts overlap is not checked.
///
/// Cost: for each pair of directions of flats the square of the number of pairs of bores.
pub fn flanges(world: &World, part: usize, into: usize) -> Vec<DAffine3> {
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
    places.into_iter().map(|(_, pose)| pose).collect()
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

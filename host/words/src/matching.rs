//! Placements at which ports of two parts match: collinear, of fitting diameters, pushed in as far as they go.
//!
//! Snap policy (Jung 2003, section 4): the most pairs of ports at once, then the tightest, then the smallest rotation, then the nearest bore, entered
//! from the side on which the part is; as far in as possible: until it meets a stop, or the shaft's end is flush with the bore.

use std::collections::VecDeque;

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::lexicon::Relation;
use crate::manner::Manner;
use crate::port::Port;
use crate::world::World;

/// Gap by which a looser match may exceed the tightest one, mm on the radius.
const TIGHTEST_MM: f64 = 0.02;
/// Smallest distance of two parallel axes that fixes the angle about one of them, mm.
const LEVER_MM: f64 = 1.0;
/// Most insertions tried.
const MOST_TRIED: usize = 24;
/// Share of the shorter port that must be in the other.
const ENGAGED: f64 = 0.5;

/// A way to bring the ports on one line.
#[derive(Clone, Copy)]
struct Match {
    /// Rotation of the part about its origin, from where it is now, and where its axis then lies.
    rotation: DQuat,
    pairs: usize,
    gap: f64,
    own: Port,
    other: Port,
}

/// A part pushed in.
pub struct Inserted {
    /// Where it stands.
    pub pose: DAffine3,
    /// Direction back out, and the travel, mm, on which that is known to be free.
    pub way_back: (DVec3, f64),
}

/// Placements of a part with a port matched to one of another part, the best first: found one after another.
pub struct Matches {
    now: DAffine3,
    pair: [usize; 2],
    /// What is left to try, and from which side; numbered by match.
    left: VecDeque<(usize, Match, DVec3)>,
}

impl Matches {
    /// Prepares the search for `part` at `into`.
    ///
    /// Cost: the pairs of ports times those parallel to them.
    pub fn new(world: &World, part: usize, into: usize, manner: &Manner) -> Self {
        let mut found = lines(world, part, into, manner);
        let most = found.iter().map(|m| m.pairs).max().unwrap_or(0);
        found.retain(|m| m.pairs == most);
        let tightest = found.iter().map(|m| m.gap).fold(f64::INFINITY, f64::min);
        found.retain(|m| m.gap <= tightest + TIGHTEST_MM);
        let here = world.center(part);
        found.sort_by(|m, n| {
            let angle = |m: &Match| (m.rotation.to_axis_angle().1 * 1e3).round();
            let far = |m: &Match| m.other.middle().distance(here);
            angle(m).total_cmp(&angle(n)).then(far(m).total_cmp(&far(n)))
        });
        let mut left = VecDeque::new();
        for (number, m) in found.into_iter().take(MOST_TRIED).enumerate() {
            let side = (here - m.other.middle()).dot(m.other.direction);
            let near = m.other.direction * if side < 0.0 { -1.0 } else { 1.0 };
            let entries = [near, -near].into_iter().filter(|entry| manner.agrees(*entry));
            left.extend(entries.map(|entry| (number, m, entry)));
        }
        Self {
            now: world.placement(part),
            pair: [part, into],
            left,
        }
    }

    /// The next placement; once there was one, of the same match only, from its other side. Parts met before the ports engage are added to `blockers`. The part
    /// is at its old place afterwards.
    ///
    /// Cost: one sweep for each insertion tried.
    pub fn next(&mut self, world: &mut World, blockers: &mut Vec<usize>) -> Option<Inserted> {
        while let Some((number, m, entry)) = self.left.pop_front() {
            let inserted = insert(world, self.pair, self.now, &m, entry, blockers);
            world.set_placement(self.pair[0], self.now);
            if inserted.is_some() {
                self.left.retain(|(other, ..)| *other == number);
                return inserted;
            }
        }
        None
    }
}

/// All ways to bring a port of `part` on one line with a port of `into`, in both senses, with the angle about it from a second pair where there is one.
fn lines(world: &World, part: usize, into: usize, manner: &Manner) -> Vec<Match> {
    let place = |p: usize| -> Vec<Port> {
        world
            .ports(p)
            .iter()
            .map(|q| q.placed(&world.placement(p)))
            .collect()
    };
    let (own, others) = (place(part), place(into));
    let mut out = Vec::new();
    for p in &own {
        let allowed = match manner.relation {
            Relation::Inside => p.male,
            Relation::Around => !p.male,
            Relation::Any => true,
        };
        for q in others.iter().filter(|q| allowed && p.takes(q)) {
            if manner
                .hole
                .is_some_and(|hole| hole.middle().distance(q.middle()) > 1e-6 || hole.radius != q.radius)
            {
                continue;
            }
            for sense in [1.0, -1.0] {
                let onto = q.direction * sense;
                let arc = DQuat::from_rotation_arc(p.direction, onto);
                let gap = (p.radius - q.radius).abs();
                let mut add = |rotation: DQuat| {
                    out.push(Match {
                        rotation,
                        pairs: pairs(&own, &others, p, q, rotation),
                        gap,
                        own: *p,
                        other: *q,
                    });
                };
                add(arc);
                for (p2, q2) in seconds(&own, &others, p, q) {
                    let a = (arc * (p2.origin - p.origin)).reject_from_normalized(onto);
                    let b = (q2.origin - q.origin).reject_from_normalized(onto);
                    let angle = onto.dot(a.cross(b)).atan2(a.dot(b));
                    add(DQuat::from_axis_angle(onto, angle) * arc);
                }
            }
        }
    }
    out
}

/// Further pairs of ports, parallel to the first at the same distance.
fn seconds<'a>(own: &'a [Port], others: &'a [Port], p: &Port, q: &Port) -> Vec<(&'a Port, &'a Port)> {
    let lever = |a: &Port, b: &Port| (b.origin - a.origin).reject_from_normalized(a.direction).length();
    let parallel = |a: &Port, b: &Port| a.direction.cross(b.direction).length() < 1e-3;
    let mut out = Vec::new();
    for p2 in own.iter().filter(|p2| parallel(p, p2) && lever(p, p2) > LEVER_MM) {
        for q2 in others.iter().filter(|q2| parallel(q, q2) && p2.takes(q2)) {
            let slack = (p.radius - q.radius).abs() + (p2.radius - q2.radius).abs() + 0.01;
            if (lever(p, p2) - lever(q, q2)).abs() <= slack {
                out.push((p2, q2));
            }
        }
    }
    out
}

/// Number of pairs of ports on one line after `rotation`, with the axis of `p` on that of `q`; their heights are left open.
fn pairs(own: &[Port], others: &[Port], p: &Port, q: &Port, rotation: DQuat) -> usize {
    let mut used = vec![false; others.len()];
    let mut count = 0;
    for p2 in own {
        let direction = rotation * p2.direction;
        let offset = rotation * (p2.origin - p.origin);
        let hit = others.iter().position(|q2| {
            let aside = (q.origin + offset - q2.origin)
                .reject_from_normalized(q.direction)
                .length();
            p2.takes(q2)
                && direction.cross(q2.direction).length() < 2e-3
                && aside <= (p2.radius - q2.radius).abs() + 0.01
        });
        if let Some(hit) = hit
            && !std::mem::replace(&mut used[hit], true)
        {
            count += 1;
        }
    }
    count
}

/// Pushes the part in from the side `entry`; `None` when the ports do not engage.
fn insert(
    world: &mut World,
    [part, into]: [usize; 2],
    now: DAffine3,
    m: &Match,
    entry: DVec3,
    blockers: &mut Vec<usize>,
) -> Option<Inserted> {
    let turn = DMat3::from_quat(m.rotation);
    // The port's origin onto the other's axis.
    let onto = m.other.origin;
    let turned = DAffine3 {
        matrix3: turn,
        translation: onto - turn * m.own.origin,
    } * now;
    world.set_placement(part, turned);
    // Beyond the other part on this side, then inwards; how it comes there is not looked at.
    let height = |world: &World, p: usize, sign: f64| {
        let (low, high) = world.bounds(p);
        sign * ((low + high) / 2.0).dot(entry) + ((high - low) / 2.0).dot(entry.abs())
    };
    let out = (height(world, into, 1.0) + height(world, part, -1.0)).max(0.0) + 1.0;
    world.shift(&[part], entry * out);
    let own = Port {
        origin: onto + entry * out,
        direction: turn * m.own.direction,
        ..m.own
    };
    let depth = flush(&own, &m.other, -entry);
    if depth <= 0.0 {
        return None;
    }
    let (free, pair) = world.travel(&[part], -entry, depth);
    world.shift(&[part], -entry * free);
    let there = Port {
        origin: own.origin - entry * free,
        ..own
    };
    let engaged = there.connected(&m.other).map_or(0.0, |(low, high)| high - low);
    if engaged < ENGAGED * own.length().min(m.other.length()) {
        blockers.extend(pair.map(|[_, blocker]| blocker));
        return None;
    }
    settle(world, part, entry);
    Some(Inserted {
        pose: world.placement(part),
        way_back: (entry, free),
    })
}

/// Travel along `inwards` until the shaft's end is flush with the bore's far end, or a longer shaft's other end with the bore's near end.
fn flush(own: &Port, other: &Port, inwards: DVec3) -> f64 {
    let ends = |port: &Port| {
        let [a, b] = [port.low, port.high].map(|s| (port.origin + port.direction * s).dot(inwards));
        (a.min(b), a.max(b))
    };
    let ((own_back, own_front), (back, front)) = (ends(own), ends(other));
    if own.male && own.length() > other.length() {
        back - own_back
    } else {
        front - own_front
    }
}

/// A sweep ends within the overlap that counts as contact; the part is set back by what it, and what moves with it, overlaps at its stop.
fn settle(world: &mut World, part: usize, entry: DVec3) {
    if let Some(found) = world.overlap(part) {
        let along = found.gap.away.dot(entry);
        if along > 0.5 {
            world.shift(&[part], entry * (-found.gap.distance_mm / along));
        }
    }
}

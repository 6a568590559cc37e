//! Sequences: how an assembly comes apart, and in reverse how it goes together.
//!
//! A set of parts is split into a group that leaves and the rest, and both again, down to single parts: a tree of splits, whose reverse is an assembly with
//! subassemblies. Removing a group never makes another removal harder, because it takes obstacles away; so the first split found is as good as any, and the
//! search needs no backtracking (for rigid groups, two at a time, each on its way without intermediate stops). Straight ways are found by blocking
//! graphs ([`crate::blocking`]), others by [`crate::removal`] for single parts, and for pairs of connected parts where no single part leaves.
//!
//! Every step is measured again in the direction of assembly, from outside into place.

use std::time::{Duration, Instant};

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::assembly::{Assembly, Clearance, Moved};
use crate::blocking::{Blocking, Leaving};
use crate::deadline::Deadline;
use crate::directions::candidates;
use crate::line::same_direction;
use crate::motion::Motion;
use crate::removal::{Blocked, Budget, Path, Removal, remove};
use crate::support::Support;
use crate::wishes::Wishes;

/// Travel between checks of samples in contact when a step is measured, mm.
pub const MEASURE_STEP_MM: f64 = 0.25;
/// Distance beyond which a clearance is not stated, mm.
pub const FAR_MM: f64 = 1e3;
/// Most directions, each both ways, in which straight ways are sought.
const LINES: usize = 6;

/// One step: a group that leaves, or in reverse is put onto, the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Parts that move together.
    pub group: Vec<usize>,
    /// Parts that stay.
    pub onto: Vec<usize>,
    /// Way of the group from its place to the outside.
    pub path: Path,
    /// Least distance on the way in, and the pair; `None` when it stays beyond [`FAR_MM`], or was not measured for lack of time.
    pub least: Option<Clearance>,
    /// Whether it was measured.
    pub measured: bool,
    /// Parts that stay and would fall without the group: they are held by hand meanwhile.
    pub falls: Vec<usize>,
}

/// What a search found.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// Steps of disassembly; the reverse is the order of assembly.
    pub steps: Vec<Step>,
    /// Sets of parts that stay together, with what holds each.
    pub stuck: Vec<(Vec<usize>, Blocked)>,
    /// Whether time ran out.
    pub timed_out: bool,
    /// Time taken.
    pub time: Duration,
}

impl Sequence {
    /// Whether everything comes apart.
    pub fn complete(&self) -> bool {
        self.stuck.is_empty() && !self.timed_out
    }
}

/// Directions of all parts of `set`, most important first.
pub fn directions(assembly: &Assembly, set: &[usize]) -> Vec<DVec3> {
    let mut sums: Vec<(f64, DVec3)> = Vec::new();
    for &part in set {
        let group = [part];
        let moved = Moved {
            parts: &group,
            by: DAffine3::IDENTITY,
        };
        for (rank, d) in candidates(assembly, &moved, &[])
            .directions
            .into_iter()
            .enumerate()
        {
            let weight = 1.0 / (1.0 + rank as f64);
            match sums.iter_mut().find(|(_, known)| same_direction(*known, d)) {
                Some((sum, _)) => *sum += weight,
                None => sums.push((weight, d)),
            }
        }
    }
    sums.sort_by(|a, b| b.0.total_cmp(&a.0));
    sums.into_iter().take(LINES).map(|(_, d)| d).collect()
}

/// Takes the parts of `set` apart before `end`.
pub fn disassemble(assembly: &Assembly, set: &[usize], end: impl Into<Deadline>) -> Sequence {
    disassemble_as(assembly, set, &Wishes::default(), end)
}

/// Takes the parts of `set` apart before `end` as a user wishes: held parts stay, and a group whose parts do not fall without it leaves first if there is one.
pub fn disassemble_as(
    assembly: &Assembly,
    set: &[usize],
    wishes: &Wishes,
    end: impl Into<Deadline>,
) -> Sequence {
    let (start, end) = (Instant::now(), end.into());
    // A tenth is left for measuring.
    let until = end.share(0.9);
    let mut found = Sequence {
        steps: Vec::new(),
        stuck: Vec::new(),
        timed_out: false,
        time: Duration::ZERO,
    };
    let mut blocking = Blocking::new(assembly, directions(assembly, set));
    let mut support = Support::new(assembly, wishes);
    let mut open = vec![set.to_vec()];
    while let Some(set) = open.pop() {
        if units(assembly, wishes, &set).len() < 2 {
            continue;
        }
        if until.is_over() {
            found.timed_out = true;
            break;
        }
        match split((assembly, wishes), &mut blocking, &mut support, &set, &until) {
            Ok(step) => {
                open.push(step.onto.clone());
                open.push(step.group.clone());
                found.steps.push(step);
            }
            Err((blocked, timed_out)) => {
                found.timed_out |= timed_out;
                found.stuck.push((set, blocked));
            }
        }
    }
    let measured: Vec<Option<Option<Clearance>>> = (found.steps.par_iter().with_max_len(1))
        .map(|step| measure(assembly, step, &end))
        .collect();
    for (step, least) in found.steps.iter_mut().zip(measured) {
        step.measured = least.is_some();
        step.least = least.flatten();
    }
    found.time = start.elapsed();
    found
}

/// Splits a set: the smallest group that leaves straight, else a part that leaves on several legs.
fn split(
    (assembly, wishes): (&Assembly, &Wishes),
    blocking: &mut Blocking<'_>,
    support: &mut Support<'_>,
    set: &[usize],
    until: &Deadline,
) -> Result<Step, (Blocked, bool)> {
    let rest = |group: &[usize]| {
        set.iter()
            .copied()
            .filter(|p| !group.contains(p))
            .collect::<Vec<_>>()
    };
    if let Some(leaving) = leaving(wishes, blocking, support, set, until) {
        let onto = rest(&leaving.parts);
        let moved = Moved {
            parts: &leaving.parts,
            by: DAffine3::IDENTITY,
        };
        let far = crate::mobility::leaving_mm(assembly, &moved, &onto, leaving.direction);
        let path = Path {
            legs: vec![Motion::slide(leaving.direction * far)],
        };
        return Ok(Step {
            falls: support.falling(&onto),
            group: leaving.parts,
            onto,
            path,
            least: None,
            measured: false,
        });
    }
    let mut groups = units(assembly, wishes, set);
    let mut order = |group: &[usize]| (support.falling(&rest(group)).len(), volume(assembly, group));
    groups.sort_by_cached_key(|group| {
        let (falls, volume) = order(group);
        // The order of the bits of a number that is not negative is its own.
        (falls, volume.to_bits())
    });
    let count = groups.len();
    if count > 3 {
        let pairs = pairs(assembly, &groups);
        groups.extend(pairs);
    }
    groups.retain(|group| !wishes.hold_one_of(group));
    if count == 2 {
        // Either is the other's obstacle: one search is enough.
        groups.truncate(1);
    }
    let mut worst: Option<Blocked> = None;
    let mut timed_out = false;
    let count = groups.len();
    for (i, group) in groups.into_iter().enumerate() {
        if until.is_over() {
            timed_out = true;
            break;
        }
        let onto = rest(&group);
        let budget = Budget {
            until: until.share(1.0 / (count - i).min(3) as f64),
            legs: 12,
            seed: 0,
        };
        match remove(assembly, &group, &onto, &[], &budget) {
            Removal::Out(path) => {
                return Ok(Step {
                    falls: support.falling(&onto),
                    group,
                    onto,
                    path,
                    least: None,
                    measured: false,
                });
            }
            Removal::Blocked(blocked) => worst = Some(nearer(worst, blocked)),
            Removal::TimedOut(blocked) => {
                timed_out = true;
                worst = Some(nearer(worst, blocked));
            }
        }
    }
    let blocked = worst.unwrap_or(Blocked {
        pair: [set[0], set[1]],
        overlap_mm: None,
        proof: None,
    });
    Err((blocked, timed_out))
}

/// Sets of parts that are not split: joined ones, and those that are held.
fn units(assembly: &Assembly, wishes: &Wishes, set: &[usize]) -> Vec<Vec<usize>> {
    let units = assembly.stated.units(set).into_iter();
    let (held, mut free): (Vec<_>, Vec<_>) = units.partition(|unit| wishes.hold_one_of(unit));
    if !held.is_empty() {
        let mut held = held.concat();
        held.sort_unstable();
        free.push(held);
    }
    free
}

/// A group that leaves straight: one without which nothing falls, else any; one that holds a fixed part stays, and the rest leaves the other way.
fn leaving(
    wishes: &Wishes,
    blocking: &mut Blocking<'_>,
    support: &mut Support<'_>,
    set: &[usize],
    until: &Deadline,
) -> Option<Leaving> {
    let rest =
        |group: &[usize]| -> Vec<usize> { set.iter().copied().filter(|p| !group.contains(p)).collect() };
    if wishes.down.is_some() {
        let before = support.falling(set).len();
        let mut stands =
            |group: &[usize]| !wishes.hold_one_of(group) && support.falling(&rest(group)).len() <= before;
        if let Some(leaving) = blocking.leaving(set, &mut stands, until) {
            return Some(leaving);
        }
    }
    let free = blocking.leaving(set, &mut |group| !wishes.hold_one_of(group), until);
    if free.is_some() || wishes.held.is_empty() {
        return free;
    }
    let mut holds = |group: &[usize]| !wishes.hold_one_of(&rest(group));
    let held = blocking.leaving(set, &mut holds, until)?;
    Some(Leaving {
        parts: rest(&held.parts),
        direction: -held.direction,
    })
}

/// The one of two blocks that is proved, or else lacks less.
fn nearer(known: Option<Blocked>, new: Blocked) -> Blocked {
    let rank = |one: &Blocked| (one.proof.is_none(), one.overlap_mm.unwrap_or(f64::INFINITY));
    match known {
        Some(known) if rank(&known) <= rank(&new) => known,
        _ => new,
    }
}

fn volume(assembly: &Assembly, group: &[usize]) -> f64 {
    group
        .iter()
        .map(|&p| assembly.body(p).surface().shape().volume_mm3.abs())
        .sum()
}

/// Pairs of touching units.
fn pairs(assembly: &Assembly, units: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let unit = |part: usize| units.iter().find(|unit| unit.contains(&part));
    let mut pairs: Vec<Vec<usize>> = (assembly.contacts.iter())
        .filter_map(|contact| {
            let [a, b] = contact.parts.map(unit);
            let (a, b) = (a?, b?);
            let mut both = [&a[..], &b[..]].concat();
            both.sort_unstable();
            (a != b).then_some(both)
        })
        .collect();
    pairs.sort();
    pairs.dedup();
    pairs
}

/// Least distance on a step's way in, with the descent between samples at its narrowest place; the outer `None` when it is not measured by `until`.
///
/// Cost: a sweep against each part whose box is as near to the swept box of the group as the least distance found.
pub fn measure(assembly: &Assembly, step: &Step, until: &Deadline) -> Option<Option<Clearance>> {
    let (mut by, path) = step.path.reversed();
    let mut least: Option<Clearance> = None;
    let mut at = by;
    for leg in &path.legs {
        let moved = Moved {
            parts: &step.group,
            by,
        };
        for (bound, part) in nearest_first(assembly, &moved, &step.onto, leg) {
            if until.is_over() {
                return None;
            }
            let within = least.map_or(FAR_MM, |l| l.gap.distance_mm);
            if bound >= within {
                break;
            }
            if let Some((t, found)) = assembly.least_over(&moved, &[part], leg, MEASURE_STEP_MM, within) {
                least = Some(found);
                at = leg.at(t) * by;
            }
        }
        by = leg.at(1.0) * by;
    }
    if let Some(known) = least {
        let moved = Moved {
            parts: &known.pair[..1],
            by: at,
        };
        least = assembly
            .clearance(&moved, &known.pair[1..], known.gap.distance_mm + 1e-6, true)
            .or(least);
    }
    Some(least)
}

/// Distance below which boxes may meet, mm: their rounding.
const BOXES_MM: f64 = 1e-6;

/// Of `others` each with a lower bound of its distance from a group on a leg, mm: that of their boxes, none where these meet. Least bound first, equal ones
/// in the given order.
fn nearest_first(
    assembly: &Assembly,
    group: &Moved<'_>,
    others: &[usize],
    leg: &Motion,
) -> Vec<(f64, usize)> {
    let (low, high) = assembly.swept(group.parts, group.by, leg);
    let bound = |part: usize| {
        let (l, h) = assembly.bounds(part, DAffine3::IDENTITY);
        let apart = (low - h).max(l - high).max(DVec3::ZERO).length();
        if apart > BOXES_MM {
            apart
        } else {
            f64::NEG_INFINITY
        }
    };
    let mut found: Vec<(f64, usize)> = others.iter().map(|&part| (bound(part), part)).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

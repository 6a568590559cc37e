//! connect(a, b): a seat for the part, checked for overlap and for a way in (Jung 2003, fig. 5).
//!
//! Seats, in this order: the part's own place against b in the file; places there of equal parts, nearest first; such a place carried over to an equal
//! bore of b; then ports of a and b that match in diameter ([`crate::matching`]); then flats on each other with bores in line ([`crate::flange`]);
//! where no shaft, bore or bores in line fit and the part is not to go inside, then flat on flat ([`crate::plane_port`]).
//! A filled seat overlaps the part in it and is passed over. The way in is the way out backwards, straight, from the side asked for.

use glam::{DAffine3, DVec3};

use crate::adjust::range_mm;
use crate::flange::ON_MM;
use crate::flange_seats::flanges;
use crate::lexicon::Relation;
use crate::manner::Manner;
use crate::matching::Matches;
use crate::phrase::Amount;
use crate::plane_seats::plane_seats;
use crate::port::Port;
use crate::turn::{Act, Code, Trouble, Verb};
use crate::world::World;

/// Cosine between directions that are the same.
const PARALLEL: f64 = 1.0 - 1e-12;
/// Most places of a flange tried at which its flats meet.
const MOST_FLANGES: usize = 16;
/// Distance within which two bores are equal, mm.
const EQUAL_MM: f64 = 1e-3;

/// A seat that the search has found: placement, and the direction in which the part leaves it.
struct Seat {
    pose: DAffine3,
    way: DVec3,
    travel: f64,
}

/// Puts `part`, with what is connected to it, together with `into`. Nothing moves when it already is in such a seat.
///
/// # Errors
/// [`Trouble::Refuse`]: `Blocked` with the parts in the way, `NoFit` when nothing fits, `NotUnderstood` for a vague extent.
///
/// Cost: for each seat tried one overlap query and some sweeps.
pub fn connect(world: &mut World, part: usize, into: usize, manner: &Manner) -> Result<Act, Trouble> {
    world.attach(part, into);
    let done = put(world, part, into, manner);
    world.detach();
    done
}

fn put(world: &mut World, part: usize, into: usize, manner: &Manner) -> Result<Act, Trouble> {
    let name = world.name(part).to_owned();
    let target = world.name(into).to_owned();
    if part == into {
        return Err(Trouble::Refuse(
            Code::NoFit,
            format!("{name} cannot be connected to itself"),
            vec![part],
        ));
    }
    let now = world.placement(part);
    let mut act = Act {
        verb: Verb::Connect,
        a: name.clone(),
        b: Some(target.clone()),
        axis: None,
        amount: None,
    };
    if world.connected(part, into)
        && manner.hole.is_none()
        && seats(world, part, into).iter().any(|s| world.same(part, &now, s))
    {
        return Ok(act);
    }
    let mut blockers = Vec::new();
    let mut tried = false;
    let mut found = None;
    for pose in seats(world, part, into) {
        if !in_hole(world, part, &pose, manner.hole) {
            continue;
        }
        tried = true;
        if let Some(seat) = enter(world, [part, into], &pose, manner, None, &mut blockers) {
            found = Some(seat);
            break;
        }
    }
    if found.is_none() {
        let mut matches = Matches::new(world, part, into, manner);
        while let Some(inserted) = matches.next(world, &mut blockers) {
            tried = true;
            let known = Some(inserted.way_back);
            found = enter(world, [part, into], &inserted.pose, manner, known, &mut blockers);
            if found.is_some() {
                break;
            }
        }
    }
    if found.is_none() && manner.hole.is_none() {
        let mut met = 0;
        for pose in flanges(world, part, into) {
            world.set_placement(part, pose);
            if !world.assembly().are_within(part, into, ON_MM) {
                continue;
            }
            tried = true;
            met += 1;
            found = enter(world, [part, into], &pose, manner, None, &mut blockers);
            if found.is_some() || met == MOST_FLANGES {
                break;
            }
        }
    }
    if found.is_none() && !tried && blockers.is_empty() && manner.relation != Relation::Inside {
        let poses = plane_seats(world, part, into);
        tried = !poses.is_empty();
        found = poses
            .into_iter()
            .find_map(|pose| enter(world, [part, into], &pose, manner, None, &mut blockers));
    }
    world.set_placement(part, now);
    let Some(seat) = found else {
        blockers.sort_unstable();
        blockers.dedup();
        if tried || !blockers.is_empty() {
            let names: Vec<&str> = blockers.iter().map(|&p| world.name(p)).collect();
            let words = if names.is_empty() {
                format!("{name} cannot come into {target} from this side")
            } else {
                format!(
                    "{name} cannot come into its place at {target}: {} in the way",
                    names.join(", ")
                )
            };
            return Err(Trouble::Refuse(Code::Blocked, words, blockers));
        }
        let words = format!("no surface of {name} fits one of {target}");
        return Err(Trouble::Refuse(Code::NoFit, words, vec![part, into]));
    };
    world.set_placement(part, seat.pose);
    match manner.extent {
        Amount::Half => {
            let back = range_mm(world, part, seat.way) / 2.0;
            world.shift(&[part], seat.way * back);
        }
        Amount::Full | Amount::Open => {}
        _ => {
            world.set_placement(part, now);
            let words = format!("connect {name} fully or half; adjust it by an amount afterwards");
            return Err(Trouble::Refuse(Code::NotUnderstood, words, vec![part]));
        }
    }
    act.axis = Some((-seat.way).to_array());
    act.amount = Some(seat.travel);
    Ok(act)
}

fn in_hole(world: &World, part: usize, pose: &DAffine3, hole: Option<Port>) -> bool {
    hole.is_none_or(|hole| {
        world
            .ports(part)
            .iter()
            .any(|port| port.placed(pose).connected(&hole).is_some())
    })
}

/// Places of `part` against `into` that the file knows, the own first, then the nearest.
fn seats(world: &World, part: usize, into: usize) -> Vec<DAffine3> {
    let shape = |p: usize| world.kind(p);
    let mut known: Vec<(bool, DAffine3)> = Vec::new();
    for like in (0..world.count()).filter(|&p| shape(p) == shape(part)) {
        for base in (0..world.count()).filter(|&p| shape(p) == shape(into) && world.joined_at_home(like, p)) {
            let pose = world.placement(into) * world.home(base).inverse() * world.home(like);
            known.push((like == part && base == into, pose));
        }
    }
    for i in 0..known.len() {
        let carried = carried_over(world, part, into, &known[i].1);
        known.extend(carried.into_iter().map(|pose| (false, pose)));
    }
    let (low, high) = world.assembly().body(part).bounds();
    let middle = |pose: &DAffine3| pose.transform_point3((low + high) / 2.0);
    let here = middle(&world.placement(part));
    known.sort_by(|(own, p), (other, q)| {
        let away = |pose: &DAffine3| middle(pose).distance(here);
        other.cmp(own).then(away(p).total_cmp(&away(q)))
    });
    let mut out: Vec<DAffine3> = Vec::new();
    for (_, pose) in known {
        if !out.iter().any(|p| world.same(part, p, &pose)) {
            out.push(pose);
        }
    }
    out
}

/// The place `pose` in a bore of `into`, in all equal and parallel bores there.
fn carried_over(world: &World, part: usize, into: usize, pose: &DAffine3) -> Vec<DAffine3> {
    let bores: Vec<Port> = world
        .ports(into)
        .iter()
        .filter(|p| !p.male)
        .map(|p| p.placed(&world.placement(into)))
        .collect();
    let mut filled = Vec::new();
    for port in world.ports(part) {
        let port = port.placed(pose);
        filled.extend(bores.iter().filter(|b| port.connected(b).is_some()).copied());
    }
    // A part in several bores at once has no single bore to be carried from.
    let [bore] = filled[..] else { return Vec::new() };
    bores
        .iter()
        .filter(|b| {
            (b.radius - bore.radius).abs() < EQUAL_MM
                && (b.length() - bore.length()).abs() < EQUAL_MM
                && b.direction.dot(bore.direction) > 0.999_999
                && b.middle().distance(bore.middle()) > EQUAL_MM
        })
        .map(|b| DAffine3::from_translation(b.middle() - bore.middle()) * *pose)
        .collect()
}

/// Checks a seat: free of overlap, and with a straight way in. The part stands there afterwards. `known`: a way out and the travel, mm, on which it is known to be free.
fn enter(
    world: &mut World,
    [part, into]: [usize; 2],
    pose: &DAffine3,
    manner: &Manner,
    known: Option<(DVec3, f64)>,
    blockers: &mut Vec<usize>,
) -> Option<Seat> {
    world.set_placement(part, *pose);
    if let Some(blocker) = world.blocker(part) {
        blockers.push(blocker);
        return None;
    }
    let loose: Vec<usize> = (0..world.count())
        .filter(|&p| p != part && world.connections(p).is_empty())
        .collect();
    let fixed: Vec<usize> = world
        .others(&[part])
        .into_iter()
        .filter(|p| *p == into || !loose.contains(p))
        .collect();
    let mut ways: Vec<(f64, DVec3)> = world
        .ways(part)
        .into_iter()
        .filter(|way| manner.agrees(*way))
        .map(|way| (world.exit_mm(&[part], &fixed, way), way))
        .collect();
    ways.sort_by(|(s, v), (t, w)| {
        (s * 10.0)
            .round()
            .total_cmp(&(t * 10.0).round())
            .then(w.z.total_cmp(&v.z))
    });
    for (exit, way) in ways {
        let is_known =
            known.is_some_and(|(direction, travel)| direction.dot(way) > PARALLEL && exit <= travel);
        let pair = if is_known {
            None
        } else {
            world.free(&[part], way, exit).1
        };
        match pair {
            None => {
                return Some(Seat {
                    pose: *pose,
                    way,
                    travel: exit,
                });
            }
            Some([_, blocker]) if Some(blocker) != blockers.last().copied() => blockers.push(blocker),
            Some(_) => {}
        }
    }
    None
}

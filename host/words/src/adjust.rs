//! adjust(a): along or about the remaining freedom, so that the connections still hold (Jung 2003, section 4).

use std::f64::consts::TAU;

use glam::DVec3;
use mortise_task::Motion;

use crate::lexicon::Place;
use crate::phrase::Amount;
use crate::reference::direction;
use crate::turn::{Act, Code, Trouble, Verb};
use crate::world::World;

/// Travel that counts as none, mm: the resolution of a contact.
const STILL_MM: f64 = 2e-3;
/// Most turns of one instruction.
const MOST_TURNS: f64 = 1000.0;
/// Cosine between a direction asked for and a freedom: within 25°.
const AGREES: f64 = 0.9;

fn refuse<T>(code: Code, words: String, parts: Vec<usize>) -> Result<T, Trouble> {
    Err(Trouble::Refuse(code, words, parts))
}

/// Moves `part` by `amount` outwards, inwards, or along `way`.
///
/// # Errors
/// `OutOfRange`: farther than the connection reaches, or not a freedom. `Blocked`: another part is in the way. `NotUnderstood`: no definite amount.
/// `NoFit`: connected to nothing.
///
/// Cost: one sweep for each direction along its axes.
pub fn adjust(
    world: &mut World,
    part: usize,
    out: bool,
    way: Option<Place>,
    amount: Amount,
) -> Result<Act, Trouble> {
    let name = world.name(part).to_owned();
    let connections = world.connections(part);
    if connections.is_empty() {
        return refuse(
            Code::NoFit,
            format!("{name} is connected to nothing; connect it first"),
            vec![part],
        );
    }
    if let Amount::Vague | Amount::Open | Amount::Angle(_) = amount {
        return refuse(
            Code::NotUnderstood,
            format!("say how far {name} moves, with a unit: 12 mm, half, fully"),
            vec![part],
        );
    }
    let along = match way {
        Some(place) => stated(world, part, place)?,
        None => {
            let outwards = outwards(world, part, amount);
            if out { outwards } else { -outwards }
        }
    };
    let range = range_mm(world, part, along);
    let limit = match amount {
        Amount::Length(mm) => mm.min(range),
        _ => range,
    };
    let (free, pair) = world.travel(&[part], along, limit);
    let by = match amount {
        Amount::Length(mm) => mm,
        Amount::Half if out => range / 2.0,
        Amount::Half => free / 2.0,
        _ => free,
    };
    if by <= 0.0 {
        return refuse(
            Code::OutOfRange,
            format!("{name}: the amount must be more than 0"),
            vec![part],
        );
    }
    let blocker = pair.map(|[_, other]| other);
    let stuck = |world: &World| {
        let other = blocker.map_or("another part", |b| world.name(b));
        let words = if free <= STILL_MM {
            format!("{name} cannot move this way: {other} is in the way")
        } else {
            format!("{name} moves only {free:.3} mm this way, then {other} is in the way")
        };
        refuse(Code::Blocked, words, blocker.into_iter().collect())
    };
    if matches!(amount, Amount::Full | Amount::Half) && by <= STILL_MM {
        return stuck(world);
    }
    if by > range {
        if blocker.is_some() {
            return stuck(world);
        }
        let words = format!(
            "{name} would leave {} after {range:.3} mm",
            world.name(connections[0])
        );
        return refuse(Code::OutOfRange, words, connections);
    }
    if by > free + STILL_MM / 2.0 {
        return stuck(world);
    }
    world.shift(&[part], along * by);
    Ok(Act {
        verb: Verb::Adjust,
        a: name,
        b: Some(world.name(connections[0]).to_owned()),
        axis: Some(along.to_array()),
        amount: Some(by),
    })
}

/// Axes of the part's connected ports, or of its contacts when it has none.
fn axes(world: &World, part: usize) -> Vec<DVec3> {
    let mut axes: Vec<DVec3> = Vec::new();
    for fit in world.fits(part) {
        if !axes.iter().any(|a| a.cross(fit.port.direction).length() < 1e-3) {
            axes.push(fit.port.direction);
        }
    }
    if axes.is_empty() {
        world.ways(part)
    } else {
        axes.iter().flat_map(|&a| [a, -a]).collect()
    }
}

/// The freedom that agrees with a direction asked for.
fn stated(world: &World, part: usize, place: Place) -> Result<DVec3, Trouble> {
    let wanted = direction(place);
    let all = axes(world, part);
    let best = all
        .iter()
        .copied()
        .max_by(|a, b| a.dot(wanted).total_cmp(&b.dot(wanted)));
    match best {
        Some(axis) if axis.dot(wanted) > AGREES => Ok(axis),
        _ => refuse(
            Code::OutOfRange,
            format!("{} has no freedom in this direction", world.name(part)),
            world.connections(part),
        ),
    }
}

/// Direction out of the connection: the shortest way out of those in which the amount is free, else where it goes farthest.
fn outwards(world: &World, part: usize, amount: Amount) -> DVec3 {
    let mut best: Option<(bool, f64, DVec3)> = None;
    for axis in axes(world, part) {
        let range = range_mm(world, part, axis);
        let wanted = match amount {
            Amount::Length(mm) => mm.min(range),
            _ => range,
        };
        let (free, pair) = world.free(&[part], axis, wanted);
        let leaves = pair.is_none();
        let score = if leaves { -range } else { free };
        let better = best.is_none_or(|(l, s, d)| {
            (leaves, score, axis.z) > (l, s + 1e-6, d.z) && (leaves != l || score > s + 1e-6 || axis.z > d.z)
        });
        if better {
            best = Some((leaves, score, axis));
        }
    }
    best.map_or(DVec3::Z, |(.., axis)| axis)
}

/// Travel along `axis` until the last connected port is empty; without ports until the boxes of connected parts are apart.
pub fn range_mm(world: &World, part: usize, axis: DVec3) -> f64 {
    let mut range: f64 = 0.0;
    for fit in world.fits(part) {
        let along = fit.port.direction.dot(axis);
        if along.abs() < 0.999 {
            continue;
        }
        let (low, high) = fit.other.interval_on(&fit.port);
        range = range.max(if along > 0.0 {
            high - fit.port.low
        } else {
            fit.port.high - low
        });
    }
    if range > 0.0 {
        return range;
    }
    world.exit_mm(&[part], &world.connections(part), axis)
}

/// Turns `part` about the axis of its largest connected port, or of its own largest shaft.
///
/// # Errors
/// `NotUnderstood`: no definite angle. `NoFit`: no axis. `Blocked`: another part is in the way.
///
/// Cost: one sweep.
pub fn turn(world: &mut World, part: usize, amount: Amount) -> Result<Act, Trouble> {
    let name = world.name(part).to_owned();
    let Amount::Angle(angle) = amount else {
        return refuse(
            Code::NotUnderstood,
            format!("say how far {name} turns: 90 degrees, a quarter"),
            vec![part],
        );
    };
    let fit = world.fits(part).first().copied();
    let own = || {
        let ports = world.ports(part).iter().filter(|p| p.male);
        let largest = ports.max_by(|p, q| (p.radius * p.length()).total_cmp(&(q.radius * q.length())))?;
        Some(largest.placed(&world.placement(part)))
    };
    let Some(port) = fit.map(|f| f.port).or_else(own) else {
        return refuse(
            Code::NoFit,
            format!("{name} has no round surface to turn about"),
            vec![part],
        );
    };
    // The axis counts as pointing up, else to the rear, else to the right.
    let d = port.direction;
    let up = [d.z, d.y, d.x]
        .into_iter()
        .find(|c| c.abs() > 1e-6)
        .unwrap_or(1.0);
    let axis = d * up.signum();
    if !angle.is_finite() || angle.abs() > MOST_TURNS * TAU {
        return refuse(
            Code::OutOfRange,
            format!("{name}: at most {MOST_TURNS} turns at once"),
            vec![part],
        );
    }
    // What is free once around is free for ever.
    let motion = Motion::turn(port.origin, axis, angle.clamp(-TAU, TAU));
    let (share, pair) = world.share(part, &motion);
    if let Some([_, other]) = pair {
        let degrees = (share * motion.angle).to_degrees().abs();
        let words = format!(
            "{name} turns only {degrees:.3}° this way, then {} is in the way",
            world.name(other)
        );
        return refuse(Code::Blocked, words, vec![other]);
    }
    let turned = Motion::turn(port.origin, axis, angle).at(1.0) * world.placement(part);
    world.set_placement(part, turned);
    Ok(Act {
        verb: Verb::Turn,
        a: name,
        b: fit.map(|f| world.name(f.with).to_owned()),
        axis: Some(axis.to_array()),
        amount: Some(angle.to_degrees()),
    })
}

//! disconnect(a, b): the part leaves along a straight free direction until it is apart from everything (Jung 2003, fig. 8).

use glam::DVec3;

use crate::turn::{Act, Code, Trouble, Verb};
use crate::world::{ROOM_MM, World};

/// Cosine between a direction asked for and one taken: within 45°.
const AGREES: f64 = 0.7;
/// Largest number of loose parts pushed ahead.
const MOST_CARRIED: usize = 16;

/// Takes `part` away, in the direction `hint` if one is given; `from` is reported. Parts connected to nothing that lie in the way are pushed ahead.
/// Of several free directions the shortest way out is taken, upwards of equal ones. It ends at a distance of the assembly's size, or halfway to a part
/// that hangs there.
///
/// # Errors
/// [`Trouble::Refuse`]: `Blocked` with the parts in the way, `NoFit` when it is connected to nothing.
///
/// Cost: one sweep for each direction tried.
pub fn disconnect(
    world: &mut World,
    part: usize,
    from: Option<usize>,
    hint: Option<DVec3>,
) -> Result<Act, Trouble> {
    let connections = world.connections(part);
    let name = world.name(part).to_owned();
    if let Some(b) = from
        && !connections.contains(&b)
    {
        let words = format!("{name} is not connected to {}", world.name(b));
        return Err(Trouble::Refuse(Code::NoFit, words, vec![part, b]));
    }
    if connections.is_empty() {
        return Err(Trouble::Refuse(
            Code::NoFit,
            format!("{name} is connected to nothing; there is nothing to take it from"),
            vec![part],
        ));
    }
    let loose: Vec<usize> = (0..world.count())
        .filter(|&p| p != part && world.connections(p).is_empty())
        .collect();
    let mut ways: Vec<(f64, DVec3)> = world
        .ways(part)
        .into_iter()
        .filter(|way| hint.is_none_or(|hint| hint.dot(*way) > AGREES))
        .map(|way| (exit(world, &[part], &loose, way), way))
        .collect();
    ways.sort_by(|(s, v), (t, w)| {
        ((s * 10.0).round())
            .total_cmp(&(t * 10.0).round())
            .then(w.z.total_cmp(&v.z))
            .then(w.x.total_cmp(&v.x))
    });
    let mut blockers: Vec<(f64, usize)> = Vec::new();
    for (_, way) in ways {
        match leave(world, part, &loose, way) {
            Ok((moving, travel)) => {
                world.shift(&moving, way * travel);
                let b = from.or_else(|| connections.first().copied());
                return Ok(Act {
                    verb: Verb::Disconnect,
                    a: name,
                    b: b.map(|b| world.name(b).to_owned()),
                    axis: Some(way.to_array()),
                    amount: Some(travel),
                });
            }
            Err(found) => blockers.push(found),
        }
    }
    // The way that goes farthest first: what stands there is most to the point.
    blockers.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut parts: Vec<usize> = Vec::new();
    for &(_, blocker) in &blockers {
        if !parts.contains(&blocker) {
            parts.push(blocker);
        }
    }
    let names: Vec<&str> = parts.iter().map(|&p| world.name(p)).collect();
    let words = match hint {
        Some(_) if names.is_empty() => format!("{name} has no way out in this direction"),
        _ => format!(
            "{name} cannot leave straight in any direction tried: {} in the way",
            names.join(", ")
        ),
    };
    Err(Trouble::Refuse(Code::Blocked, words, parts))
}

/// Travel after which the group is apart from all parts that are connected to something.
fn exit(world: &World, moving: &[usize], loose: &[usize], way: DVec3) -> f64 {
    let fixed: Vec<usize> = world
        .others(moving)
        .into_iter()
        .filter(|p| !loose.contains(p))
        .collect();
    world.exit_mm(moving, &fixed, way)
}

/// The parts that move and how far, or the free travel and the part that blocks.
fn leave(world: &World, part: usize, loose: &[usize], way: DVec3) -> Result<(Vec<usize>, f64), (f64, usize)> {
    let mut moving = vec![part];
    loop {
        let needed = exit(world, &moving, loose, way) + ROOM_MM;
        let (free, pair) = world.free(&moving, way, needed);
        match pair {
            None => {
                // Beyond, by boxes alone.
                let wanted = needed + world.diagonal();
                let free = world.room_mm(&moving, way, needed, wanted);
                return Ok((
                    moving,
                    if free < wanted {
                        (needed + free) / 2.0
                    } else {
                        wanted
                    },
                ));
            }
            Some([_, blocker]) if loose.contains(&blocker) && moving.len() < MOST_CARRIED => {
                moving.push(blocker)
            }
            Some([_, blocker]) => return Err((free, blocker)),
        }
    }
}

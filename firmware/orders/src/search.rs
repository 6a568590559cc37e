//! Every order of events to a depth, worlds that go on alike taken once.

use std::collections::{BTreeMap, HashMap};
use std::fmt;

use mortise_firmware::channel::Channels;

use crate::board::{Chip, Rig, scene};
use crate::event::{ALPHABET, Event, STARTS, TOPICS, Topic};
use crate::oracle::Broken;
use crate::world::World;

/// What the enumeration found.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Events in the longest orders, without those of the start.
    pub depth: usize,
    /// Orders of events that were covered, of every length to the depth.
    pub orders: u128,
    /// Worlds that differ.
    pub states: usize,
    /// Steps carried out.
    pub steps: u64,
    /// For each promise that was broken: how many orders break it, and the first of the shortest.
    pub broken: BTreeMap<Broken, (u128, Vec<Event>)>,
}

impl Report {
    /// Orders that broke this promise.
    pub fn count(&self, promise: Broken) -> u128 {
        self.broken.get(&promise).map_or(0, |(orders, _)| *orders)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} orders to depth {}, {} states, {} steps, {} promises broken",
            self.orders,
            self.depth,
            self.states,
            self.steps,
            self.broken.len()
        )?;
        for (broken, (orders, first)) in &self.broken {
            write!(f, "\n  {broken:?} in {orders} orders, first:")?;
            for (index, event) in first.iter().enumerate() {
                write!(f, "{} {event}", if index == 0 { "" } else { "," })?;
            }
        }
        Ok(())
    }
}

/// An order of events, and how many orders lead to the same world.
type Node = (Vec<Event>, u128);

/// What one order's next events lead to.
struct Found {
    path: Vec<Event>,
    orders: u128,
    outcome: Result<u64, Broken>,
}

/// Tries every order of at most `depth` events of the whole alphabet, see [`enumerate_of`].
pub fn enumerate(depth: usize) -> Report {
    enumerate_of(&ALPHABET, depth)
}

/// Tries every order of at most `depth` events of each topic: fewer kinds of events, so that orders may be longer.
pub fn enumerate_topics(depth: usize) -> Vec<(&'static Topic, Report)> {
    let topics = TOPICS.iter();
    topics
        .map(|topic| (topic, enumerate_of(topic.events, depth)))
        .collect()
}

/// Tries every order of at most `depth` of `events` behind idle, stopped and active, on as many threads as there are processors.
///
/// Breadth first: the planes cannot be copied, so each order is carried out from the start. An order that breaks a promise is not continued.
pub fn enumerate_of(events: &[Event], depth: usize) -> Report {
    let image = scene();
    let mut report = Report {
        depth,
        states: STARTS.len(),
        ..Report::default()
    };
    let mut seen: HashMap<u64, ()> = HashMap::new();
    let mut frontier: Vec<Node> = STARTS.iter().map(|start| (start.to_vec(), 1)).collect();
    for _ in 0..depth {
        let mut next: Vec<Node> = Vec::new();
        let mut place: HashMap<u64, usize> = HashMap::new();
        for found in expand(&frontier, events, &image) {
            report.steps += 1;
            report.orders += found.orders;
            match found.outcome {
                Err(broken) => {
                    let (orders, _) = report.broken.entry(broken).or_insert((0, found.path));
                    *orders += found.orders;
                }
                // Seen with fewer events: what follows was covered to a greater depth.
                Ok(print) if seen.contains_key(&print) => {}
                Ok(print) => match place.get(&print) {
                    Some(&index) => next[index].1 += found.orders,
                    None => {
                        place.insert(print, next.len());
                        next.push((found.path, found.orders));
                    }
                },
            }
        }
        seen.extend(place.into_keys().map(|print| (print, ())));
        report.states += next.len();
        frontier = next;
    }
    report
}

fn expand(frontier: &[Node], events: &[Event], image: &[u8]) -> Vec<Found> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let share = frontier.len().div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let workers: Vec<_> = frontier
            .chunks(share)
            .map(|nodes| {
                scope.spawn(move || {
                    nodes
                        .iter()
                        .flat_map(|node| follow(node, events, image))
                        .collect()
                })
            })
            .collect();
        workers
            .into_iter()
            .flat_map(|worker| {
                let found: std::thread::Result<Vec<Found>> = worker.join();
                // A panic of a plane is a finding of its own: let it show.
                found.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
            .collect()
    })
}

/// Each of `events` behind one order.
fn follow((path, orders): &Node, events: &[Event], image: &[u8]) -> Vec<Found> {
    let mut found = Vec::with_capacity(events.len());
    for &event in events {
        let (chip, rig) = (Chip::with(image), Rig::at_rest());
        let mut channels = Box::new(Channels::new());
        let mut world = World::new(&mut channels, &chip, &rig, image);
        for &event in path {
            world.step(event);
        }
        if !world.can(event) {
            continue;
        }
        let outcome = world.step(event).map_or_else(|| Ok(world.fingerprint()), Err);
        let mut path = path.clone();
        path.push(event);
        found.push(Found {
            path,
            orders: *orders,
            outcome,
        });
    }
    found
}

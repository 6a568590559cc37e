//! Enumeration of every sequence of events to a depth; equivalent worlds are explored once.

use std::collections::{BTreeMap, HashMap};
use std::fmt;

use mortise_firmware::channel::Channels;

use crate::board::{Chip, Rig, scene};
use crate::event::{ALPHABET, Event, STARTS, TOPICS, Topic};
use crate::oracle::Broken;
use crate::world::World;

/// Result of the enumeration.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Length of the longest sequences, without the initial one.
    pub depth: usize,
    /// Number of sequences covered, of every length up to the depth.
    pub orders: u128,
    /// Number of different worlds.
    pub states: usize,
    /// Number of steps executed.
    pub steps: u64,
    /// For each broken promise: the number of sequences that break it, and the first of the shortest.
    pub broken: BTreeMap<Broken, (u128, Vec<Event>)>,
}

impl Report {
    /// Number of sequences that broke this promise.
    pub fn count(&self, promise: Broken) -> u128 {
        self.broken.get(&promise).map_or(0, |(orders, _)| *orders)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} sequences to depth {}, {} states, {} steps, {} promises broken",
            self.orders,
            self.depth,
            self.states,
            self.steps,
            self.broken.len()
        )?;
        for (broken, (orders, first)) in &self.broken {
            write!(f, "\n  {broken:?} in {orders} sequences, first:")?;
            for (index, event) in first.iter().enumerate() {
                write!(f, "{} {event}", if index == 0 { "" } else { "," })?;
            }
        }
        Ok(())
    }
}

/// A sequence of events, and the number of sequences that lead to an equivalent world.
type Node = (Vec<Event>, u128);

/// Results of the possible next events of one sequence.
struct Found {
    path: Vec<Event>,
    orders: u128,
    outcome: Result<u64, Broken>,
}

/// Tries every sequence of at most `depth` events of the whole alphabet, see [`enumerate_of`].
pub fn enumerate(depth: usize) -> Report {
    enumerate_of(&ALPHABET, depth)
}

/// Tries every sequence of at most `depth` events of each topic: there are fewer events, so that sequences can be longer.
pub fn enumerate_topics(depth: usize) -> Vec<(&'static Topic, Report)> {
    let topics = TOPICS.iter();
    topics
        .map(|topic| (topic, enumerate_of(topic.events, depth)))
        .collect()
}

/// Tries every sequence of at most `depth` of `events` after idle, stopped and active, on as many threads as there are processors.
///
/// Breadth-first: the planes cannot be copied, so each sequence is executed from the start. A sequence that breaks a promise is not continued.
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
                // Already reached with fewer events: its continuations were covered to a greater depth.
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
                // A panic of a plane is itself a finding: let it propagate.
                found.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
            .collect()
    })
}

/// Executes each of `events` after one sequence.
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

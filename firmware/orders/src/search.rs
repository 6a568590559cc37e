//! Enumeration of every sequence of events to a depth; equivalent worlds are explored once.

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;

use crate::board::scene;
use crate::event::{ALPHABET, Event, STARTS, TOPICS, Topic};
use crate::oracle::Broken;
use crate::world::{Moment, World};

/// Result of the enumeration.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Length of the longest sequences, without the initial one.
    pub depth: usize,
    /// Number of sequences covered: every one of every length up to the depth, less those that go on after a broken promise.
    pub orders: u128,
    /// Number of different worlds that were continued.
    pub states: usize,
    /// Number of steps executed.
    pub steps: u64,
    /// For each broken promise: the number of executed steps that broke it, and the first of the shortest sequences.
    pub broken: BTreeMap<Broken, (u64, Vec<Event>)>,
}

impl Report {
    /// Number of steps that broke this promise.
    pub fn count(&self, promise: Broken) -> u64 {
        self.broken.get(&promise).map_or(0, |(steps, _)| *steps)
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
        for (broken, (steps, first)) in &self.broken {
            write!(f, "\n  {broken:?} in {steps} steps, first:")?;
            for (index, event) in first.iter().enumerate() {
                write!(f, "{} {event}", if index == 0 { "" } else { "," })?;
            }
        }
        Ok(())
    }
}

/// A sequence of events as one number: its start in the lowest bits, then the places of its events in the alphabet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Path {
    packed: u64,
    length: u32,
}

impl Path {
    const BITS: u32 = 5;

    fn start(start: usize) -> Self {
        Self {
            packed: start as u64,
            length: 0,
        }
    }

    fn then(self, event: usize) -> Self {
        let length = self.length + 1;
        Self {
            packed: self.packed | (event as u64) << (Self::BITS * length),
            length,
        }
    }

    /// The places of the events.
    fn events(self) -> impl Iterator<Item = usize> {
        self.steps().skip(1)
    }

    /// The start, then the events.
    fn steps(self) -> impl Iterator<Item = usize> {
        (0..=self.length).map(move |at| (self.packed >> (Self::BITS * at)) as usize & 0x1f)
    }
}

/// What an event leads to: the fingerprint, or the promise it broke; `None` when it was not executed.
type Outcome = Option<Result<u64, Broken>>;

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
/// Breadth-first. Of sequences that lead to the same fingerprint only the first is continued. A sequence that breaks a promise is not continued. Of
/// the last events only those are executed that can break a promise ([`Event::can_break`]).
///
/// # Panics
/// When there are more than 32 events, or the depth is beyond 11.
pub fn enumerate_of(events: &[Event], depth: usize) -> Report {
    search(events, depth, None)
}

/// As [`enumerate_of`]; also tests the fingerprint itself: for every `each`-th sequence that is not continued because an equal one is, each event must
/// have the same outcome in both, fingerprints included. Returns the number of such comparisons and those that differ.
pub fn compare_equals(events: &[Event], depth: usize, each: u64) -> (u64, Vec<String>) {
    let mut equals = Equals {
        each,
        ..Equals::default()
    };
    search(events, depth, Some(&mut equals));
    (equals.compared, equals.differ)
}

/// Sequences with equal fingerprints, to be compared.
#[derive(Default)]
struct Equals {
    each: u64,
    found: u64,
    pairs: Vec<(Path, Path)>,
    compared: u64,
    differ: Vec<String>,
}

impl Equals {
    fn note(&mut self, one: Path, other: Path) {
        self.found += 1;
        if self.found.is_multiple_of(self.each) {
            self.pairs.push((one, other));
        }
    }

    /// Compares the noted pairs with `left` events to come.
    fn compare(&mut self, walker: &mut Walker<'_>, left: usize) {
        for (one, other) in std::mem::take(&mut self.pairs) {
            let outcomes = [one, other].map(|path| walker.follow(path, left));
            for (event, (one_next, other_next)) in outcomes[0].iter().zip(&outcomes[1]).enumerate() {
                self.compared += 1;
                if one_next != other_next {
                    let said = [one, other].map(|path| walker.words(path.then(event)));
                    self.differ.push(format!("{} <> {}", said[0], said[1]));
                }
            }
        }
    }
}

fn search(events: &[Event], depth: usize, mut equals: Option<&mut Equals>) -> Report {
    assert!(events.len() <= 1 << Path::BITS && depth <= 11, "paths are packed");
    let image = scene();
    let mut report = Report {
        depth,
        orders: covered(events.len(), depth),
        states: STARTS.len(),
        ..Report::default()
    };
    // The first sequence that leads to each state.
    let mut known: HashMap<u64, Path> = HashMap::new();
    let mut frontier: Vec<Path> = (0..STARTS.len()).map(Path::start).collect();
    let mut walker = equals.is_some().then(|| Walker::new(events, &image));
    for left in (0..depth).rev() {
        let mut next: Vec<Path> = Vec::new();
        expand(&frontier, events, &image, left, |path, outcome| {
            report.steps += 1;
            match outcome {
                Err(broken) => {
                    let first = || (0, path.events().map(|event| events[event]).collect());
                    report.broken.entry(broken).or_insert_with(first).0 += 1;
                }
                // Nothing follows.
                Ok(_) if left == 0 => {}
                Ok(print) => match known.entry(print) {
                    Entry::Occupied(first) => {
                        if let Some(equals) = &mut equals {
                            equals.note(path, *first.get());
                        }
                    }
                    Entry::Vacant(entry) => {
                        entry.insert(path);
                        next.push(path);
                    }
                },
            }
        });
        if let (Some(equals), Some(walker)) = (&mut equals, &mut walker)
            && left > 0
        {
            equals.compare(walker, left - 1);
        }
        frontier = next;
    }
    report.states += known.len();
    report
}

/// Number of sequences of one to `depth` of so many events, after each start.
fn covered(events: usize, depth: usize) -> u128 {
    let lengths = (1..=depth as u32).map(|length| (events as u128).pow(length));
    lengths.sum::<u128>() * STARTS.len() as u128
}

/// Sequences that a thread takes at once.
const SHARE: usize = 2048;

/// Passes the outcome of each event after each sequence to `found`, in order.
fn expand(
    frontier: &[Path],
    events: &[Event],
    image: &[u8],
    left: usize,
    mut found: impl FnMut(Path, Result<u64, Broken>),
) {
    let shares: Vec<&[Path]> = frontier.chunks(SHARE).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let taken = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        let (give, take) = sync_channel(threads);
        for _ in 0..threads.min(shares.len()) {
            let (give, shares, taken) = (give.clone(), &shares, &taken);
            scope.spawn(move || {
                let mut walker = Walker::new(events, image);
                loop {
                    let index = taken.fetch_add(1, Ordering::Relaxed);
                    let Some(paths) = shares.get(index) else {
                        break;
                    };
                    let outcomes: Vec<Vec<Outcome>> =
                        paths.iter().map(|path| walker.follow(*path, left)).collect();
                    if give.send((index, outcomes)).is_err() {
                        break;
                    }
                }
            });
        }
        drop(give);
        let mut early = BTreeMap::new();
        let mut due = 0;
        for (index, outcomes) in take {
            early.insert(index, outcomes);
            while let Some(outcomes) = early.remove(&due) {
                for (path, outcomes) in shares[due].iter().zip(outcomes) {
                    for (event, outcome) in outcomes.into_iter().enumerate() {
                        outcome
                            .into_iter()
                            .for_each(|outcome| found(path.then(event), outcome));
                    }
                }
                due += 1;
            }
        }
    });
}

/// A world that is led along one sequence after another, and keeps the moments along the last.
struct Walker<'i> {
    events: &'i [Event],
    world: World<'i>,
    begin: Moment,
    /// Moments along the sequence; of the rest only the memory is kept.
    trail: Vec<(usize, Moment)>,
    length: usize,
}

impl<'i> Walker<'i> {
    fn new(events: &'i [Event], image: &'i [u8]) -> Self {
        let world = World::new(image);
        Self {
            events,
            begin: world.save(),
            world,
            trail: Vec::new(),
            length: 0,
        }
    }

    /// The outcome of each event after this sequence, `left` more to follow.
    fn follow(&mut self, path: Path, left: usize) -> Vec<Outcome> {
        self.lead(path);
        let (_, here) = &self.trail[self.length - 1];
        let events = self.events.iter();
        events
            .map(|event| {
                if left == 0 && !event.can_break() {
                    return None;
                }
                self.world.put_back(here);
                Some(match self.world.step(*event) {
                    Some(broken) => Err(broken),
                    None if left == 0 => Ok(0),
                    None => Ok(self.world.fingerprint(left)),
                })
            })
            .collect()
    }

    fn lead(&mut self, path: Path) {
        let kept = self.trail[..self.length].iter();
        let common = kept
            .zip(path.steps())
            .take_while(|((kept, _), step)| kept == step)
            .count();
        self.length = common;
        let moment = common.checked_sub(1).map_or(&self.begin, |at| &self.trail[at].1);
        self.world.put_back(moment);
        for step in path.steps().skip(common) {
            match self.length {
                0 => STARTS[step].iter().for_each(|event| {
                    self.world.step(*event);
                }),
                _ => {
                    self.world.step(self.events[step]);
                }
            }
            match self.trail.get_mut(self.length) {
                Some((kept, moment)) => {
                    *kept = step;
                    self.world.save_to(moment);
                }
                None => self.trail.push((step, self.world.save())),
            }
            self.length += 1;
        }
    }

    fn words(&self, path: Path) -> String {
        let mut said = format!("start {}", path.steps().next().unwrap_or_default());
        for event in path.events() {
            said += &format!(", {}", self.events[event]);
        }
        said
    }
}

//! What computing a recorded run again is about, and what it has given. Pure.

use mortise_protocol::parameter::ParameterId;
use mortise_record::Replayed;

use super::threads::Cancel;

/// The parameter that has another value than in the recording; `None`: all as they were.
pub type Recomputing = Option<(ParameterId, f32)>;

/// A computation under way, which ends when this is dropped.
#[derive(Debug)]
pub struct Recomputation {
    /// What is changed.
    pub what: Recomputing,
    /// Share that is done, 0 to 1.
    pub done: f64,
    pub(super) cancel: Cancel,
}

impl Drop for Recomputation {
    fn drop(&mut self) {
        self.cancel.set();
    }
}

/// What computing a run again has given.
#[derive(Clone, Debug, PartialEq)]
pub struct Recomputed {
    /// What was changed.
    pub what: Recomputing,
    /// Ticks compared.
    pub ticks: u64,
    /// Ticks in the recording.
    pub recorded: u64,
    /// The first tick that differs; `None`: every bit is the same.
    pub differs: Option<Differs>,
    /// Reasons why ticks were left out.
    pub left_out: Vec<String>,
}

/// Where the results first differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Differs {
    /// Time in the run, s, where it is known.
    pub at_s: Option<f64>,
    /// The tick as the board counted it.
    pub tick: u32,
    /// The last message that took effect before it, in words.
    pub after: String,
}

/// A report of a computation.
pub enum RecomputeUpdate {
    /// So much is done, 0 to 1.
    Done(f64),
    /// It ended, or one line with the reason why it could not be done.
    Ended(Result<Replayed, String>),
}

impl Recomputed {
    /// Of a replay; `time_of` has the time of a tick in the run, s.
    pub fn new(replayed: Replayed, what: Recomputing, time_of: impl Fn(u32) -> Option<f64>) -> Self {
        let left_out = replayed.left_out.into_iter();
        Self {
            what,
            ticks: replayed.compared,
            recorded: replayed.recorded,
            differs: replayed.difference.map(|found| Differs {
                at_s: time_of(found.tick),
                tick: found.tick,
                after: found.after,
            }),
            left_out: left_out
                .map(|(tick, why)| format!("Left out from tick {tick} to the next reset of the scene: {why}"))
                .collect(),
        }
    }

    /// The result as a sentence.
    pub fn words(&self) -> String {
        let ticks = self.ticks;
        match &self.differs {
            None => format!(
                "{ticks} of {} ticks computed again: every bit the same",
                self.recorded
            ),
            Some(found) => format!(
                "Tick {}{} is the first with another result, {ticks} ticks compared; the last message before it: {}",
                found.tick,
                found.at_s.map_or(String::new(), |at| format!(", at {at:.2} s,")),
                found.after
            ),
        }
    }
}

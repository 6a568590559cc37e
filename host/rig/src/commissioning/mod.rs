//! Commissioning: the order in which a new rig is tried, one thing at a time, what each result means, and what it corrects in the description.
//!
//! Encoders first, by hand and with the motors off: does each count, and in the sense of the description? Then the reference and the stop input, and only
//! then each motor alone, with a short push of a small force ([`ToDevice::TestMotor`]). A step that fails is repeated until it passes; no later step can
//! be reached before. What a step corrects is taken back by [`Commissioning::back`], and reaches the board only in a step of its own
//! ([`Step::Send`]).
//!
//! [`ToDevice::TestMotor`]: mortise_protocol::message::ToDevice::TestMotor

pub mod operator;
mod step;
mod verdict;
mod words;

use mortise_protocol::limits::MAX_JOINTS;
use mortise_protocol::message::{MotorTest, Readings};
use mortise_protocol::rig::Rig;

pub use step::{Outcome, Step};
pub use verdict::{Sense, both_ways, encoder_sense, motor_sense};

#[derive(Clone, Debug)]
struct Entry {
    step: Step,
    outcome: Outcome,
    /// The description when the step began.
    before: Rig,
}

/// State of the stop step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StopSeen {
    /// Closed so far.
    Closed,
    /// Open from the step's beginning.
    OpenFromStart,
    /// It opened after it had been closed.
    Opened,
}

/// The steps, how far they are, and the description as corrected; see the module.
#[derive(Clone, Debug)]
pub struct Commissioning {
    /// On the board and in use.
    in_use: Rig,
    /// With the corrections so far.
    rig: Rig,
    entries: Vec<Entry>,
    at: usize,
    /// Readings at the beginning of the step, and the newest.
    first: Option<Readings>,
    newest: Option<Readings>,
    /// Of the stop input since the step began; `None`: nothing yet.
    stop: Option<StopSeen>,
    /// Smallest and largest angle of each joint in the last step, rad.
    reached: [[f32; 2]; MAX_JOINTS],
}

const NOTHING_REACHED: [[f32; 2]; MAX_JOINTS] = [[f32::INFINITY, f32::NEG_INFINITY]; MAX_JOINTS];

impl Commissioning {
    /// At the first step, for the description `in_use` on the board.
    pub fn new(in_use: Rig) -> Self {
        let joints = 0..in_use.joints.len() as u8;
        let steps = joints
            .clone()
            .map(Step::Encoder)
            .chain([Step::Send, Step::Reference, Step::StopInput])
            .chain(joints.map(Step::Motor))
            .chain([Step::Send, Step::Workspace, Step::Send]);
        let entries = steps.map(|step| Entry {
            step,
            outcome: Outcome::Open,
            before: in_use.clone(),
        });
        Self {
            entries: entries.collect(),
            rig: in_use.clone(),
            in_use,
            at: 0,
            first: None,
            newest: None,
            stop: None,
            reached: NOTHING_REACHED,
        }
    }

    /// Every step with its outcome, in order.
    pub fn steps(&self) -> impl Iterator<Item = (Step, &Outcome)> {
        self.entries.iter().map(|entry| (entry.step, &entry.outcome))
    }

    /// Number of the present step; that of steps when all are done.
    pub fn at(&self) -> usize {
        self.at
    }

    /// The present step; `None`: all are done.
    pub fn step(&self) -> Option<Step> {
        self.entries.get(self.at).map(|entry| entry.step)
    }

    /// What the operator does in the present step.
    pub fn instruction(&self) -> String {
        words::instruction(self.step(), &self.rig)
    }

    /// Outcome of the present step: open, or failed.
    pub fn outcome(&self) -> &Outcome {
        self.entries
            .get(self.at)
            .map_or(&Outcome::Open, |entry| &entry.outcome)
    }

    /// The description with all corrections so far.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The description that the board uses.
    pub fn in_use(&self) -> &Rig {
        &self.in_use
    }

    /// The newest readings.
    pub fn readings(&self) -> Option<&Readings> {
        self.newest.as_ref()
    }

    /// Angle of a joint by the corrected description, rad; counted from its home.
    pub fn angle(&self, joint: usize) -> Option<f32> {
        let count = self.newest?.counts[joint];
        let described = self.rig.joints.get(joint)?;
        Some(described.home + count as f32 * described.radians_per_count())
    }

    /// Angle by which a joint has turned since the present step began, rad, in the sense of the corrected description.
    pub fn turned(&self, joint: usize) -> Option<f32> {
        let counted = counted(self.first.as_ref()?, self.newest.as_ref()?);
        let described = self.rig.joints.get(joint)?;
        Some(counted[joint] as f32 * described.radians_per_count())
    }

    /// Smallest and largest angle that a joint has reached in the last step, rad.
    pub fn reached(&self, joint: usize) -> Option<[f32; 2]> {
        let [from, to] = self.reached[joint];
        (from <= to).then_some([from, to])
    }

    /// Takes new readings in.
    pub fn see(&mut self, readings: &Readings) {
        self.first.get_or_insert(*readings);
        self.newest = Some(*readings);
        match self.step() {
            Some(Step::StopInput) => self.see_stop(readings.stop_open),
            Some(Step::Workspace) => {
                for joint in 0..self.rig.joints.len() {
                    if let Some(angle) = self.angle(joint) {
                        let [from, to] = &mut self.reached[joint];
                        (*from, *to) = (from.min(angle), to.max(angle));
                    }
                }
            }
            // Nothing to send: the step is done as it begins.
            Some(Step::Send) if self.rig == self.in_use => {
                self.finish(Outcome::Passed(words::nothing_to_send()));
            }
            _ => {}
        }
    }

    fn see_stop(&mut self, open: bool) {
        let seen = match (self.stop, open) {
            (None, true) => StopSeen::OpenFromStart,
            (Some(StopSeen::Opened), false) => return self.finish(Outcome::Passed(words::stop_works())),
            // Released: from here on as if it had been closed.
            (None | Some(_), false) => StopSeen::Closed,
            (Some(StopSeen::Closed), true) => StopSeen::Opened,
            (Some(seen), true) => seen,
        };
        if self.stop != Some(seen) {
            self.set(match seen {
                StopSeen::OpenFromStart => Outcome::Failed(words::stop_is_open()),
                StopSeen::Closed | StopSeen::Opened => Outcome::Open,
            });
        }
        self.stop = Some(seen);
    }

    /// The operator has done what the step asks for: judges the encoder, the stop input or the workspace.
    pub fn done(&mut self) {
        match self.step() {
            Some(Step::Encoder(joint)) => self.judge_encoder(joint),
            Some(Step::StopInput) if self.stop == Some(StopSeen::Closed) => {
                self.set(Outcome::Failed(words::stop_never_opened()));
            }
            Some(Step::StopInput) if self.stop == Some(StopSeen::Opened) => {
                self.set(Outcome::Failed(words::stop_stays_open()));
            }
            Some(Step::Workspace) => self.judge_workspace(),
            _ => {}
        }
    }

    fn judge_encoder(&mut self, joint: u8) {
        let (Some(first), Some(newest)) = (&self.first, &self.newest) else {
            return;
        };
        let sense = encoder_sense(&self.rig, joint, &counted(first, newest));
        let outcome = match sense {
            Sense::Forward => Outcome::Passed(words::encoder_counts(joint)),
            Sense::Backward => {
                let described = &mut self.rig.joints[usize::from(joint)];
                described.encoder_reversed = !described.encoder_reversed;
                Outcome::Corrected(words::encoder_corrected(joint, described.encoder_reversed))
            }
            Sense::Still => Outcome::Failed(words::encoder_still(joint)),
            Sense::Other(other) => Outcome::Failed(words::encoder_elsewhere(joint, other)),
            Sense::Unclear => {
                let turned = self.turned(usize::from(joint)).unwrap_or(0.0);
                Outcome::Failed(words::turn_farther(joint, turned))
            }
        };
        self.conclude(outcome);
    }

    fn judge_workspace(&mut self) {
        let mut notes = Vec::new();
        let mut corrected = false;
        for joint in 0..self.rig.joints.len() {
            let Some(reached) = self.reached(joint) else {
                return;
            };
            let described = &mut self.rig.joints[joint];
            let (range, note) = verdict::range(described.range, reached);
            corrected |= range != described.range;
            described.range = range;
            notes.push(words::range(joint as u8, reached, note));
        }
        let words = notes.join("; ");
        self.conclude(if corrected {
            Outcome::Corrected(words)
        } else {
            Outcome::Passed(words)
        });
    }

    /// The board has set the reference, or refused it.
    pub fn referenced(&mut self, result: Result<(), String>) {
        if self.step() == Some(Step::Reference) {
            self.conclude(match result {
                Ok(()) => Outcome::Passed(words::referenced()),
                Err(reason) => Outcome::Failed(reason),
            });
        }
    }

    /// The motor of the present step was tested forward and backward, or the board ended a test.
    pub fn tested(&mut self, result: Result<[MotorTest; 2], String>) {
        let Some(Step::Motor(joint)) = self.step() else {
            return;
        };
        let outcome = match result {
            Err(reason) => Outcome::Failed(reason),
            Ok(tests) => match motor_sense(&self.rig, joint, &tests) {
                Sense::Forward => Outcome::Passed(words::motor_pushes(joint)),
                Sense::Backward => {
                    let described = &mut self.rig.joints[usize::from(joint)];
                    described.motor_reversed = !described.motor_reversed;
                    Outcome::Corrected(words::motor_corrected(joint, described.motor_reversed))
                }
                Sense::Still => Outcome::Failed(words::motor_still(joint)),
                Sense::Other(other) => Outcome::Failed(words::motor_elsewhere(joint, other)),
                Sense::Unclear => Outcome::Failed(words::motor_unclear(joint)),
            },
        };
        self.conclude(outcome);
    }

    /// The board uses the description `rig` from now on, or the reason why not.
    pub fn sent(&mut self, result: Result<Rig, String>) {
        match result {
            Ok(rig) => {
                let all = rig == self.rig;
                self.in_use = rig;
                if self.step() == Some(Step::Send) && all {
                    self.finish(Outcome::Passed(words::sent()));
                }
            }
            Err(reason) if self.step() == Some(Step::Send) => self.set(Outcome::Failed(reason)),
            Err(_) => {}
        }
    }

    /// Tries the present step from its beginning.
    pub fn again(&mut self) {
        self.set(Outcome::Open);
        self.begin();
    }

    /// Goes back to the step before and takes its correction back. What was sent stays on the board until it is sent again.
    pub fn back(&mut self) {
        let Some(before) = self.at.checked_sub(1) else {
            return;
        };
        self.set(Outcome::Open);
        self.at = before;
        self.rig = self.entries[before].before.clone();
        self.again();
        // A step that sends nothing would pass again at once.
        if self.step() == Some(Step::Send) && self.rig == self.in_use {
            self.back();
        }
    }

    /// Differences between the corrected description and the one that the board uses, in words.
    pub fn changes(&self) -> Vec<String> {
        words::changes(&self.in_use, &self.rig)
    }

    fn conclude(&mut self, outcome: Outcome) {
        if outcome.is_done() {
            self.finish(outcome);
        } else {
            self.set(outcome);
            self.begin();
        }
    }

    fn set(&mut self, outcome: Outcome) {
        if let Some(entry) = self.entries.get_mut(self.at) {
            entry.outcome = outcome;
        }
    }

    fn finish(&mut self, outcome: Outcome) {
        // After these the encoders count from another place.
        if matches!(self.step(), Some(Step::Send | Step::Reference)) {
            self.newest = None;
        }
        self.set(outcome);
        self.at += 1;
        if let Some(entry) = self.entries.get_mut(self.at) {
            entry.before = self.rig.clone();
        }
        self.begin();
    }

    fn begin(&mut self) {
        self.first = self.newest;
        self.stop = None;
        self.reached = NOTHING_REACHED;
    }
}

/// Counts from one reading to another.
fn counted(first: &Readings, newest: &Readings) -> [i32; mortise_protocol::limits::MAX_ENCODERS] {
    std::array::from_fn(|encoder| newest.counts[encoder].wrapping_sub(first.counts[encoder]))
}

#[cfg(test)]
mod tests;

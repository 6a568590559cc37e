//! Answers of the link plane itself that wait for room on the wire.
//!
//! Input is read whether or not there is room for output, so that STOP is found behind anything. A message is carried out only when its answer has
//! a place here; one that has none is thrown away and counted, as if the line had lost it. STOP is carried out without one.

use heapless::Deque;
use mortise_protocol::message::Refusal;

/// Answers that may wait. A host of ours has at most five messages of this kind under way: four chunks of a scene and a heartbeat.
pub const ANSWERS: usize = 16;

/// An answer; what it tells is looked up when it is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Answer {
    /// This build's version.
    Hello,
    /// What the board can do.
    Capabilities,
    /// The description of the rig.
    Rig,
    /// Done.
    Ack {
        /// Of the message.
        seq: u16,
    },
    /// Not done.
    Refused {
        /// Of the message.
        seq: u16,
        /// Why.
        reason: Refusal,
    },
}

/// First in, first out.
#[derive(Debug, Default)]
pub(super) struct Answers(Deque<Answer, ANSWERS>);

impl Answers {
    pub const fn new() -> Self {
        Self(Deque::new())
    }

    /// There is a place for one more.
    pub fn has_place(&self) -> bool {
        !self.0.is_full()
    }

    /// Adds one; `false` when there is no place.
    pub fn push(&mut self, answer: Answer) -> bool {
        self.0.push_back(answer).is_ok()
    }

    /// The oldest.
    pub fn pop(&mut self) -> Option<Answer> {
        self.0.pop_front()
    }

    /// How many wait.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Forgets all of them.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

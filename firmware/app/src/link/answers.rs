//! Queue of the link plane's own answers, which wait for space on the wire.
//!
//! Input is read whether or not there is space for output, so that STOP is found behind any other message. A message is carried out only when its
//! answer has a place in this queue; otherwise it is discarded and counted, as if the line had lost it. STOP is carried out even without one.

use heapless::Deque;
use mortise_protocol::message::Refusal;

/// Capacity of the queue. Mortise's host has at most five messages of this kind in flight: four chunks of a scene and a heartbeat.
pub const ANSWERS: usize = 16;

/// One answer; its content is read when it is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Answer {
    /// This build's version.
    Hello,
    /// What the board can do.
    Capabilities,
    /// The description of the rig.
    Rig,
    /// The message was carried out.
    Ack {
        /// Sequence number of the message.
        seq: u16,
    },
    /// The message was refused.
    Refused {
        /// Sequence number of the message.
        seq: u16,
        /// The reason.
        reason: Refusal,
    },
}

/// First-in, first-out queue of answers.
#[derive(Debug, Default)]
pub(super) struct Answers(Deque<Answer, ANSWERS>);

impl Answers {
    pub const fn new() -> Self {
        Self(Deque::new())
    }

    /// Whether there is space for one more.
    pub fn has_place(&self) -> bool {
        !self.0.is_full()
    }

    /// Adds one; `false` when the queue is full.
    pub fn push(&mut self, answer: Answer) -> bool {
        self.0.push_back(answer).is_ok()
    }

    /// Removes and returns the oldest.
    pub fn pop(&mut self) -> Option<Answer> {
        self.0.pop_front()
    }

    /// Answers waiting.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Discards all of them.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

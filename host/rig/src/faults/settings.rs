//! Which faults a line has.

use mortise_protocol::message::ToDevice;
use serde::Deserialize;

use super::inputs::{self, InputFault};

/// The faults of a line. The default has none. Shares are fractions of frames, 0 to 1, in both directions.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Faults {
    /// Seed; equal seeds give equal faults.
    pub seed: u64,
    /// Share of frames lost.
    pub drop: f64,
    /// Share of frames in which up to three bits are flipped.
    pub corrupt: f64,
    /// Share of frames delivered twice.
    pub repeat: f64,
    /// Share of frames delivered after the next one (or 50 ms later when none comes).
    pub reorder: f64,
    /// Range of the delay of every frame, uniformly distributed, ms.
    pub delay_ms: [u32; 2],
    /// Pauses: frames under way are delivered together at the end.
    pub stall: Vec<Window>,
    /// Cuts: frames under way are lost.
    pub disconnect: Vec<Window>,
    /// Spurious frames per second: to the board noise or heartbeats, from it noise.
    pub flood_per_s: u32,
    /// Faults at the board's inputs, where they are simulated.
    pub inputs: Vec<InputFault>,
}

/// A time window, counted from [`super::FaultLine::begin`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// Start, ms.
    pub at_ms: u64,
    /// Duration, ms.
    pub for_ms: u64,
}

impl Window {
    fn holds(&self, now_ms: u64) -> bool {
        now_ms >= self.at_ms && now_ms - self.at_ms < self.for_ms
    }
}

impl Faults {
    /// Checks the numbers; the error is a sentence.
    ///
    /// # Errors
    /// A share outside 0 to 1, or a delay whose end is below its start.
    pub fn check(&self) -> Result<(), String> {
        for (name, share) in [
            ("drop", self.drop),
            ("corrupt", self.corrupt),
            ("repeat", self.repeat),
            ("reorder", self.reorder),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return Err(format!(
                    "{name} = {share} is not a share: write a number from 0 to 1"
                ));
            }
        }
        let [from, to] = self.delay_ms;
        if from > to {
            return Err(format!(
                "delay_ms: {from} to {to} is not a range; write the smaller number first"
            ));
        }
        inputs::message(&self.inputs).map(|_| ())
    }

    /// The message that makes the simulated board's inputs fail; to be sent at the start of their time. The line does not send it.
    ///
    /// # Errors
    /// As [`Faults::check`].
    pub fn input_message(&self) -> Result<ToDevice, String> {
        inputs::message(&self.inputs)
    }

    pub(super) fn stalled(&self, now_ms: u64) -> bool {
        self.stall.iter().any(|window| window.holds(now_ms))
    }

    pub(super) fn is_cut(&self, now_ms: u64) -> bool {
        self.disconnect.iter().any(|window| window.holds(now_ms))
    }
}

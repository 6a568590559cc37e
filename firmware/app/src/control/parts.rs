//! Parts of the control plane's state.

use mortise_haptics::{Output, Vec3, Wrench};
use mortise_protocol::limits::MAX_ENCODERS;
use mortise_protocol::message::{DeviceState, Fault, Refusal, Statistics};

use crate::channel::Reply;
use crate::safety::Safety;
use crate::statistics::StateHash;

/// Ticks that run only when the host releases them.
#[derive(Default)]
pub(super) struct Lockstep {
    pub on: bool,
    /// Ticks still to run, and the sequence number of the message that released them.
    pub credit: u32,
    pub run_seq: u16,
}

/// Ticks between telemetry samples (0: none), and until the next.
#[derive(Default)]
pub(super) struct Sampling {
    pub every: u16,
    pub left: u16,
}

/// The recording of inputs.
#[derive(Default)]
pub(super) struct Recording {
    pub on: bool,
    /// Sequence number of the last command carried out in this session.
    pub carried_out: u16,
    /// Ticks lost since it was switched on.
    pub lost: u32,
}

/// The test of a motor under way, and the answer that waits for space.
#[derive(Default)]
pub(super) struct Testing {
    pub test: Option<Test>,
    pub answer: Option<(Origin, Reply)>,
}

/// Sequence number of the message that began the test of a motor, and its session.
pub(super) type Origin = (u16, u32);

/// The test of a motor.
pub(super) struct Test {
    pub origin: Origin,
    pub joint: u8,
    pub force: f32,
    /// Ticks so far, and those of the push once it has ended.
    pub ticks: u16,
    pub pushed: Option<u16>,
    pub far: bool,
    /// Counts each encoder moved during the push.
    pub moved: [i32; MAX_ENCODERS],
    /// Handle and counts at the start.
    pub start: (Vec3, [i32; MAX_ENCODERS]),
}

impl Testing {
    /// Ticks of the test under way; 0 without one.
    pub fn ticks(&self) -> u16 {
        self.test.as_ref().map_or(0, |test| test.ticks)
    }

    /// Ends a test that something else ended: the state that follows is the answer.
    pub fn interrupt(&mut self, state: DeviceState) {
        if let Some(test) = self.test.take() {
            self.answer = Some((test.origin, Reply::Refused(Refusal::State(state))));
        }
    }
}

/// What came late: ticks, and the host.
#[derive(Default)]
pub(super) struct Lateness {
    pub missed_total: u32,
    pub missed_in_row: u32,
    /// Frames heard from the host, and ticks since the last.
    pub heard: u32,
    pub silent_ticks: u32,
}

/// What the link plane last reported of the host.
#[derive(Default)]
pub(super) struct Host {
    pub stops: u32,
    pub session: u32,
    /// A restart was granted in this session.
    pub restarting: bool,
}

/// What was rendered in the last tick, and how it is faded in and out.
pub(super) struct Rendered {
    pub output: Option<Output>,
    pub commanded: Wrench,
    /// Ticks since the coupling's limit began to rise.
    pub ramp: u16,
    /// Ticks since the soft stop began, and the wrench at its start.
    pub fade: (u16, Wrench),
}

impl Rendered {
    /// Nothing yet.
    pub const NOTHING: Self = Self {
        output: None,
        commanded: Wrench::ZERO,
        ramp: 0,
        fade: (0, Wrench::ZERO),
    };
}

/// What is reported to the host.
pub(super) struct Reports {
    /// The state last reported.
    pub safety: Safety,
    /// A fault not yet reported, and its tick.
    pub fault: Option<(u32, Fault)>,
    pub statistics: Statistics,
    pub hash: StateHash,
    /// Of the last tick's cost, what the simulation of the mechanism took.
    pub simulated: u32,
}

impl Reports {
    /// From start.
    pub fn new() -> Self {
        Self {
            safety: Safety::Boot,
            fault: None,
            statistics: Statistics::default(),
            hash: StateHash::new(),
            simulated: 0,
        }
    }
}

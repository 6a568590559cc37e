//! Parts of the control plane's state.

use mortise_haptics::{Output, Wrench};
use mortise_protocol::message::{Fault, Statistics};

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

//! What passes between the two planes: bounded single-producer queues, an emergency stop counter, and nothing else.
//!
//! The link plane sends finished [`Command`]s; the control plane takes them at the start of a tick, in order, and answers each
//! with a [`Reply`]. Neither ever waits for the other.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use heapless::Vec;
use heapless::spsc::{Consumer, Producer, Queue};
use mortise_haptics::State as LawState;
use mortise_protocol::image::SceneImage;
use mortise_protocol::limits::MAX_INPUT_FAULTS;
use mortise_protocol::message::{
    ConstraintTarget, DeviceState, Fault, HandScript, InputFault, Refusal, Statistics, Telemetry,
};

use crate::parameters::ControlSettings;

/// Commands that may wait (the queue's length is one more than it holds).
pub const COMMANDS: usize = 8;
/// Events that may wait.
pub const EVENTS: usize = 32;
/// Telemetry samples that may wait.
pub const SAMPLES: usize = 8;
/// Most events one command or one tick can cause: a command is taken, and a tick run in lockstep, only when so many fit.
pub const EVENTS_AT_ONCE: usize = 8;

/// Link plane to control plane.
#[derive(Clone, Debug)]
pub struct Command<'s> {
    /// Sequence number of the message it came in; its reply carries it.
    pub seq: u16,
    /// [`Shared::stops`] when it was made: an older `Arm` or `ClearFault` must not undo a newer stop.
    pub stops: u32,
    /// [`Shared::sessions`] when it was made: what an earlier host asked for is dropped, unanswered.
    pub session: u32,
    /// What to do.
    pub kind: CommandKind<'s>,
}

/// What a command asks for. Everything in it has been checked as far as the link plane can.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "nothing to allocate from; eight of the largest are 5 kB"
)]
pub enum CommandKind<'s> {
    /// See [`mortise_protocol::message::ToDevice::Arm`].
    Arm,
    /// See [`mortise_protocol::message::ToDevice::Disarm`].
    Disarm,
    /// See [`mortise_protocol::message::ToDevice::ClearFault`].
    ClearFault,
    /// Take these settings.
    Settings(ControlSettings),
    /// Grab a part.
    Grab(u16),
    /// Let go.
    Release,
    /// Parts back to their places, hash and mechanism to their start.
    ResetScene,
    /// Set, refresh or replace a constraint target.
    SetTarget(ConstraintTarget),
    /// Let a constraint target fade.
    ClearTarget(u16),
    /// Use this scene, all checks passed. Answered by [`Event::SceneTaken`]; valid in every session.
    UseScene(SceneImage<'s>),
    /// The scene did not pass its check when read again: a fault. Not answered; valid in every session.
    SceneDamaged,
    /// Telemetry every so many ticks; 0: none.
    Telemetry(u16),
    /// Reply with statistics.
    Statistics {
        /// And start counting anew.
        reset: bool,
    },
    /// The handle stands in its reference pose.
    Home,
    /// Script for the simulated hand.
    Hand(HandScript),
    /// What goes wrong at the simulated inputs.
    InputFaults(Vec<InputFault, MAX_INPUT_FAULTS>),
    /// Lockstep on or off.
    Lockstep(bool),
    /// Release ticks; replied to by [`Reply::Ran`] after the last.
    Run(u32),
    /// May the board restart now?
    Restart,
}

/// Control plane to link plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A command is done.
    Reply {
        /// [`Command::seq`].
        seq: u16,
        /// [`Command::session`].
        session: u32,
        /// Outcome.
        reply: Reply,
    },
    /// The scene of [`CommandKind::UseScene`] is in use and the one before it dropped; or not.
    SceneTaken(Result<(), Refusal>),
    /// The state changed.
    State {
        /// When.
        tick: u32,
        /// To what.
        state: DeviceState,
    },
    /// Something went wrong.
    Fault {
        /// When.
        tick: u32,
        /// What.
        fault: Fault,
    },
}

/// Outcome of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply {
    /// Carried out.
    Done,
    /// Not carried out.
    Refused(Refusal),
    /// To [`CommandKind::Statistics`]; the link's own counters are still 0.
    Statistics(Statistics),
    /// To [`CommandKind::Run`].
    Ran {
        /// Ticks since start.
        tick: u32,
        /// See [`Statistics::state_hash`].
        state_hash: u64,
    },
}

/// Words both planes see at once.
#[derive(Debug)]
pub struct Shared {
    /// Stops asked for. Counted by the link, looked at in every tick before anything else.
    stops: AtomicU32,
    /// Hosts that greeted.
    sessions: AtomicU32,
    /// Sound frames heard.
    heard: AtomicU32,
    /// Telemetry samples dropped.
    dropped: AtomicU32,
    /// Motors may be driven.
    live: AtomicBool,
}

impl Shared {
    /// Stops asked for so far.
    pub fn stops(&self) -> u32 {
        self.stops.load(Ordering::Acquire)
    }

    /// Motors off at the next tick (or its next poll in lockstep), whatever waits in the queue. Safe from any context.
    pub fn stop(&self) {
        self.stops.fetch_add(1, Ordering::AcqRel);
    }

    /// Sessions begun so far.
    pub fn sessions(&self) -> u32 {
        self.sessions.load(Ordering::Acquire)
    }

    /// A host greeted: what an earlier one left running (armed, telemetry, lockstep) ends.
    pub fn begin_session(&self) {
        self.sessions.fetch_add(1, Ordering::AcqRel);
    }

    /// Frames heard so far.
    pub fn heard(&self) -> u32 {
        self.heard.load(Ordering::Relaxed)
    }

    /// A sound frame came.
    pub fn hear(&self) {
        self.heard.fetch_add(1, Ordering::Relaxed);
    }

    /// Samples dropped so far.
    pub fn dropped(&self) -> u32 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Whether motors may be driven now: ahead of the events that tell of it.
    pub fn live(&self) -> bool {
        self.live.load(Ordering::Acquire)
    }

    /// From the control plane, with every change of state.
    pub(crate) fn set_live(&self, live: bool) {
        self.live.store(live, Ordering::Release);
    }

    /// A sample found no room.
    pub fn drop_sample(&self) {
        self.dropped.fetch_add(1, Ordering::Relaxed);
    }
}

/// The memory of both planes: the queues between them, and the force law's state, which is too large to be moved about on a board's
/// stack. `'s`: how long the scene's flash lives.
#[derive(Debug)]
pub struct Channels<'s> {
    law: LawState,
    commands: Queue<Command<'s>, { COMMANDS + 1 }>,
    events: Queue<Event, { EVENTS + 1 }>,
    samples: Queue<Telemetry, { SAMPLES + 1 }>,
    shared: Shared,
}

impl Default for Channels<'_> {
    fn default() -> Self {
        Self::new()
    }
}

impl<'s> Channels<'s> {
    /// Empty. Tens of kB: keep it in a static or on the heap.
    pub const fn new() -> Self {
        Self {
            law: LawState::new(),
            commands: Queue::new(),
            events: Queue::new(),
            samples: Queue::new(),
            shared: Shared {
                stops: AtomicU32::new(0),
                sessions: AtomicU32::new(0),
                heard: AtomicU32::new(0),
                dropped: AtomicU32::new(0),
                live: AtomicBool::new(false),
            },
        }
    }

    /// Both ends; each may go to its own interrupt priority or thread.
    pub fn split(&mut self) -> (LinkEnds<'_, 's>, ControlEnds<'_, 's>) {
        let (commands_in, commands_out) = self.commands.split();
        let (events_in, events_out) = self.events.split();
        let (samples_in, samples_out) = self.samples.split();
        let shared = &self.shared;
        (
            LinkEnds {
                commands: commands_in,
                events: events_out,
                samples: samples_out,
                shared,
            },
            ControlEnds {
                law: &mut self.law,
                commands: commands_out,
                events: events_in,
                samples: samples_in,
                shared,
            },
        )
    }
}

/// The link plane's end.
pub struct LinkEnds<'c, 's> {
    pub(crate) commands: Producer<'c, Command<'s>>,
    pub(crate) events: Consumer<'c, Event>,
    pub(crate) samples: Consumer<'c, Telemetry>,
    /// Shared words.
    pub shared: &'c Shared,
}

/// The control plane's end.
pub struct ControlEnds<'c, 's> {
    pub(crate) law: &'c mut LawState,
    pub(crate) commands: Consumer<'c, Command<'s>>,
    pub(crate) events: Producer<'c, Event>,
    pub(crate) samples: Producer<'c, Telemetry>,
    /// Shared words.
    pub shared: &'c Shared,
}

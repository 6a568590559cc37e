//! What passes between the two planes: bounded single-producer queues, an emergency stop counter, and nothing else.
//!
//! The link plane sends finished [`Command`]s; the control plane takes them at the start of a tick, in order, and answers each
//! with a [`Reply`]. Neither ever waits for the other.

use portable_atomic::{AtomicBool, AtomicU32, Ordering};

use heapless::Vec;
use heapless::spsc::{Consumer, Producer, Queue};
use mortise_haptics::State as LawState;
use mortise_protocol::image::SceneImage;
use mortise_protocol::limits::MAX_INPUT_FAULTS;
use mortise_protocol::message::{
    ConstraintTarget, DeviceState, Fault, HandScript, InputFault, Refusal, Statistics, Telemetry,
};
use mortise_protocol::parameter::ParameterId;

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
    /// [`Shared::epoch`] when its message came: an older command must not undo a newer stop or fault.
    pub epoch: Epoch,
    /// [`Shared::sessions`] when it was made: what an earlier host asked for is dropped, unanswered, but for what is valid in every session.
    pub session: u32,
    /// What to do.
    pub kind: CommandKind<'s>,
}

/// What had turned the motors off for good so far: changes with every stop and every fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Epoch {
    /// [`Shared::stops`].
    pub stops: u32,
    /// [`Shared::halts`].
    pub halts: u32,
}

/// What a command asks for. Everything in it has been checked as far as the link plane can.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "nothing to allocate from; eight of the largest are 5 kB"
)]
pub enum CommandKind<'s> {
    /// See [`mortise_protocol::message::ToDevice::Arm`]. Carries the number of the scene whose checksum was found right after the message came: the
    /// control plane arms that scene and no other.
    Arm(u32),
    /// See [`mortise_protocol::message::ToDevice::Disarm`].
    Disarm,
    /// See [`mortise_protocol::message::ToDevice::ClearFault`].
    ClearFault,
    /// Take these settings. Valid in every session, so that the link plane's copy of the parameters, from which the next settings are made, cannot
    /// differ from what is in force.
    Settings(ControlSettings),
    /// Reply with the parameter in force.
    Parameter(ParameterId),
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
    UseScene {
        /// The scene.
        image: SceneImage<'s>,
        /// Names it to [`CommandKind::Arm`].
        number: u32,
    },
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
    /// To [`CommandKind::Parameter`].
    Parameter {
        /// Which.
        id: ParameterId,
        /// In its unit.
        value: f32,
    },
    /// To [`CommandKind::Statistics`].
    Statistics {
        /// The link's own counters are still 0.
        statistics: Statistics,
        /// Counting starts anew.
        reset: bool,
    },
    /// To [`CommandKind::Restart`]: no motor is driven from here on until a new session begins.
    MayRestart,
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
    /// Stops and faults so far. Counted by the control plane.
    halts: AtomicU32,
    /// `Arm` commands dealt with. Counted by the control plane.
    arms: AtomicU32,
    /// Hosts that greeted.
    sessions: AtomicU32,
    /// Sound frames heard.
    heard: AtomicU32,
    /// Telemetry samples dropped.
    dropped: AtomicU32,
    /// Motors may be driven.
    live: AtomicBool,
    /// Flash may be written.
    storing: AtomicBool,
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

    /// Times the motors went off, or began to fade, by a stop or a fault.
    pub fn halts(&self) -> u32 {
        self.halts.load(Ordering::Acquire)
    }

    /// From the control plane, with every such change of state.
    pub(crate) fn halt(&self) {
        self.halts.fetch_add(1, Ordering::AcqRel);
    }

    /// What has turned the motors off so far.
    pub fn epoch(&self) -> Epoch {
        Epoch {
            stops: self.stops(),
            halts: self.halts(),
        }
    }

    /// `Arm` commands dealt with so far, whatever came of them.
    pub fn arms(&self) -> u32 {
        self.arms.load(Ordering::Acquire)
    }

    /// From the control plane, behind each of them.
    pub(crate) fn count_arm(&self) {
        self.arms.fetch_add(1, Ordering::AcqRel);
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
        self.live.store(live, Ordering::SeqCst);
    }

    /// From the control plane, before motors are driven: `false` when flash may be written.
    ///
    /// Each plane first says what it wants and then looks at the other's word (Dekker's way, sequentially consistent), so both cannot get theirs.
    pub(crate) fn claim_motors(&self) -> bool {
        self.live.store(true, Ordering::SeqCst);
        let free = !self.storing.load(Ordering::SeqCst);
        if !free {
            self.live.store(false, Ordering::SeqCst);
        }
        free
    }

    /// From the link plane, before flash is written: `false` when motors may be driven. Holds until [`Self::release_flash`].
    pub(crate) fn claim_flash(&self) -> bool {
        self.storing.store(true, Ordering::SeqCst);
        let free = !self.live.load(Ordering::SeqCst);
        if !free {
            self.storing.store(false, Ordering::SeqCst);
        }
        free
    }

    /// Whether flash may be written now.
    pub fn storing(&self) -> bool {
        self.storing.load(Ordering::Acquire)
    }

    /// From the link plane: flash is not written any more.
    pub(crate) fn release_flash(&self) {
        self.storing.store(false, Ordering::SeqCst);
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
                halts: AtomicU32::new(0),
                arms: AtomicU32::new(0),
                sessions: AtomicU32::new(0),
                heard: AtomicU32::new(0),
                dropped: AtomicU32::new(0),
                live: AtomicBool::new(false),
                storing: AtomicBool::new(false),
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

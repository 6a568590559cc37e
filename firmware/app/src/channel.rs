//! All communication between the two planes: bounded single-producer queues and a few shared atomics, among them the emergency stop counter.
//!
//! The link plane sends finished [`Command`]s; the control plane takes them at the start of a tick, in order, and answers each
//! with a [`Reply`]. Neither ever waits for the other.

use portable_atomic::{AtomicBool, AtomicU32, Ordering};

use heapless::Vec;
use heapless::spsc::{Consumer, Producer, Queue};
use mortise_haptics::{Pose, State as LawState};
use mortise_protocol::image::SceneImage;
use mortise_protocol::limits::MAX_INPUT_FAULTS;
use mortise_protocol::message::{
    ConstraintTarget, DeviceState, Fault, HandScript, InputFault, MotorTest, Readings, Refusal, Statistics,
    Telemetry, TickInput,
};
use mortise_protocol::parameter::ParameterId;

use crate::parameters::ControlSettings;

/// Capacity of the command queue (its length is one more than it holds).
pub const COMMANDS: usize = 8;
/// Capacity of the event queue.
pub const EVENTS: usize = 32;
/// Capacity of the telemetry queue.
pub const SAMPLES: usize = 8;
/// Capacity of the queue of recorded inputs: the link plane may be busy for 32 ms before a tick is lost.
pub const RECORDED: usize = 32;
/// Most events one command or one tick can cause: a command is taken, and a lockstep tick run, only when the event queue has that much space left.
pub const EVENTS_AT_ONCE: usize = 8;

/// Link plane to control plane.
#[derive(Clone, Debug)]
pub struct Command<'s> {
    /// Sequence number of the message that carried the command; its reply carries it too.
    pub seq: u16,
    /// [`Shared::epoch`] when the message arrived: an older command must not undo a newer stop or fault.
    pub epoch: Epoch,
    /// [`Shared::sessions`] when the command was made: commands of an earlier session are dropped unanswered, except those valid in every session.
    pub session: u32,
    /// What to do.
    pub kind: CommandKind<'s>,
}

/// Stops and faults so far that turned the motors off until cleared: changes with each of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Epoch {
    /// [`Shared::stops`].
    pub stops: u32,
    /// [`Shared::halts`].
    pub halts: u32,
}

/// What a command requests. The link plane has checked all of it that it can.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "nothing to allocate from; eight of the largest are 5 kB"
)]
pub enum CommandKind<'s> {
    /// See [`mortise_protocol::message::ToDevice::Arm`]. Carries the number of the scene whose checksum was verified after the message arrived: the
    /// control plane arms that scene and no other.
    Arm(u32),
    /// See [`mortise_protocol::message::ToDevice::Disarm`].
    Disarm,
    /// See [`mortise_protocol::message::ToDevice::ClearFault`].
    ClearFault,
    /// Use these settings. Valid in every session, so that the link plane's copy of the parameters, from which the next settings are made, cannot
    /// differ from those in force.
    Settings(ControlSettings),
    /// Reply with the parameter in force.
    Parameter(ParameterId),
    /// Grab a part.
    Grab(u16),
    /// Let go.
    Release,
    /// Reset the parts to their places, and the hash and the mechanism to their initial state.
    ResetScene,
    /// Set, refresh or replace a constraint target.
    SetTarget(ConstraintTarget),
    /// Let a constraint target fade.
    ClearTarget(u16),
    /// Use this scene, all checks passed. Answered by [`Event::SceneTaken`]; valid in every session.
    UseScene {
        /// The checked image.
        image: SceneImage<'s>,
        /// Identifies the scene in [`CommandKind::Arm`].
        number: u32,
    },
    /// The scene failed its check when read again: a fault. Not answered; valid in every session.
    SceneDamaged,
    /// Telemetry period in ticks; 0: none.
    Telemetry(u16),
    /// Reply with statistics.
    Statistics {
        /// Reset the counters afterwards.
        reset: bool,
    },
    /// The handle is in its reference pose.
    Home,
    /// Script for the operator model.
    Hand(HandScript),
    /// Faults to inject at the simulated inputs.
    InputFaults(Vec<InputFault, MAX_INPUT_FAULTS>),
    /// Lockstep on or off.
    Lockstep(bool),
    /// Release this many lockstep ticks; answered by [`Reply::Ran`] after the last.
    Run(u32),
    /// Ask whether the board may restart now.
    Restart,
    /// Report the inputs of every tick, or no longer.
    RecordInputs(bool),
    /// Reply with the readings of encoders and safety inputs.
    Readings,
    /// Test a motor; answered by [`Reply::Tested`] at the end of the test.
    TestMotor {
        /// Joint, from 0.
        joint: u8,
        /// Force at the handle at the push's peak, N.
        force: f32,
    },
    /// Put a part at a pose.
    Place {
        /// Index in the scene.
        part: u16,
        /// Its new pose.
        pose: Pose,
    },
}

/// Inputs of a tick, for a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recorded {
    /// [`Shared::sessions`] at the tick; of another session it is not sent.
    pub session: u32,
    /// Ticks since start, this one included.
    pub tick: u32,
    /// Ticks lost since the recording began.
    pub lost: u32,
    /// See [`mortise_protocol::message::Inputs::count`].
    pub count: [f32; 2],
    /// The inputs.
    pub input: TickInput,
}

/// Control plane to link plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A command was processed.
    Reply {
        /// [`Command::seq`].
        seq: u16,
        /// [`Command::session`].
        session: u32,
        /// Outcome.
        reply: Reply,
    },
    /// The scene of [`CommandKind::UseScene`] is in use and the previous one dropped; or the reason why not.
    SceneTaken(Result<(), Refusal>),
    /// The state changed.
    State {
        /// Tick of the change.
        tick: u32,
        /// The new state.
        state: DeviceState,
    },
    /// A fault occurred.
    Fault {
        /// Tick of the fault.
        tick: u32,
        /// The fault.
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
    /// Answer to [`CommandKind::Parameter`].
    Parameter {
        /// Which parameter.
        id: ParameterId,
        /// Value in its unit.
        value: f32,
    },
    /// Answer to [`CommandKind::Statistics`].
    Statistics {
        /// The counters; the link's own are still 0.
        statistics: Statistics,
        /// The counters were reset.
        reset: bool,
    },
    /// Answer to [`CommandKind::Restart`]: no motor is driven from here on until a new session begins.
    MayRestart,
    /// Answer to [`CommandKind::Readings`].
    Readings(Readings),
    /// Answer to [`CommandKind::TestMotor`].
    Tested(MotorTest),
    /// Answer to [`CommandKind::Run`].
    Ran {
        /// Ticks since start.
        tick: u32,
        /// See [`Statistics::state_hash`].
        state_hash: u64,
    },
}

/// Atomics shared by both planes.
#[derive(Debug)]
pub struct Shared {
    /// Stops requested. Incremented by the link, read in every tick before anything else.
    stops: AtomicU32,
    /// Stops and faults so far. Incremented by the control plane.
    halts: AtomicU32,
    /// Commands processed that can drive the motors: `Arm` and `TestMotor`. Incremented by the control plane.
    arms: AtomicU32,
    /// Sessions begun by a host's `Hello`.
    sessions: AtomicU32,
    /// Valid frames received.
    heard: AtomicU32,
    /// Telemetry samples dropped.
    dropped: AtomicU32,
    /// Motors may be driven.
    live: AtomicBool,
    /// Flash may be written.
    storing: AtomicBool,
}

impl Shared {
    /// Stops requested so far.
    pub fn stops(&self) -> u32 {
        self.stops.load(Ordering::Acquire)
    }

    /// Turns the motors off at the next tick (or its next poll in lockstep), regardless of queued commands. Safe from any context.
    pub fn stop(&self) {
        self.stops.fetch_add(1, Ordering::AcqRel);
    }

    /// Stops and faults so far: times the motors were turned off, or began to fade, for one of these reasons.
    pub fn halts(&self) -> u32 {
        self.halts.load(Ordering::Acquire)
    }

    /// Counts a stop or a fault. Called by the control plane with every such change of state.
    pub(crate) fn halt(&self) {
        self.halts.fetch_add(1, Ordering::AcqRel);
    }

    /// The current count of stops and halts, as a stamp for commands.
    pub fn epoch(&self) -> Epoch {
        Epoch {
            stops: self.stops(),
            halts: self.halts(),
        }
    }

    /// Commands to arm or to test a motor processed so far, whatever their outcome.
    pub fn arms(&self) -> u32 {
        self.arms.load(Ordering::Acquire)
    }

    /// Counts a command that can drive the motors. Called by the control plane after it was processed.
    pub(crate) fn count_arm(&self) {
        self.arms.fetch_add(1, Ordering::AcqRel);
    }

    /// Sessions begun so far.
    pub fn sessions(&self) -> u32 {
        self.sessions.load(Ordering::Acquire)
    }

    /// Begins a session: whatever an earlier one left active (armed, telemetry, lockstep) ends.
    pub fn begin_session(&self) {
        self.sessions.fetch_add(1, Ordering::AcqRel);
    }

    /// Valid frames received so far.
    pub fn heard(&self) -> u32 {
        self.heard.load(Ordering::Relaxed)
    }

    /// Counts a valid frame.
    pub fn hear(&self) {
        self.heard.fetch_add(1, Ordering::Relaxed);
    }

    /// Samples dropped so far.
    pub fn dropped(&self) -> u32 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Whether motors may be driven now; changes before the events that report it.
    pub fn live(&self) -> bool {
        self.live.load(Ordering::Acquire)
    }

    /// Called by the control plane with every change of state.
    pub(crate) fn set_live(&self, live: bool) {
        self.live.store(live, Ordering::SeqCst);
    }

    /// Claims the motors for the control plane before they are driven: `false` when flash may be written.
    ///
    /// Each plane first stores its claim and then loads the other's (Dekker's algorithm, sequentially consistent), so both cannot succeed.
    pub(crate) fn claim_motors(&self) -> bool {
        self.live.store(true, Ordering::SeqCst);
        let free = !self.storing.load(Ordering::SeqCst);
        if !free {
            self.live.store(false, Ordering::SeqCst);
        }
        free
    }

    /// Claims the flash for the link plane before it is written: `false` when motors may be driven. Holds until [`Self::release_flash`].
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

    /// Releases the link plane's claim of the flash.
    pub(crate) fn release_flash(&self) {
        self.storing.store(false, Ordering::SeqCst);
    }

    /// Counts a telemetry sample dropped because the queue was full.
    pub fn drop_sample(&self) {
        self.dropped.fetch_add(1, Ordering::Relaxed);
    }
}

/// The memory of both planes: the queues between them, and the force law's state, which is too large to be moved on a board's stack. `'s`: lifetime
/// of the scene's flash.
#[derive(Debug)]
pub struct Channels<'s> {
    law: LawState,
    commands: Queue<Command<'s>, { COMMANDS + 1 }>,
    events: Queue<Event, { EVENTS + 1 }>,
    samples: Queue<Telemetry, { SAMPLES + 1 }>,
    recorded: Queue<Recorded, { RECORDED + 1 }>,
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
            recorded: Queue::new(),
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

    /// Where in this memory the force law's state is, bytes: only a tick changes it.
    pub const LAW: core::ops::Range<usize> = {
        let first = core::mem::offset_of!(Self, law);
        first..first + size_of::<LawState>()
    };

    /// Both ends; each may be moved to its own interrupt priority or thread.
    pub fn split(&mut self) -> (LinkEnds<'_, 's>, ControlEnds<'_, 's>) {
        let (commands_in, commands_out) = self.commands.split();
        let (events_in, events_out) = self.events.split();
        let (samples_in, samples_out) = self.samples.split();
        let (recorded_in, recorded_out) = self.recorded.split();
        let shared = &self.shared;
        (
            LinkEnds {
                commands: commands_in,
                events: events_out,
                samples: samples_out,
                recorded: recorded_out,
                shared,
            },
            ControlEnds {
                law: &mut self.law,
                commands: commands_out,
                events: events_in,
                samples: samples_in,
                recorded: recorded_in,
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
    pub(crate) recorded: Consumer<'c, Recorded>,
    /// Shared words.
    pub shared: &'c Shared,
}

/// The control plane's end.
pub struct ControlEnds<'c, 's> {
    pub(crate) law: &'c mut LawState,
    pub(crate) commands: Consumer<'c, Command<'s>>,
    pub(crate) events: Producer<'c, Event>,
    pub(crate) samples: Producer<'c, Telemetry>,
    pub(crate) recorded: Producer<'c, Recorded>,
    /// Shared words.
    pub shared: &'c Shared,
}

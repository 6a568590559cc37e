//! The message table: all messages on the link, in one file.
//!
//! Every host message is answered by [`FromDevice::Ack`] or [`FromDevice::Refused`] with its sequence number, or by the value it queries.
//! [`ToDevice::Hello`] and [`FromDevice::Hello`] keep their place (variant 0) and layout in every version, so that two sides with no other common
//! message can still identify each other. SI units and radians; quaternions x, y, z, w; poses are frame-to-world.

use heapless::{String, Vec};
use postcard_schema::Schema;
use postcard_schema::key::Key;
use serde::{Deserialize, Serialize};

use crate::image::ImageError;
use crate::limits::*;
use crate::parameter::ParameterId;
use crate::rig::{Rig, RigFault};

/// Hash of the schemas of both message enums and of the bounds of their lists: any change to a message changes it.
pub const SCHEMA_HASH: u64 = schema_hash();

const fn schema_hash() -> u64 {
    let to = u64::from_le_bytes(Key::for_path::<ToDevice>("to").to_bytes());
    let from = u64::from_le_bytes(Key::for_path::<FromDevice>("from").to_bytes());
    // A list's schema does not contain its maximum length, but the other side cannot read a longer one.
    hash_bounds(to ^ from.rotate_left(32), &WIRE_BOUNDS)
}

/// Every bound that decides whether a message can be read.
const WIRE_BOUNDS: [usize; 9] = [
    MAX_MESSAGE,
    MAX_CHUNK,
    MAX_PAIRS,
    MAX_TARGET_PAIRS,
    MAX_KEYFRAMES,
    MAX_INPUT_FAULTS,
    MAX_LOG,
    MAX_NAME,
    MAX_JOINTS,
];

/// FNV-1a, 64 bit, one step for each number.
const fn hash_bounds(start: u64, bounds: &[usize]) -> u64 {
    let (mut hash, mut i) = (start, 0);
    while i < bounds.len() {
        hash = (hash ^ bounds[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        i += 1;
    }
    hash
}

/// Version of the sender. Frozen layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Version {
    /// [`SCHEMA_HASH`] of the sender.
    pub schema: u64,
    /// Major, minor, patch of the sender's release.
    pub release: [u16; 3],
}

impl Version {
    /// This build's version.
    pub const fn own() -> Self {
        Self {
            schema: SCHEMA_HASH,
            release: release(),
        }
    }
}

const fn release() -> [u16; 3] {
    const fn number(digits: &str) -> u16 {
        let bytes = digits.as_bytes();
        let (mut value, mut i) = (0u16, 0);
        while i < bytes.len() {
            value = value * 10 + (bytes[i] - b'0') as u16;
            i += 1;
        }
        value
    }
    [
        number(env!("CARGO_PKG_VERSION_MAJOR")),
        number(env!("CARGO_PKG_VERSION_MINOR")),
        number(env!("CARGO_PKG_VERSION_PATCH")),
    ]
}

/// Host to board. Messages that [must be fresh](ToDevice::must_be_fresh) need a stamp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum ToDevice {
    /// First message, always answered by [`FromDevice::Hello`]. When the schemas differ, both sides stop there, each with the other's version.
    Hello(Version),
    /// Request [`FromDevice::Capabilities`].
    GetCapabilities,
    /// Allow the motors to be driven. Refused without a scene, in a fault, or with stop pressed.
    Arm,
    /// Motors off, object released.
    Disarm,
    /// Motors off immediately; they stay off until [`ToDevice::ClearFault`].
    Stop,
    /// Leave the stopped or faulted state when its cause is gone.
    ClearFault,
    /// The handle is in its reference pose: incremental encoders count from here. Only while the motors are off.
    Home,
    /// Keeps the link alive; any other message does too.
    Heartbeat,
    /// Change a parameter; refused outside its range.
    SetParameter {
        /// Parameter to change.
        id: ParameterId,
        /// New value, in its unit.
        value: f32,
    },
    /// Query a parameter; answered by [`FromDevice::Parameter`].
    GetParameter(ParameterId),
    /// Couple the handle to a part.
    Grab {
        /// Index in the scene.
        part: u16,
    },
    /// Let go; the part stays where it is.
    Release,
    /// Reset every part to its place in the scene, with nothing grabbed. Only while disarmed.
    ResetScene,
    /// Start an upload of a scene. Only while disarmed. The scene in use stays until commit.
    SceneBegin {
        /// Size of the image in bytes.
        length: u32,
        /// CRC-32/ISO-HDLC of the whole image.
        crc: u32,
        /// Layout version of the image.
        layout: u32,
    },
    /// The next bytes. `offset` must continue after the last chunk; a repetition of the last accepted chunk is acknowledged again.
    SceneChunk {
        /// Bytes from the image's start.
        offset: u32,
        /// At most [`MAX_CHUNK`].
        data: Vec<u8, MAX_CHUNK>,
    },
    /// Check the whole upload and put it in use, atomically.
    SceneCommit,
    /// Discard the upload.
    SceneAbort,
    /// Set, refresh or replace a constraint target.
    SetTarget(ConstraintTarget),
    /// Remove a constraint target.
    ClearTarget {
        /// Its id.
        id: u16,
    },
    /// Send telemetry every `every_ticks` ticks; 0 stops it.
    SetTelemetry {
        /// Ticks between messages.
        every_ticks: u16,
    },
    /// Query [`FromDevice::Statistics`].
    GetStatistics {
        /// Reset the counters after the answer.
        reset: bool,
    },
    /// Script for the simulated operator's hand (simulated mechanisms only); its time starts at the tick that takes it.
    SimulatedHand(HandScript),
    /// Faults at the inputs of a simulated mechanism, and their times (simulated mechanisms only); replaces an earlier list. Its time starts at the
    /// tick that takes it.
    SimulatedInputs(Vec<InputFault, MAX_INPUT_FAULTS>),
    /// Lockstep on or off (simulated mechanisms only): when on, a tick runs only when released by [`ToDevice::Run`].
    Lockstep(bool),
    /// Release ticks in lockstep; answered by [`FromDevice::Ran`] after the last.
    Run {
        /// Number of ticks.
        ticks: u32,
    },
    /// Restart the board. Refused while armed.
    Restart,
    /// Store this description of the rig; it takes effect at the next start. Only while disarmed, and only on boards whose mechanism is not compiled
    /// in.
    SetRig(Rig),
    /// Query [`FromDevice::Rig`].
    GetRig,
}

impl ToDevice {
    /// Whether the message is executed only once, in its own session and in the order sent: its frame must carry a [stamp](crate::frame::Stamp) whose
    /// count is greater than that of every such message before. This applies to messages that bring the motors nearer to being driven, or change what
    /// drives them. Messages that stop or query need no stamp.
    pub const fn must_be_fresh(&self) -> bool {
        match self {
            Self::Arm
            | Self::ClearFault
            | Self::Home
            | Self::SetParameter { .. }
            | Self::Grab { .. }
            | Self::SceneBegin { .. }
            | Self::SceneCommit
            | Self::Restart
            | Self::SetRig(_) => true,
            Self::Hello(_)
            | Self::GetCapabilities
            | Self::Disarm
            | Self::Stop
            | Self::Heartbeat
            | Self::GetParameter(_)
            | Self::Release
            | Self::ResetScene
            | Self::SceneChunk { .. }
            | Self::SceneAbort
            // A target carries its own number, which increases with every message about it.
            | Self::SetTarget(_)
            | Self::ClearTarget { .. }
            | Self::SetTelemetry { .. }
            | Self::GetStatistics { .. }
            | Self::SimulatedHand(_)
            | Self::SimulatedInputs(_)
            | Self::Lockstep(_)
            | Self::Run { .. }
            | Self::GetRig => false,
        }
    }
}

/// Board to host.
#[expect(
    clippy::large_enum_variant,
    reason = "nothing to allocate from; one is made at a time, and most are telemetry"
)]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum FromDevice {
    /// Answer to Hello: the board's version.
    Hello(Version),
    /// Capabilities of the board.
    Capabilities(Capabilities),
    /// The message was executed.
    Ack {
        /// Sequence number of the message.
        seq: u16,
    },
    /// The message was not executed.
    Refused {
        /// Sequence number of the message.
        seq: u16,
        /// Reason of the refusal.
        reason: Refusal,
    },
    /// A parameter's value.
    Parameter {
        /// Parameter.
        id: ParameterId,
        /// Value, in its unit.
        value: f32,
    },
    /// The state changed.
    State {
        /// Tick of the change.
        tick: u32,
        /// The new state.
        state: DeviceState,
    },
    /// One sample of the loop.
    Telemetry(Telemetry),
    /// Counters.
    Statistics(Statistics),
    /// A fault occurred; motors are off or going off.
    Fault {
        /// Tick of its detection.
        tick: u32,
        /// Kind of fault.
        fault: Fault,
    },
    /// Bytes of defmt log.
    Log(Vec<u8, MAX_LOG>),
    /// The lockstep ticks are done.
    Ran {
        /// Ticks since start.
        tick: u32,
        /// See [`Statistics::state_hash`].
        state_hash: u64,
    },
    /// The rig's description.
    Rig {
        /// The stored description; `None`: none was sent, or the stored one is damaged.
        rig: Option<Rig>,
        /// Whether it is in effect; otherwise it takes effect at the next start.
        in_use: bool,
    },
}

/// Capabilities of a board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Capabilities {
    /// Board name.
    pub board: String<MAX_NAME>,
    /// Largest scene image that fits, bytes.
    pub scene_capacity: u32,
    /// Layout version it reads.
    pub scene_layout: u32,
    /// CRC of the scene in use; `None` without one.
    pub scene: Option<u32>,
    /// Ticks per second.
    pub tick_hz: u16,
    /// Number of handle axes that the board can drive with force.
    pub force_axes: u8,
    /// Number of handle axes that the board can drive with torque.
    pub torque_axes: u8,
    /// Whether mechanism and hand are simulated on the board.
    pub simulated: bool,
    /// Unit of tick costs.
    pub cost_unit: CostUnit,
    /// Limit of a tick's cost, in `cost_unit`; 0 when there is no deadline.
    pub cost_budget: u32,
    /// Largest number of constraint targets evaluated at the same time; 0: none.
    pub max_targets: u8,
    /// Reason of the last start.
    pub reset: ResetReason,
    /// Its state.
    pub state: DeviceState,
    /// Identifies this session; the host's [stamps](crate::frame::Stamp) carry it. Different in every session and after every start.
    pub session: u32,
}

/// Unit of tick costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum CostUnit {
    /// Instructions (emulated board in counted mode; otherwise its host's time).
    Instructions,
    /// Processor cycles.
    Cycles,
    /// Nanoseconds.
    Nanoseconds,
}

/// Why the board started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ResetReason {
    /// Power or reset button.
    PowerOn,
    /// [`ToDevice::Restart`].
    Requested,
    /// The watchdog was not fed.
    Watchdog,
    /// The firmware panicked; the line is in the panicking file.
    Panic {
        /// Source line.
        line: u32,
    },
    /// The processor raised a fault from which it could not continue, such as a bad access or a stack overflow.
    HardFault {
        /// Address of the instruction; 0 when it could not be read.
        pc: u32,
    },
    /// Supply too low.
    BrownOut,
    /// The board cannot determine the reason.
    Unknown,
}

/// State of the safety state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum DeviceState {
    /// Starting; motors off.
    Boot,
    /// Motors off; the encoders have no reference until [`ToDevice::Home`].
    Homing,
    /// Motors off, waiting.
    Idle,
    /// Motors on, nothing grabbed: zero wrench.
    Armed,
    /// A part is grabbed and felt.
    Active,
    /// Ramping to zero wrench under damping, then off.
    SoftStop,
    /// Motors off until cleared.
    Stopped,
    /// Motors off until the cause is gone and the fault is cleared.
    Fault(Fault),
}

/// Declares [`Fault`] and, from the same list, every variant of it.
macro_rules! faults {
    ($(#[$about:meta])+ pub enum Fault {
        $($(#[$doc:meta])+ $name:ident $({ $(#[$field_doc:meta])+ $field:ident: $type:ty, })?,)+
    }) => {
        $(#[$about])+
        pub enum Fault {
            $($(#[$doc])+ $name $({ $(#[$field_doc])+ $field: $type })?,)+
        }

        impl Fault {
            /// Number of kinds.
            pub const COUNT: usize = [$(stringify!($name)),+].len();

            /// One fault of every kind, in the order of the enum; those with an axis or a time have `number` there.
            pub const fn every(number: u16) -> [Self; Self::COUNT] {
                [$(Self::$name $({ $field: number as $type })?),+]
            }
        }
    };
}

faults! {
    /// Kind of fault.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
    pub enum Fault {
        /// The stop input is open.
        StopInput,
        /// No message from the host for too long while armed.
        HostSilent {
            /// Time since the last message, ms.
            silent_ms: u16,
        },
        /// An encoder reading jumped farther than the mechanism can move in a tick.
        EncoderJump {
            /// Axis.
            axis: u8,
        },
        /// An encoder did not follow a small push of its motor: it is stuck or unplugged, or the mechanism is jammed.
        EncoderStuck {
            /// Axis.
            axis: u8,
        },
        /// The handle moves faster than allowed.
        OverSpeed,
        /// The handle left the workspace.
        Workspace,
        /// A motor driver reports a fault without its kind.
        Driver {
            /// Axis.
            axis: u8,
        },
        /// A motor driver reports overcurrent.
        OverCurrent {
            /// Axis.
            axis: u8,
        },
        /// A motor or its driver is too hot.
        OverTemperature {
            /// Axis.
            axis: u8,
        },
        /// The supply fell below the needs of motors and sensors; the processor still runs.
        SupplyLow,
        /// A tick took longer than its period.
        TickOverrun,
        /// The scene no longer passes its checks.
        SceneDamaged,
        /// The computed wrench is not finite.
        NonFinite,
        /// The handle turns faster than allowed.
        AngularOverSpeed,
        /// The encoders have lost their reference, although none of them jumped.
        ReferenceLost,
        /// The encoders give a position that the links cannot reach.
        ImpossiblePosture,
        /// A sensor reading is not finite, or implausible.
        BadReading,
    }
}

/// Why a message was not executed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Refusal {
    /// A Hello with this schema must come first.
    NotGreeted,
    /// Not possible in this state.
    State(DeviceState),
    /// No scene on the board: upload one.
    NoScene,
    /// No such part in the scene.
    NoSuchPart {
        /// Parts in the scene.
        parts: u16,
    },
    /// The part is fixed.
    NotGrabbable,
    /// Outside its range, or not a number.
    OutOfRange {
        /// Parameter.
        id: ParameterId,
        /// Smallest accepted.
        min: f32,
        /// Largest accepted.
        max: f32,
    },
    /// The chunk does not continue after the last one.
    ChunkOrder {
        /// Offset expected.
        expected: u32,
    },
    /// No upload in progress.
    NoUpload,
    /// More bytes than the slot holds.
    SceneTooLarge {
        /// Bytes that fit.
        capacity: u32,
    },
    /// More parts than the board holds.
    TooManyParts {
        /// Parts that fit.
        capacity: u16,
    },
    /// The upload is not complete.
    SceneIncomplete {
        /// Bytes received.
        received: u32,
    },
    /// The checksum of the received image is not the announced one.
    SceneCrc {
        /// Checksum announced.
        expected: u32,
        /// Checksum as stored.
        found: u32,
    },
    /// Not a scene image.
    SceneImage(ImageError),
    /// Flash could not be erased or written.
    Flash,
    /// Only for simulated mechanisms.
    NotSimulated,
    /// Not in lockstep, or ticks are still pending.
    Lockstep,
    /// A number that is not finite or not possible.
    BadNumber,
    /// The board's queue is full: try again.
    Busy,
    /// The frame was valid but its message is unknown in this version.
    Undecodable,
    /// The description of the rig cannot be used.
    Rig(RigFault),
    /// This board's mechanism is compiled into its firmware.
    RigFixed,
    /// The board has no sound description of its rig in use: none was sent, or it is damaged or of another release.
    RigDamaged,
    /// The command carries no stamp of this session, or one already seen, or the board has stopped or faulted since it arrived.
    Outdated,
}

/// A rigid pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct WirePose {
    /// Position, m.
    pub position: [f32; 3],
    /// Unit quaternion x, y, z, w.
    pub orientation: [f32; 4],
}

/// Force and torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct WireWrench {
    /// Force, N.
    pub force: [f32; 3],
    /// Torque, N·m.
    pub torque: [f32; 3],
}

/// Two faces that touch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct TouchingPair {
    /// Face of the grabbed part, [`crate::image::NO_FACE`] when unknown.
    pub moving_face: u16,
    /// Index of the other part.
    pub static_part: u16,
    /// Face of the other part.
    pub static_face: u16,
    /// The grabbed part's other face where the deepest point lies on an edge, else [`crate::image::NO_FACE`].
    pub moving_edge_face: u16,
    /// The same for the other part.
    pub static_edge_face: u16,
    /// Points in contact.
    pub count: u16,
    /// Deepest penetration, m.
    pub depth: f32,
    /// Position of the deepest point, world, m.
    pub point: [f32; 3],
    /// Insertion depth: reach of the touching points along the axis of the static face, or else of the moving one, m; 0 if neither is round. Faces
    /// kept apart by guidance do not touch and have none.
    pub insertion: f32,
}

/// One sample of the loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Telemetry {
    /// Ticks since start.
    pub tick: u32,
    /// Handle pose.
    pub handle: WirePose,
    /// Grabbed part: its index and its shape's pose.
    pub object: Option<(u16, WirePose)>,
    /// Wrench commanded to the handle.
    pub wrench: WireWrench,
    /// Contact wrench on the object about its centre of mass.
    pub contact: WireWrench,
    /// Wrench of the simulated hand on the handle, if the hand is simulated.
    pub hand: Option<WireWrench>,
    /// Cost of this tick, see [`Capabilities::cost_unit`].
    pub cost: u32,
    /// Number of points queried.
    pub points: u16,
    /// Bits of [`Flags`].
    pub flags: u16,
    /// Ticks missed since start.
    pub missed: u32,
    /// Telemetry messages dropped since start because the link was slower.
    pub dropped: u32,
    /// State of the constraint targets.
    pub guidance: Guidance,
    /// Touching face pairs, deepest first.
    pub pairs: Vec<TouchingPair, MAX_PAIRS>,
}

/// State of the constraint targets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Guidance {
    /// Number of targets in force, without those that fade.
    pub active: u8,
    /// Number of those that act as joints: the part is so near to its target that the mating faces cannot touch, and they are excluded from contact.
    pub joints: u8,
    /// Largest engagement of all targets, 0 to 1.
    pub engagement: f32,
    /// Total wrench of the targets on the object, about its centre of mass.
    pub wrench: WireWrench,
}

/// Set of conditions of a tick, as the force law raises them, the board adds to them, and [`Telemetry::flags`] carries them.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Flags(u16);

/// A flag with what is said about it.
#[derive(Clone, Copy, Debug)]
pub struct FlagRow {
    /// The flag.
    pub flag: Flags,
    /// Name in the message table.
    pub name: &'static str,
    /// When it is set, a sentence.
    pub meaning: &'static str,
    /// Text in the window.
    pub words: &'static str,
}

/// Declares every flag with its meaning (the first line of its documentation), bit and words.
macro_rules! flags {
    ($(#[doc = $meaning:literal] $(#[doc = $detail:literal])* $name:ident = $bit:literal, $words:literal;)+) => {
        impl Flags {
            $(#[doc = $meaning] $(#[doc = $detail])* pub const $name: Self = Self(1 << $bit);)+

            /// Every flag, most important first.
            pub const ALL: &[FlagRow] = &[$(FlagRow {
                flag: Self::$name,
                name: stringify!($name),
                meaning: $meaning.trim_ascii(),
                words: $words,
            },)+];
        }
    };
}

flags! {
    /// A computed number was not finite: the wrench is zero.
    ///
    /// The object stays where it was.
    NON_FINITE = 4, "the computed force was not finite";
    /// A sensor reading was not finite or implausible.
    ///
    /// Out of range, or not a rotation: zero wrench, and nothing moved.
    BAD_INPUT = 13, "a sensor reading was not a number or out of proportion";
    /// The force limit acted.
    FORCE_LIMIT = 1, "force limit acts";
    /// The torque limit acted.
    TORQUE_LIMIT = 2, "torque limit acts";
    /// The limit on the change of force acted.
    FORCE_SLEW = 3, "limit on change of force acts";
    /// The limit on the change of torque acted.
    TORQUE_SLEW = 14, "limit on change of torque acts";
    /// The coupling slipped at its largest force.
    COUPLING_FORCE = 7, "the coupling slips: force";
    /// The coupling slipped at its largest torque.
    COUPLING_TORQUE = 12, "the coupling slips: torque";
    /// The part's speed was limited to its maximum, or to the search margin.
    SPEED_LIMIT = 9, "speed limit acts";
    /// The handle's wrench is damped because the loop generated energy.
    SOFTENED = 8, "damped for stability";
    /// A point is too deep inside for the field to give a way out.
    ///
    /// The point does not push.
    DEEP = 10, "penetration too deep";
    /// The step's touching points had not come to rest.
    ///
    /// Their set still changed in the last solve allowed.
    UNSETTLED = 11, "contacts had not settled";
    /// The point budget was reached: some points were not queried this tick.
    ///
    /// Points are decimated evenly; when that is not enough, the rest waits for the next ticks. Points that touched stay felt.
    BUDGET = 0, "point budget reached";
    /// More contacts than the board stores.
    ///
    /// Kept are the deepest candidates, and of the rest those that a rotation would bring to touch first. If more touch than fit, points are
    /// decimated evenly from the next tick on ([`Self::BUDGET`]).
    CONTACTS = 6, "more contacts than fit";
    /// More face pairs touch than the message holds.
    ///
    /// Added by the board's control plane; the force law raises all others.
    PAIRS = 5, "more touching faces than are shown";
}

impl Flags {
    /// None.
    pub const fn empty() -> Self {
        Self(0)
    }

    /// As sent in telemetry.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// From telemetry; unknown bits are kept.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// Whether all of `other` are set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether any of `other` is set.
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Sets all of `other`.
    pub const fn insert(&mut self, other: Self) {
        self.0 |= other.0;
    }

    /// Sets all of `other` when `condition` holds.
    pub const fn insert_if(&mut self, condition: bool, other: Self) {
        if condition {
            self.insert(other);
        }
    }

    /// Rows of the flags that are set, most important first.
    pub fn rows(self) -> impl Iterator<Item = &'static FlagRow> {
        (Self::ALL.iter()).filter(move |row| self.contains(row.flag))
    }
}

impl core::fmt::Debug for Flags {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_set().entries(self.rows().map(|row| row.name)).finish()
    }
}

/// Counters since start or the last reset of the counters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Statistics {
    /// Ticks run.
    pub ticks: u32,
    /// Ticks missed.
    pub missed_ticks: u32,
    /// Largest cost of a tick.
    pub cost_max: u32,
    /// Sum of costs.
    pub cost_sum: u64,
    /// Largest force commanded, N.
    pub peak_force: f32,
    /// Largest torque commanded, N·m.
    pub peak_torque: f32,
    /// Most points queried in a tick.
    pub points_max: u32,
    /// FNV-1a over the bits of handle pose, object pose and twist, and wrench of every tick since the scene was loaded or reset.
    pub state_hash: u64,
    /// Frames received whole.
    pub frames: u32,
    /// Frames discarded: damaged, too long, or undecodable.
    pub bad_frames: u32,
    /// Messages discarded because there was no space for their answer: the host does not read.
    pub unanswered: u32,
    /// Telemetry messages dropped.
    pub dropped: u32,
    /// Largest stack depth seen, bytes; 0 where not measured.
    pub stack_max: u32,
}

/// Declares [`ConstraintKind`] and, from the same list, every variant of it and its name.
macro_rules! constraint_kinds {
    ($(#[$about:meta])+ pub enum ConstraintKind { $($(#[$doc:meta])+ $name:ident = $word:literal,)+ }) => {
        $(#[$about])+
        pub enum ConstraintKind {
            $($(#[$doc])+ $name,)+
        }

        impl ConstraintKind {
            /// Every kind, in the order of the enum.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$name),+];

            /// Name of the kind. Both annular kinds have the same name: it does not say which part has the sphere.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $word,)+
                }
            }
        }
    };
}

constraint_kinds! {
    /// Kinds of constraint between a surface of the grabbed part and one of another part: the recogniser's, the link's and the force law's.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
    pub enum ConstraintKind {
        /// Axis on axis (cylinder in cylinder). Leaves a slide and a rotation.
        Concentric = "concentric",
        /// Plane on plane, face to face: turns the grabbed part until the planes are parallel; contact determines the distance. Leaves two slides and a
        /// rotation.
        Coplanar = "coplanar",
        /// Axis on axis and apex on apex, so that circles of one radius coincide (cone in cone). Leaves a rotation.
        Conical = "conical",
        /// Centre on centre (sphere in sphere). Leaves three rotations.
        Spherical = "spherical",
        /// Centre on axis: sphere of the grabbed part in a cylinder of the other. Leaves a slide and three rotations.
        Annular = "annular",
        /// Axis on centre: cylinder of the grabbed part over a sphere of the other. Leaves a slide and three rotations.
        AnnularBore = "annular",
    }
}

/// A point and a direction fixed to a part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Feature {
    /// Position, m, shape frame.
    pub point: [f32; 3],
    /// Unit vector, shape frame.
    pub direction: [f32; 3],
}

/// A constraint recognised by the desktop program, towards which the board guides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ConstraintTarget {
    /// Identifies the target; a message with the same id replaces or refreshes it.
    pub id: u16,
    /// Increases with every message about this id; a lower one is stale.
    pub sequence: u16,
    /// Kind.
    pub kind: ConstraintKind,
    /// Feature of the moving part.
    pub moving: Feature,
    /// Index of the mating part.
    pub static_part: u16,
    /// Feature of that part.
    pub fixed: Feature,
    /// Stiffness, N/m.
    pub stiffness: f32,
    /// Largest guidance force, N.
    pub force_cap: f32,
    /// Largest guidance torque, N·m.
    pub torque_cap: f32,
    /// The target fades out unless refreshed within this many ticks.
    pub expiry_ticks: u16,
    /// Moving and static faces whose contact the target replaces.
    pub faces: Vec<(u16, u16), MAX_TARGET_PAIRS>,
}

/// A simulated operator's hand: a spring-damper that pulls the handle towards a moving target, plus a push.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct HandScript {
    /// Stiffness, N/m.
    pub stiffness: f32,
    /// Damping, N·s/m.
    pub damping: f32,
    /// Angular stiffness, N·m/rad.
    pub angular_stiffness: f32,
    /// Angular damping, N·m·s/rad.
    pub angular_damping: f32,
    /// Amplitude of the tremor, m.
    pub tremor: f32,
    /// Frequency of the tremor, Hz.
    pub tremor_hz: f32,
    /// Target poses of the hand, times ascending; the first holds before its time and the last after its time, with linear interpolation between
    /// (orientation: shortest arc).
    pub keyframes: Vec<Keyframe, MAX_KEYFRAMES>,
}

/// One point of a hand's script.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Keyframe {
    /// Time since the script was taken, ticks (ms).
    pub tick: u32,
    /// Target of the handle.
    pub pose: WirePose,
    /// Force added to the spring's, N, world.
    pub push: [f32; 3],
}

/// A fault at the inputs of a simulated mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct InputFault {
    /// First tick (ms) since the message was taken.
    pub tick: u32,
    /// Duration in ticks; a glitch occurs once, regardless of this value.
    pub ticks: u32,
    /// Kind of fault.
    pub kind: InputFaultKind,
}

/// Faults at the inputs of a mechanism. Axes 0 to 2 are the handle's position, 3 to 5 its rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum InputFaultKind {
    /// An encoder's counter is off by `counts` from here on.
    EncoderGlitch {
        /// Axis.
        axis: u8,
        /// Offset in counts.
        counts: i32,
    },
    /// An encoder's counter stops.
    EncoderStuck {
        /// Axis.
        axis: u8,
    },
    /// The handle's position reads as NaN.
    NotANumber,
    /// A motor driver reports a fault without its kind.
    Driver {
        /// Axis.
        axis: u8,
    },
    /// A motor driver reports overcurrent.
    OverCurrent {
        /// Axis.
        axis: u8,
    },
    /// A motor driver reports overtemperature.
    OverTemperature {
        /// Axis.
        axis: u8,
    },
    /// The stop input is open.
    StopOpen,
    /// The supply is too low.
    SupplyLow,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_flag_has_a_bit_a_name_and_words_of_its_own() {
        for (i, row) in Flags::ALL.iter().enumerate() {
            assert_eq!(row.flag.bits().count_ones(), 1, "{}", row.name);
            assert!(row.meaning.ends_with('.') && !row.words.is_empty(), "{row:?}");
            for other in &Flags::ALL[..i] {
                assert!(!row.flag.intersects(other.flag), "{row:?}, {other:?}");
                assert!(
                    row.name != other.name && row.words != other.words,
                    "{row:?}, {other:?}"
                );
            }
        }
        assert_eq!(Flags::from_bits(u16::MAX).rows().count(), Flags::ALL.len());
        assert_eq!(Flags::empty().rows().count(), 0);
    }

    #[test]
    fn every_bound_counts_in_the_schema_hash() {
        let own = hash_bounds(1, &WIRE_BOUNDS);
        for i in 0..WIRE_BOUNDS.len() {
            let mut changed = WIRE_BOUNDS;
            changed[i] += 1;
            assert_ne!(hash_bounds(1, &changed), own, "bound {i}");
        }
    }
}

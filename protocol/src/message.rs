//! The message table: all messages on the link, in one file. Faults, flags and constraints, of which more than the link speaks, are in files of their own.
//!
//! Every host message is answered by [`FromDevice::Ack`] or [`FromDevice::Refused`] with its sequence number, or by the value it queries.
//! [`ToDevice::Hello`] and [`FromDevice::Hello`] keep their place (variant 0) and layout in every version, so that two sides with no other common
//! message can still identify each other. SI units and radians; quaternions x, y, z, w; poses are frame-to-world.

mod constraint;
mod fault;
mod flags;
mod inputs;
mod motor_test;
mod rigid;
mod simulated;

use heapless::{String, Vec};
use postcard_schema::Schema;
use postcard_schema::key::Key;
use serde::{Deserialize, Serialize};

use crate::image::ImageError;
use crate::limits::*;
use crate::parameter::ParameterId;
use crate::rig::{Rig, RigFault};

pub use self::constraint::{ConstraintKind, ConstraintTarget, Feature, Path, PathTurn};
pub use self::fault::Fault;
pub use self::flags::{FlagRow, Flags};
pub use self::inputs::{DriverReport, Inputs, TickInput};
pub use self::motor_test::{MotorTest, Readings};
pub use self::rigid::{WirePose, WireTwist, WireWrench};
pub use self::simulated::{HandScript, InputFault, InputFaultKind, Keyframe};

/// Hash of the schemas of both message enums and of the bounds of their lists: any change to a message changes it.
pub const SCHEMA_HASH: u64 = schema_hash();

const fn schema_hash() -> u64 {
    let to = u64::from_le_bytes(Key::for_path::<ToDevice>("to").to_bytes());
    let from = u64::from_le_bytes(Key::for_path::<FromDevice>("from").to_bytes());
    // A list's schema does not contain its maximum length, but the other side cannot read a longer one.
    hash_bounds(to ^ from.rotate_left(32), &WIRE_BOUNDS)
}

/// Every bound that decides whether a message can be read.
const WIRE_BOUNDS: [usize; 10] = [
    MAX_MESSAGE,
    MAX_CHUNK,
    MAX_PAIRS,
    MAX_TARGET_PAIRS,
    MAX_KEYFRAMES,
    MAX_INPUT_FAULTS,
    MAX_LOG,
    MAX_NAME,
    MAX_JOINTS,
    MAX_TICKS,
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
    /// Send the inputs of every tick as [`FromDevice::Inputs`], or no longer. Ends with the session.
    RecordInputs(bool),
    /// Query [`FromDevice::Readings`].
    GetReadings,
    /// Push with a single motor for a moment, to learn which encoder follows and in which sense. Only while idle;
    /// needs no scene. Answered by [`FromDevice::MotorTested`] when the motors are off again.
    TestMotor {
        /// Joint, from 0.
        joint: u8,
        /// Force at the handle at the push's peak, N: positive pushes the joint forward as its description says. Its size is within
        /// [`MOTOR_TEST_FORCE`].
        force: f32,
    },
    /// Put a part at a pose of its shape frame in the world. Only while disarmed. It stays there until it is moved, or [`ToDevice::ResetScene`].
    Place {
        /// Index in the scene; a fixed part may be placed too.
        part: u16,
        /// Its new pose.
        pose: WirePose,
    },
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
            | Self::SetRig(_)
            | Self::TestMotor { .. }
            | Self::Place { .. } => true,
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
            | Self::GetRig
            | Self::RecordInputs(_)
            | Self::GetReadings => false,
        }
    }
}

/// Board to host.
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
    /// Inputs of consecutive ticks.
    Inputs(Inputs),
    /// Readings of encoders and safety inputs.
    Readings(Readings),
    /// The motor was tested; it is off again.
    MotorTested(MotorTest),
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
    /// A single motor is tested.
    Testing,
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
    /// The mechanism has no such motor that can be tested.
    NoSuchMotor {
        /// Motors that can be tested; none without a description.
        motors: u8,
    },
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
    /// Cost of this tick, see [`Capabilities::cost_unit`]; without the simulation of a mechanism, which a real board does not run.
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

#[cfg(test)]
mod tests {
    use super::*;

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

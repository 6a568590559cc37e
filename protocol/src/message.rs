//! The message table: all that crosses the link, in one file.
//!
//! Every host message is answered by [`FromDevice::Ack`] or [`FromDevice::Refused`] carrying its sequence number, or by the
//! value it asks for. [`ToDevice::Hello`] and [`FromDevice::Hello`] keep their place (variant 0) and layout in every version, so that two sides
//! that share nothing else can still name each other. SI units and radians; quaternions x, y, z, w; poses are frame-to-world.

use heapless::{String, Vec};
use postcard_schema::Schema;
use postcard_schema::key::Key;
use serde::{Deserialize, Serialize};

use crate::image::ImageError;
use crate::limits::*;
use crate::parameter::ParameterId;
use crate::rig::{Rig, RigFault};

/// Hash of both message enums' schema and of the bounds they are read with: any change to a message changes it.
pub const SCHEMA_HASH: u64 = schema_hash();

const fn schema_hash() -> u64 {
    let to = u64::from_le_bytes(Key::for_path::<ToDevice>("to").to_bytes());
    let from = u64::from_le_bytes(Key::for_path::<FromDevice>("from").to_bytes());
    // A list's schema does not tell how long it may be, but a longer one cannot be read by the other side.
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

/// Who speaks. Frozen layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Version {
    /// [`SCHEMA_HASH`] of the speaker.
    pub schema: u64,
    /// Major, minor, patch of the speaker's release.
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

/// Host to board. Those that [must be fresh](ToDevice::must_be_fresh) need a stamp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum ToDevice {
    /// First message, always answered by [`FromDevice::Hello`]. When the schemas differ both sides stop there, able to name each other.
    Hello(Version),
    /// Ask for [`FromDevice::Capabilities`].
    GetCapabilities,
    /// Motors may be driven from here on. Refused without a scene, in a fault, or with stop pressed.
    Arm,
    /// Motors off, object released.
    Disarm,
    /// Motors off now; stays so until [`ToDevice::ClearFault`].
    Stop,
    /// Leave the stopped or faulted state when its cause is gone.
    ClearFault,
    /// The handle stands in its reference pose: encoders that only count motion start from here. Only while the motors are off.
    Home,
    /// Keeps the link alive; anything else does too.
    Heartbeat,
    /// Change a parameter; refused outside its range.
    SetParameter {
        /// Which.
        id: ParameterId,
        /// In its unit.
        value: f32,
    },
    /// Ask for a parameter; answered by [`FromDevice::Parameter`].
    GetParameter(ParameterId),
    /// Couple the handle to a part.
    Grab {
        /// Index in the scene.
        part: u16,
    },
    /// Let go; the part stays where it is.
    Release,
    /// Put every part back where the scene has it, nothing grabbed. Only while disarmed.
    ResetScene,
    /// Start sending a scene. Only while disarmed. The scene in use stays until commit.
    SceneBegin {
        /// Bytes to come.
        length: u32,
        /// CRC-32/ISO-HDLC of all of them.
        crc: u32,
        /// Layout version of the image.
        layout: u32,
    },
    /// The next bytes. `offset` must continue where the last one ended; the last accepted one again is acknowledged again.
    SceneChunk {
        /// Bytes from the image's start.
        offset: u32,
        /// At most [`MAX_CHUNK`].
        data: Vec<u8, MAX_CHUNK>,
    },
    /// Check all that came and put it in use, atomically.
    SceneCommit,
    /// Forget what came.
    SceneAbort,
    /// Set, refresh or replace a constraint target.
    SetTarget(ConstraintTarget),
    /// Take a constraint target away.
    ClearTarget {
        /// Its id.
        id: u16,
    },
    /// Telemetry every so many ticks; 0 stops it.
    SetTelemetry {
        /// Ticks between messages.
        every_ticks: u16,
    },
    /// Ask for [`FromDevice::Statistics`].
    GetStatistics {
        /// Start counting anew after answering.
        reset: bool,
    },
    /// Script for the simulated hand (simulated mechanisms only); its time starts at the tick that takes it.
    SimulatedHand(HandScript),
    /// What goes wrong at the inputs of a simulated mechanism, and when (simulated mechanisms only); replaces what was sent before. Its time starts
    /// at the tick that takes it.
    SimulatedInputs(Vec<InputFault, MAX_INPUT_FAULTS>),
    /// Lockstep on or off (simulated mechanisms only): on, a tick runs only when released by [`ToDevice::Run`].
    Lockstep(bool),
    /// Release ticks in lockstep; answered by [`FromDevice::Ran`] after the last.
    Run {
        /// How many.
        ticks: u32,
    },
    /// Restart the board. Refused while armed.
    Restart,
    /// Keep this description of the rig; in use from the next start on. Only while disarmed, and only by boards whose mechanism is not compiled in.
    SetRig(Rig),
    /// Ask for [`FromDevice::Rig`].
    GetRig,
}

impl ToDevice {
    /// Carried out only once, in its own session and in the order sent: the frame must carry a [stamp](crate::frame::Stamp) whose count is above that
    /// of every such message before. These are the messages that bring the motors nearer to being driven, or change what drives them. One that
    /// stops or asks needs none.
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
            // A target carries a number of its own that rises with every message about it.
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
    /// What the board can do.
    Capabilities(Capabilities),
    /// Done.
    Ack {
        /// Sequence number of the message.
        seq: u16,
    },
    /// Not done.
    Refused {
        /// Sequence number of the message.
        seq: u16,
        /// Why.
        reason: Refusal,
    },
    /// A parameter's value.
    Parameter {
        /// Which.
        id: ParameterId,
        /// In its unit.
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
    /// Something went wrong; motors are off or going off.
    Fault {
        /// Tick it was seen.
        tick: u32,
        /// What.
        fault: Fault,
    },
    /// Bytes of defmt log.
    Log(Vec<u8, MAX_LOG>),
    /// Lockstep ticks are done.
    Ran {
        /// Ticks since start.
        tick: u32,
        /// See [`Statistics::state_hash`].
        state_hash: u64,
    },
    /// The rig's description.
    Rig {
        /// As kept; `None`: none was sent, or the one kept is damaged.
        rig: Option<Rig>,
        /// It is what the board senses and pushes with; else it will be from the next start on.
        in_use: bool,
    },
}

/// What a board can do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Capabilities {
    /// Board name.
    pub board: String<MAX_NAME>,
    /// Largest scene image it can hold, bytes.
    pub scene_capacity: u32,
    /// Layout version it reads.
    pub scene_layout: u32,
    /// CRC of the scene in use; `None` without one.
    pub scene: Option<u32>,
    /// Ticks in a second.
    pub tick_hz: u16,
    /// Handle axes it can drive with force, and with torque.
    pub force_axes: u8,
    /// See above.
    pub torque_axes: u8,
    /// The mechanism and hand are simulated on the board.
    pub simulated: bool,
    /// What tick costs are counted in.
    pub cost_unit: CostUnit,
    /// A tick must cost less than this, in `cost_unit`; 0 when there is no deadline.
    pub cost_budget: u32,
    /// Constraint targets it evaluates at once; 0: none.
    pub max_targets: u8,
    /// Why it started.
    pub reset: ResetReason,
    /// Its state.
    pub state: DeviceState,
    /// Names this session: what the host's [stamps](crate::frame::Stamp) carry. Differs in every session and after every start.
    pub session: u32,
}

/// What tick costs are counted in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum CostUnit {
    /// Instructions (emulated board in counted mode; host time otherwise).
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
    /// The processor met a fault it could not go on from: a bad access, a stack that overflowed.
    HardFault {
        /// Address of the instruction; 0 when it could not be read.
        pc: u32,
    },
    /// Supply too low.
    BrownOut,
    /// The board cannot tell.
    Unknown,
}

/// The safety state machine's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum DeviceState {
    /// Starting; motors off.
    Boot,
    /// Motors off; encoders do not know where the handle is until [`ToDevice::Home`].
    Homing,
    /// Motors off, waiting.
    Idle,
    /// Motors on, nothing grabbed: zero wrench.
    Armed,
    /// A part is grabbed and felt.
    Active,
    /// Going to zero wrench under damping, then off.
    SoftStop,
    /// Motors off until cleared.
    Stopped,
    /// Motors off until the cause is gone and cleared.
    Fault(Fault),
}

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Fault {
    /// The stop input is open.
    StopInput,
    /// Nothing was heard from the host for too long while armed.
    HostSilent {
        /// Milliseconds.
        silent_ms: u16,
    },
    /// An encoder reading jumped further than the mechanism can move in a tick.
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
    /// A motor driver reports a fault without saying which.
    Driver {
        /// Axis.
        axis: u8,
    },
    /// A motor driver reports too much current.
    OverCurrent {
        /// Axis.
        axis: u8,
    },
    /// A motor or its driver is too hot.
    OverTemperature {
        /// Axis.
        axis: u8,
    },
    /// The supply fell below what motors and sensors need; the processor still runs.
    SupplyLow,
    /// A tick took longer than its period.
    TickOverrun,
    /// The scene does not pass its checks any more.
    SceneDamaged,
    /// The computed wrench is not finite.
    NonFinite,
    /// The handle turns faster than allowed.
    AngularOverSpeed,
    /// The encoders no longer know where the handle is, though none of them jumped.
    ReferenceLost,
    /// The encoders say where the links cannot be.
    ImpossiblePosture,
    /// A sensor reading is not finite, or out of all proportion.
    BadReading,
}

/// Why a message was not carried out.
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
        /// Which.
        id: ParameterId,
        /// Smallest accepted.
        min: f32,
        /// Largest accepted.
        max: f32,
    },
    /// A chunk that does not continue the last.
    ChunkOrder {
        /// Offset expected.
        expected: u32,
    },
    /// No upload under way.
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
        /// Bytes there.
        received: u32,
    },
    /// What arrived is not what was announced.
    SceneCrc {
        /// As announced.
        expected: u32,
        /// As stored.
        found: u32,
    },
    /// Not a scene image.
    SceneImage(ImageError),
    /// Flash could not be erased or written.
    Flash,
    /// Only for simulated mechanisms.
    NotSimulated,
    /// Not in lockstep, or ticks still to run.
    Lockstep,
    /// A number that is not finite or not possible.
    BadNumber,
    /// The board's queue is full: try again.
    Busy,
    /// The frame was sound but no message of this version.
    Undecodable,
    /// The description of the rig is not one that can be used.
    Rig(RigFault),
    /// This board's mechanism is compiled into its firmware.
    RigFixed,
    /// The board has no sound description of its rig in use: none was sent, or it is damaged or of another release.
    RigDamaged,
    /// The command carries no stamp of this session, or one that was seen before, or the board has stopped or faulted since it came.
    Outdated,
}

/// A rigid pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct WirePose {
    /// m.
    pub position: [f32; 3],
    /// Unit quaternion x, y, z, w.
    pub orientation: [f32; 4],
}

/// Force and torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct WireWrench {
    /// N.
    pub force: [f32; 3],
    /// N·m.
    pub torque: [f32; 3],
}

/// Two faces that touch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct TouchingPair {
    /// Face of the grabbed part, [`crate::image::NO_FACE`] when unknown.
    pub moving_face: u16,
    /// The other part.
    pub static_part: u16,
    /// Its face.
    pub static_face: u16,
    /// The grabbed part's other face where the deepest point lies on an edge, else [`crate::image::NO_FACE`].
    pub moving_edge_face: u16,
    /// The other part's, likewise.
    pub static_edge_face: u16,
    /// Points in contact.
    pub count: u16,
    /// Deepest penetration, m.
    pub depth: f32,
    /// Where, world, m.
    pub point: [f32; 3],
    /// Insertion depth: how far the touching points reach along the axis of the static face, or else the moving one, m; 0 where neither is round.
    /// Faces that guidance keeps apart do not touch and have none.
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
    /// Wrench of the simulated hand on the handle, where the hand is simulated.
    pub hand: Option<WireWrench>,
    /// Cost of this tick, see [`Capabilities::cost_unit`].
    pub cost: u32,
    /// Points looked at.
    pub points: u16,
    /// See [`flag`].
    pub flags: u16,
    /// Ticks missed since start.
    pub missed: u32,
    /// Telemetry messages dropped since start because the link was slower.
    pub dropped: u32,
    /// How constraint targets stand.
    pub guidance: Guidance,
    /// Touching face pairs, deepest first.
    pub pairs: Vec<TouchingPair, MAX_PAIRS>,
}

/// How constraint targets stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Guidance {
    /// Targets in force; those that fade are not counted.
    pub active: u8,
    /// Of those, the joints: the part is so near to where they want it that their faces cannot touch, and have left the work.
    pub joints: u8,
    /// Largest engagement of any, 0 to 1.
    pub engagement: f32,
    /// What they pull with, on the object about its centre of mass.
    pub wrench: WireWrench,
}

macro_rules! flags {
    ($($(#[doc = $doc:literal])+ $name:ident = $bit:literal;)+) => {
        /// Bits of [`Telemetry::flags`], each one fact.
        pub mod flag {
            $($(#[doc = $doc])+ pub const $name: u16 = 1 << $bit;)+

            /// Every bit with its name and what it says, ascending.
            pub const ALL: &[(u16, &str, &str)] = &[$(($name, stringify!($name), concat!($($doc),+)),)+];
        }
    };
}

flags! {
    /// The point budget was reached: some points were not looked at this tick.
    BUDGET = 0;
    /// The force limit acted.
    FORCE_LIMIT = 1;
    /// The torque limit acted.
    TORQUE_LIMIT = 2;
    /// The limit on the change of force acted.
    FORCE_SLEW = 3;
    /// A computed number was not finite: the wrench is zero.
    NON_FINITE = 4;
    /// More face pairs touch than the message holds.
    PAIRS = 5;
    /// More contacts than the board stores.
    CONTACTS = 6;
    /// The coupling slipped at its largest force.
    COUPLING_FORCE = 7;
    /// The handle's wrench is turned down because the loop made energy.
    SOFTENED = 8;
    /// The part was held to its largest speed, or to what was looked at.
    SPEED_LIMIT = 9;
    /// A point is so deep inside that no way out is known.
    DEEP = 10;
    /// The step's touching points had not come to rest.
    UNSETTLED = 11;
    /// The coupling slipped at its largest torque.
    COUPLING_TORQUE = 12;
    /// A sensor reading was not finite or out of all proportion.
    BAD_INPUT = 13;
    /// The limit on the change of torque acted.
    TORQUE_SLEW = 14;
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
    /// Most points looked at in a tick.
    pub points_max: u32,
    /// FNV-1a over the bits of handle pose, object pose and twist, and wrench of every tick since the scene was loaded or reset.
    pub state_hash: u64,
    /// Frames received whole.
    pub frames: u32,
    /// Frames thrown away: damaged, too long, or undecodable.
    pub bad_frames: u32,
    /// Messages thrown away because there was no room for their answer: the host does not read.
    pub unanswered: u32,
    /// Telemetry messages dropped.
    pub dropped: u32,
    /// Largest stack depth seen, bytes; 0 where not measured.
    pub stack_max: u32,
}

/// Kinds of constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ConstraintKind {
    /// Axis on axis (cylinder in cylinder).
    Concentric,
    /// Plane on plane: turns the grabbed part until they are parallel, and leaves the distance to contact.
    Coplanar,
    /// Axis on axis and apex on apex (cone in cone).
    Conical,
    /// Centre on centre.
    Spherical,
    /// Centre on axis: sphere of the grabbed part in a cylinder of the other.
    Annular,
    /// Axis on centre: cylinder of the grabbed part over a sphere of the other.
    AnnularBore,
}

/// A point and a direction fixed to a part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Feature {
    /// m, shape frame.
    pub point: [f32; 3],
    /// Unit vector, shape frame.
    pub direction: [f32; 3],
}

/// What the desktop recognised and the board is to guide towards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ConstraintTarget {
    /// Names the target; the same id replaces or refreshes it.
    pub id: u16,
    /// Counts up with every message about this id; an older one is stale.
    pub sequence: u16,
    /// Kind.
    pub kind: ConstraintKind,
    /// Feature of the moving part.
    pub moving: Feature,
    /// The part it mates with.
    pub static_part: u16,
    /// Feature of that part.
    pub fixed: Feature,
    /// N/m.
    pub stiffness: f32,
    /// The guidance never pulls harder, N.
    pub force_cap: f32,
    /// N·m.
    pub torque_cap: f32,
    /// Fades out unless refreshed within this many ticks.
    pub expiry_ticks: u16,
    /// Moving and static faces whose contact it replaces.
    pub faces: Vec<(u16, u16), MAX_TARGET_PAIRS>,
}

/// A simulated hand: a spring-damper that pulls the handle after a moving target, plus a push.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct HandScript {
    /// N/m.
    pub stiffness: f32,
    /// N·s/m.
    pub damping: f32,
    /// N·m/rad.
    pub angular_stiffness: f32,
    /// N·m·s/rad.
    pub angular_damping: f32,
    /// Tremor's amplitude, m.
    pub tremor: f32,
    /// Tremor's frequency, Hz.
    pub tremor_hz: f32,
    /// Where the hand wants to be, times ascending; before the first the first holds, after the last the last, between them linear (orientation:
    /// shortest arc).
    pub keyframes: Vec<Keyframe, MAX_KEYFRAMES>,
}

/// One point of a hand's script.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Keyframe {
    /// Ticks (ms) since the script was taken.
    pub tick: u32,
    /// Target of the handle.
    pub pose: WirePose,
    /// Added to the spring's force, N, world.
    pub push: [f32; 3],
}

/// One thing that goes wrong at the inputs of a simulated mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct InputFault {
    /// First tick (ms) since the message was taken.
    pub tick: u32,
    /// How many ticks it lasts; a glitch comes once, whatever stands here.
    pub ticks: u32,
    /// What.
    pub kind: InputFaultKind,
}

/// What can go wrong at the inputs of a mechanism. Axes 0 to 2 are the handle's position, 3 to 5 its rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum InputFaultKind {
    /// An encoder's counter is off by so many counts from here on.
    EncoderGlitch {
        /// Axis.
        axis: u8,
        /// Counts.
        counts: i32,
    },
    /// An encoder's counter stands still.
    EncoderStuck {
        /// Axis.
        axis: u8,
    },
    /// The handle's position reads as not a number.
    NotANumber,
    /// A motor driver reports a fault without saying which.
    Driver {
        /// Axis.
        axis: u8,
    },
    /// A motor driver reports too much current.
    OverCurrent {
        /// Axis.
        axis: u8,
    },
    /// A motor driver reports too much heat.
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
    fn every_bound_counts_in_the_schema_hash() {
        let own = hash_bounds(1, &WIRE_BOUNDS);
        for i in 0..WIRE_BOUNDS.len() {
            let mut changed = WIRE_BOUNDS;
            changed[i] += 1;
            assert_ne!(hash_bounds(1, &changed), own, "bound {i}");
        }
    }
}

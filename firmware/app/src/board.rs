//! What a board must give the application: a mechanism, flash for scenes, a clock for tick costs, a way out for bytes.
//!
//! The application ([`crate::control`], [`crate::link`]) is the same on every board and in the simulated rig on a PC; a board crate wires
//! pins, clocks and interrupts to these traits and nothing more.

use mortise_haptics::{Pose, Twist, Wrench};
use mortise_protocol::message::{CostUnit, HandScript, InputFault, ResetReason};

use crate::ceilings::Ceilings;

/// Ticks in a second.
pub const TICK_HZ: u16 = 1000;
/// Seconds in a tick.
pub const TICK_S: f32 = 0.001;

/// What the mechanism's sensors say in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensed {
    /// Handle in the world.
    pub handle: Pose,
    /// Handle's velocity at its origin, world axes, as the board estimates it.
    pub twist: Twist,
    /// The stop input is open (pressed, or its wire broken).
    pub stop_open: bool,
    /// The supply is below what motors and sensors need.
    pub supply_low: bool,
    /// A motor driver reports a fault.
    pub driver_fault: Option<DriverFault>,
    /// Encoder axis whose reading jumped further than the mechanism can move in a tick.
    pub encoder_jump: Option<u8>,
    /// The encoders say where the links cannot be.
    pub impossible_posture: bool,
    /// Encoder axis that does not follow its motor, see [`crate::encoder_watch`].
    pub encoder_stuck: Option<u8>,
    /// The encoders know where the handle is: absolute ones always do, counting ones since [`Mechanism::home`] and until they jump.
    pub referenced: bool,
}

impl Sensed {
    /// At the world's origin, at rest, nothing wrong.
    pub const AT_REST: Self = Self {
        handle: Pose::IDENTITY,
        twist: Twist::ZERO,
        stop_open: false,
        supply_low: false,
        driver_fault: None,
        encoder_jump: None,
        impossible_posture: false,
        encoder_stuck: None,
        referenced: true,
    };
}

/// What a motor driver reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriverFault {
    /// Motor axis.
    pub axis: u8,
    /// As far as the driver tells.
    pub kind: DriverFaultKind,
}

/// Kinds of driver faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriverFaultKind {
    /// One line for everything.
    Any,
    /// Too much current.
    OverCurrent,
    /// Too much heat.
    OverTemperature,
}

/// What the motors are to do until the next tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// Enable output inactive, no current: the handle hangs free.
    Off,
    /// Enable output active, currents so that this wrench acts on the handle at its origin, world axes.
    Wrench(Wrench),
}

/// Encoders, motors, stop input: read once and driven once in each tick, from the control plane only.
///
/// Both calls are part of the 1 ms tick: bounded time, no blocking, no panics. After [`Drive::Off`] the enable output must be inactive
/// when `drive` returns. A board that cannot produce every component of a wrench (see [`Identity::force_axes`]) drops the others.
pub trait Mechanism {
    /// Mechanism and hand are simulated: time may then wait for the host (lockstep).
    const SIMULATED: bool;
    /// It is what the description kept in flash says; else it is compiled in, and no description is taken.
    const DESCRIBED: bool = false;

    /// Reads the sensors.
    fn sense(&mut self) -> Sensed;

    /// Sets the motors. Applied at once; holds until the next call.
    fn drive(&mut self, drive: Drive);

    /// A part is felt from here on, or is not. Only while one is felt the mechanism may probe its encoders ([`crate::encoder_watch`]). Called in each tick
    /// before [`Self::drive`].
    fn watch_encoders(&mut self, _felt: bool) {}

    /// Counts of the encoders at the handle, at most: m and rad. Readings are within half of this; 0: not known.
    fn count(&self) -> [f32; 2] {
        [0.0; 2]
    }

    /// Wrench (world, at the handle's origin) of the simulated hand in the last tick; `None` where a person holds the handle.
    fn hand(&self) -> Option<Wrench> {
        None
    }

    /// Gives the simulated hand a script whose time starts now; `None` lets go. A real mechanism has no such hand and does nothing.
    fn set_hand(&mut self, _script: Option<&HandScript>) {}

    /// The handle stands in its reference pose: counting encoders start from here. Called with the motors off only.
    fn home(&mut self) {}

    /// Lets the inputs of a simulated mechanism fail as told, from the next reading on. A real mechanism does nothing.
    fn set_input_faults(&mut self, _faults: &[InputFault]) {}

    /// Puts a simulated mechanism where it was at start, at rest, without a hand, so that a scenario starts from known bits; returns the handle's
    /// pose there. A real one stays where it is.
    fn reset(&mut self) -> Option<Pose> {
        None
    }
}

/// Counts what a tick costs and whether one came too late.
pub trait Clock {
    /// A tick begins. Returns how many deadlines passed since the last one began: a tick that was not done when the next was due counts one,
    /// each further tick that could not run another.
    fn begin(&mut self) -> u32;

    /// Cost since the moment this tick was due, in [`Identity::cost_unit`]; includes the interrupt's latency where the board can tell.
    fn cost(&mut self) -> u32;
}

/// Flash could not be erased or written, or was asked for something outside a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashError;

/// Scene slots in flash.
pub const SLOTS: usize = 2;
/// Slots of the rig's description, one [`Flash::erase_size`] each. A board whose mechanism is compiled in has none: its flash gives no memory for
/// them.
pub const RIG_SLOTS: [usize; 2] = [SLOTS, SLOTS + 1];
/// Smallest piece that can be written, bytes: one flash word of an STM32H7. A piece is written at most once between two erasures.
pub const WRITE_SIZE: usize = 32;

/// Two slots of memory-mapped flash for scenes, read in place, and two small ones for the rig's description ([`RIG_SLOTS`]).
///
/// Erased bytes read as `0xff`. Used from the link plane only; calls may block for as long as the flash needs (1–2 s for a 128 KiB
/// sector of an STM32H7), which is why scenes are stored only while the motors are off.
///
/// # Safety
/// `slot` must return memory that starts at a multiple of [`WRITE_SIZE`], is `capacity()` bytes long (a rig slot: `erase_size()`, or empty), is valid
/// for `'s`, and changes only by `erase` and `write` of the same slot.
pub unsafe trait Flash<'s> {
    /// Bytes in one slot; a multiple of [`Self::erase_size`].
    fn capacity(&self) -> usize;

    /// Bytes erased at once; a multiple of [`WRITE_SIZE`].
    fn erase_size(&self) -> usize;

    /// The slot's memory.
    ///
    /// # Safety
    /// `slot < SLOTS` or in [`RIG_SLOTS`], and no result of an earlier call may be used after the next `erase` or `write` to this slot.
    unsafe fn slot(&self, slot: usize) -> &'s [u8];

    /// Erases the piece that starts at `offset`, a multiple of [`Self::erase_size`].
    fn erase(&mut self, slot: usize, offset: usize) -> Result<(), FlashError>;

    /// Writes one flash word at `offset`, a multiple of [`WRITE_SIZE`], erased before.
    fn write(&mut self, slot: usize, offset: usize, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError>;
}

/// Where frames go: a bounded buffer that hardware empties.
pub trait Outbound {
    /// Bytes that [`Self::write`] takes now.
    fn room(&self) -> usize;

    /// Takes one frame whole. Never called with more than `room()` bytes.
    fn write(&mut self, frame: &[u8]);
}

/// What a board says about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Identity {
    /// Its name, at most [`mortise_protocol::limits::MAX_NAME`] characters; what is longer is cut.
    pub board: &'static str,
    /// Handle axes it can drive with force.
    pub force_axes: u8,
    /// Handle axes it can drive with torque.
    pub torque_axes: u8,
    /// What [`Clock::cost`] counts in.
    pub cost_unit: CostUnit,
    /// Costs in a tick's period; 0 when there is no deadline.
    pub cost_budget: u32,
    /// Why it started.
    pub reset: ResetReason,
    /// Missed ticks in a row, motors live, that are a fault; 0: they are only counted, because the mechanism stands still meanwhile.
    pub overrun_ticks: u8,
    /// What this rig's motors and links bear, whatever the parameters say.
    pub ceilings: Ceilings,
    /// Differs at every start, by the chip's random numbers where it has any: names of sessions are made from it. Nothing else may depend on it.
    pub entropy: u64,
}

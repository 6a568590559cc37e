//! What a board must provide to the application: a mechanism, flash for scenes, a clock that measures tick costs, an output for bytes.
//!
//! The application ([`crate::control`], [`crate::link`]) is the same on every board and in the simulated rig on a PC; a board crate wires
//! pins, clocks and interrupts to these traits and nothing more.

use mortise_mechanism::hardware_limits::HardwareLimits;
pub use mortise_mechanism::interface::{
    Drive, DriverFault, DriverFaultKind, Mechanism, Sensed, Simulation, TICK_HZ, TICK_S,
};
use mortise_protocol::message::{CostUnit, ResetReason};

/// Clock that measures the cost of a tick and detects late ticks.
pub trait Clock {
    /// Marks the start of a tick. Returns the deadlines missed since the last start: one for a tick that was still running when the next was due, and
    /// one for each further tick that could not run for that reason.
    fn begin(&mut self) -> u32;

    /// Cost since the moment this tick was due, in [`Identity::cost_unit`]; includes the interrupt's latency where the board can state it.
    fn cost(&mut self) -> u32;
}

/// Flash could not be erased or written, or the request lay outside a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashError;

/// Scene slots in flash.
pub const SLOTS: usize = 2;
/// Slots of the rig's description, one [`Flash::erase_size`] each. A board whose mechanism is compiled in has none: its flash returns empty memory
/// for them.
pub const RIG_SLOTS: [usize; 2] = [SLOTS, SLOTS + 1];
/// Smallest unit of a write, bytes: one flash word of an STM32H7. A word is written at most once between two erasures.
pub const WRITE_SIZE: usize = 32;

/// One flash word, with the alignment that scenes require.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub struct FlashWord(pub [u8; WRITE_SIZE]);

/// An erased word.
pub const ERASED: FlashWord = FlashWord([0xff; WRITE_SIZE]);

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

/// Output of frames: a bounded buffer that hardware empties.
pub trait Outbound {
    /// Bytes that [`Self::write`] can accept now.
    fn room(&self) -> usize;

    /// Queues one whole frame. Never called with more than `room()` bytes.
    fn write(&mut self, frame: &[u8]);
}

/// The board's description of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Identity {
    /// Its name, at most [`mortise_protocol::limits::MAX_NAME`] characters; a longer name is truncated.
    pub board: &'static str,
    /// Handle axes it can drive with force.
    pub force_axes: u8,
    /// Handle axes it can drive with torque.
    pub torque_axes: u8,
    /// Unit of [`Clock::cost`].
    pub cost_unit: CostUnit,
    /// A tick's period in that unit; 0 when there is no deadline.
    pub cost_budget: u32,
    /// Reason for the last reset.
    pub reset: ResetReason,
    /// Consecutive missed ticks, motors live, that are a fault; 0: overruns are only counted, because the mechanism stands still meanwhile.
    pub overrun_ticks: u8,
    /// Limits of this rig's motors and links, whatever the parameters say.
    pub hardware_limits: HardwareLimits,
    /// Differs at every start, from the chip's random number generator where it has one: session names are derived from it. Nothing else may depend
    /// on it.
    pub entropy: u64,
}

//! What a board must give the application: a mechanism, flash for scenes, a clock for tick costs, a way out for bytes.
//!
//! The application ([`crate::control`], [`crate::link`]) is the same on every board and in the simulated rig on a PC; a board crate wires
//! pins, clocks and interrupts to these traits and nothing more.

use mortise_mechanism::ceilings::Ceilings;
pub use mortise_mechanism::interface::{
    Drive, DriverFault, DriverFaultKind, Mechanism, Sensed, Simulation, TICK_HZ, TICK_S,
};
use mortise_protocol::message::{CostUnit, ResetReason};

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

/// One flash word, aligned as scenes need it.
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

//! Inputs of single ticks, as a recording needs them to compute a run again to the bit.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::rigid::{WirePose, WireTwist};
use crate::limits::MAX_TICKS;

/// Inputs of consecutive ticks, and a hash of each tick's results.
///
/// Together with the messages that the board has carried out they determine every result of the control plane: a simulation that is given the
/// same readings, and the same messages before the same ticks, computes the same bits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Inputs {
    /// Ticks since start of the first tick below, counted as in [`super::Telemetry::tick`].
    pub first_tick: u32,
    /// Encoder count at the handle, m and rad: a setting of the energy account that the mechanism states.
    pub count: [f32; 2],
    /// Ticks lost since the recording began, because the link was slower.
    pub lost: u32,
    /// One for each tick.
    pub ticks: Vec<TickInput, MAX_TICKS>,
}

/// A motor driver's report of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum DriverReport {
    /// A single line for all causes; its axis.
    Any(u8),
    /// Overcurrent of this axis.
    OverCurrent(u8),
    /// Overtemperature of this axis.
    OverTemperature(u8),
}

/// What a tick has read, the messages carried out before it, and a hash of what it computed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct TickInput {
    /// Handle pose; the last valid one in a tick with a bad reading.
    pub handle: WirePose,
    /// Handle velocity at its origin, as the board estimates it.
    pub twist: WireTwist,
    /// A reading was not a number.
    pub bad_reading: bool,
    /// The stop input was open.
    pub stop_open: bool,
    /// The supply was too low.
    pub supply_low: bool,
    /// The encoder readings correspond to no posture.
    pub impossible_posture: bool,
    /// The encoders had a reference.
    pub referenced: bool,
    /// A motor driver reported a fault.
    pub driver: Option<DriverReport>,
    /// Axis of an encoder that jumped.
    pub encoder_jump: Option<u8>,
    /// Axis of an encoder that did not follow its motor.
    pub encoder_stuck: Option<u8>,
    /// Sequence number of the last message carried out by the control plane in this session; 0 before the first.
    pub carried_out: u16,
    /// Number of stops requested since start, modulo 256. A stop overtakes queued messages: it takes effect before them.
    pub stops: u8,
    /// Lowest 32 bits of [`super::Statistics::state_hash`] after the tick. The hash covers all ticks since the scene was loaded or reset, so the first
    /// tick with another result is the first with another hash.
    pub hash: u32,
}

//! What only a simulated mechanism takes: the operator's hand, and faults at its inputs.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::rigid::WirePose;
use crate::limits::MAX_KEYFRAMES;

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
    /// An encoder is wired so that it counts in this sense, whatever the description says. Mechanisms with a description alone, as the next three.
    EncoderSense {
        /// Axis.
        axis: u8,
        /// Down when the axis turns forward.
        reversed: bool,
    },
    /// A motor is wired so that it pushes in this sense, whatever the description says.
    MotorSense {
        /// Axis.
        axis: u8,
        /// Backward under a positive current.
        reversed: bool,
    },
    /// A motor gives no torque: its wire is broken.
    MotorDead {
        /// Axis.
        axis: u8,
    },
    /// Two encoders are plugged into each other's place.
    EncodersSwapped {
        /// One.
        axis: u8,
        /// The other.
        with: u8,
    },
}

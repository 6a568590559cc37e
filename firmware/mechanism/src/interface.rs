//! Interface between the control plane and a mechanism: one reading and one drive command per tick.
//!
//! A board implements [`Mechanism`] with its encoders, motors and stop input; a simulation with a model of them.

use mortise_haptics::{Pose, Twist, Wrench};
use mortise_protocol::limits::{MAX_ENCODERS, MAX_JOINTS};
use mortise_protocol::message::{HandScript, InputFault};

/// Ticks in a second.
pub const TICK_HZ: u16 = 1000;
/// Seconds in a tick.
pub const TICK_S: f32 = 0.001;

/// Sensor readings of one tick.
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
    /// The encoder readings correspond to no posture of the links.
    pub impossible_posture: bool,
    /// Encoder axis that does not follow its motor, see [`crate::encoder_watch`].
    pub encoder_stuck: Option<u8>,
    /// The encoders have a reference: absolute ones always, incremental ones from [`Mechanism::home`] until they jump.
    pub referenced: bool,
}

impl Sensed {
    /// At the world's origin, at rest, no fault.
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

/// Fault reported by a motor driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriverFault {
    /// Motor axis.
    pub axis: u8,
    /// As far as the driver distinguishes.
    pub kind: DriverFaultKind,
}

/// Kinds of driver faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriverFaultKind {
    /// A single line for all causes.
    Any,
    /// Overcurrent.
    OverCurrent,
    /// Overtemperature.
    OverTemperature,
}

/// Command to the motors until the next tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// Enable output inactive, no current: the handle moves freely.
    Off,
    /// Enable output active, currents such that this wrench acts on the handle at its origin, world axes.
    Wrench(Wrench),
    /// Enable output active, current in the motor of one joint alone: it pushes the joint forward, as the description says, with this force at the
    /// handle, N. A mechanism without a description gives no current.
    Joint {
        /// Joint, from 0.
        joint: u8,
        /// Force at the handle, N.
        force: f32,
    },
}

/// Encoders, motors, stop input: read once and driven once in each tick, from the control plane only.
///
/// Both calls are part of the 1 ms tick: bounded time, no blocking, no panics. After [`Drive::Off`] the enable output must be inactive
/// when `drive` returns. A board that cannot produce every component of a wrench (its identity says which) drops the others.
pub trait Mechanism {
    /// Whether the description kept in flash defines the mechanism; else it is compiled in, and no description is accepted.
    const DESCRIBED: bool = false;

    /// Reads the sensors.
    fn sense(&mut self) -> Sensed;

    /// Sets the motors. Applied at once; holds until the next call.
    fn drive(&mut self, drive: Drive);

    /// Whether a part is rendered from here on. The mechanism may probe its encoders ([`crate::encoder_watch`]) only while one is. Called in each
    /// tick before [`Self::drive`].
    fn watch_encoders(&mut self, _rendered: bool) {}

    /// Upper bound of an encoder count at the handle: m and rad. Readings are within half of this; 0: unknown.
    fn count(&self) -> [f32; 2] {
        [0.0; 2]
    }

    /// Motors that [`Drive::Joint`] can drive; 0 without a description.
    fn motors(&self) -> u8 {
        0
    }

    /// Counts of the encoders in the last reading: of the joints, then of the wrist; 0 for an absent one.
    fn counts(&self) -> [i32; MAX_ENCODERS] {
        [0; MAX_ENCODERS]
    }

    /// Currents of the joints' motors under the last drive command, A.
    fn currents(&self) -> [f32; MAX_JOINTS] {
        [0.0; MAX_JOINTS]
    }

    /// Sets the reference: the handle is in its reference pose, and incremental encoders count from here. Called with the motors off only.
    fn home(&mut self) {}

    /// The controls of a simulated mechanism; `None` for a real one.
    fn simulation(&mut self) -> Option<&mut dyn Simulation> {
        None
    }
}

/// Controls that only a simulated mechanism has. Its time may wait for the host (lockstep). A control that a simulation does not model has no effect.
pub trait Simulation {
    /// Moves the simulated links and the operator model by one tick, under the last drive command. Called in each tick before [`Mechanism::sense`]; a
    /// real mechanism moves by itself, so this is no part of a tick's cost.
    fn advance(&mut self) {}

    /// Wrench (world, at the handle's origin) of the operator model in the last tick; `None` without one.
    fn hand(&self) -> Option<Wrench> {
        None
    }

    /// Starts a script of the operator model, whose time begins now; `None` releases the handle.
    fn set_hand(&mut self, _script: Option<&HandScript>) {}

    /// Starts a script of input faults, effective from the next reading on.
    fn set_input_faults(&mut self, _faults: &[InputFault]) {}

    /// Resets the mechanism to its initial state, at rest and without an operator, so that a scenario starts from known bits; returns the handle's
    /// pose there, or `None` where the mechanism stays as it is.
    fn reset(&mut self) -> Option<Pose> {
        None
    }
}

//! Raw readings of a mechanism, and the test of a single motor: what setting up a rig needs.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::inputs::DriverReport;
use crate::limits::{MAX_ENCODERS, MAX_JOINTS};

/// Readings of encoders and safety inputs, before kinematics and filters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Readings {
    /// Ticks since start.
    pub tick: u32,
    /// Counts of the joints' encoders since the reference was set, then of the wrist's; 0 for an absent encoder.
    pub counts: [i32; MAX_ENCODERS],
    /// Currents of the joints' motors, A, positive in the motor's own sense.
    pub currents: [f32; MAX_JOINTS],
    /// The encoders have a reference.
    pub referenced: bool,
    /// The stop input is open.
    pub stop_open: bool,
    /// The supply is too low.
    pub supply_low: bool,
    /// A motor driver reports a fault.
    pub driver: Option<DriverReport>,
}

/// Result of a motor's test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct MotorTest {
    /// Counts each encoder moved during the push.
    pub moved: [i32; MAX_ENCODERS],
    /// The push ended early because the handle moved as far as a test may move it.
    pub far: bool,
}

//! The mechanism of a replayed recording: its sensors read what was recorded.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::{Quat, Vec3};
use mortise_firmware::board::{Drive, DriverFault, DriverFaultKind, Mechanism, Sensed, Simulation};
use mortise_haptics::{Pose, Twist};
use mortise_mechanism::hardware_limits::HardwareLimits;
use mortise_protocol::message::{DriverReport, TickInput};
use mortise_protocol::rig::Rig;
use mortise_simulation::simulated_rig::SimulatedRig;

/// Readings of the ticks to come, filled by the program that replays a recording. Cheap to clone; all clones share the readings.
#[derive(Clone)]
pub struct Readings {
    queue: Arc<Mutex<Queue>>,
    limits: HardwareLimits,
    rig: Option<Rig>,
    simulated: bool,
}

#[derive(Default)]
struct Queue {
    ticks: VecDeque<Sensed>,
    count: [f32; 2],
}

impl Readings {
    /// None yet. `rig`: the description in use on the recorded board; `simulated`: whether its mechanism was simulated, which a reset of the scene
    /// puts back to its initial pose.
    pub fn new(rig: Option<Rig>, simulated: bool) -> Self {
        Self {
            queue: Arc::default(),
            limits: (rig.as_ref()).map_or(HardwareLimits::LARGEST, HardwareLimits::of),
            rig,
            simulated,
        }
    }

    /// Adds the reading of one tick; `count`: see [`mortise_protocol::message::Inputs::count`].
    pub fn push(&self, input: &TickInput, count: [f32; 2]) {
        let mut queue = self.lock();
        queue.ticks.push_back(sensed(input));
        queue.count = count;
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Mechanism that reads [`Readings`]: one a tick, the last one again while there is none. Its motors move nothing.
pub(crate) struct Replayed {
    readings: Readings,
    last: Sensed,
}

impl Replayed {
    pub(crate) fn new(readings: Readings) -> Self {
        Self {
            readings,
            last: Sensed::AT_REST,
        }
    }

    pub(crate) fn limits(&self) -> HardwareLimits {
        self.readings.limits
    }
}

impl Mechanism for Replayed {
    fn sense(&mut self) -> Sensed {
        if let Some(next) = self.readings.lock().ticks.pop_front() {
            self.last = next;
        }
        self.last
    }

    fn drive(&mut self, _drive: Drive) {}

    fn count(&self) -> [f32; 2] {
        self.readings.lock().count
    }

    fn simulation(&mut self) -> Option<&mut dyn Simulation> {
        Some(self)
    }
}

impl Simulation for Replayed {
    fn reset(&mut self) -> Option<Pose> {
        if !self.readings.simulated {
            return None;
        }
        SimulatedRig::of(self.readings.rig.as_ref()).simulation()?.reset()
    }
}

/// The reading as the mechanism gave it to the control plane.
fn sensed(input: &TickInput) -> Sensed {
    let mut position = Vec3::from_array(input.handle.position);
    if input.bad_reading {
        // The recording holds the valid reading that replaced this one.
        position.x = f32::NAN;
    }
    Sensed {
        handle: Pose {
            position,
            orientation: Quat::from_array(input.handle.orientation),
        },
        twist: Twist {
            linear: Vec3::from_array(input.twist.linear),
            angular: Vec3::from_array(input.twist.angular),
        },
        stop_open: input.stop_open,
        supply_low: input.supply_low,
        driver_fault: input.driver.map(|report| {
            let (axis, kind) = match report {
                DriverReport::Any(axis) => (axis, DriverFaultKind::Any),
                DriverReport::OverCurrent(axis) => (axis, DriverFaultKind::OverCurrent),
                DriverReport::OverTemperature(axis) => (axis, DriverFaultKind::OverTemperature),
            };
            DriverFault { axis, kind }
        }),
        encoder_jump: input.encoder_jump,
        impossible_posture: input.impossible_posture,
        encoder_stuck: input.encoder_stuck,
        referenced: input.referenced,
    }
}

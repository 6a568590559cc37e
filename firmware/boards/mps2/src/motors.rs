//! The simulated mechanism behind an enable output that can be seen: LED 0 is on while motors are enabled.

use mortise_firmware::board::{Drive, Mechanism, Sensed, Simulation};
use mortise_protocol::limits::{MAX_ENCODERS, MAX_JOINTS};
use mortise_protocol::rig::Rig;
use mortise_simulation::simulated_rig::SimulatedRig;

use crate::registers::Registers;

const LEDS: usize = 0x0;

/// Enable output inactive. Safe from any context.
pub fn off() {
    Registers::FPGAIO.write::<LEDS>(0);
}

/// Simulated mechanism with an enable output.
pub struct Motors {
    mechanism: SimulatedRig,
    enabled: bool,
}

impl Motors {
    /// Off; of the description kept, or a free handle.
    pub fn new(rig: Option<&Rig>) -> Self {
        off();
        Self {
            mechanism: SimulatedRig::of(rig),
            enabled: false,
        }
    }
}

impl Mechanism for Motors {
    const DESCRIBED: bool = true;

    fn sense(&mut self) -> Sensed {
        self.mechanism.sense()
    }

    fn drive(&mut self, drive: Drive) {
        let enabled = drive != Drive::Off;
        // Only when it changes: a device access costs QEMU more than the tick.
        if enabled != self.enabled {
            self.enabled = enabled;
            Registers::FPGAIO.write::<LEDS>(u32::from(enabled));
        }
        self.mechanism.drive(drive);
    }

    fn watch_encoders(&mut self, felt: bool) {
        self.mechanism.watch_encoders(felt);
    }

    fn count(&self) -> [f32; 2] {
        self.mechanism.count()
    }

    fn motors(&self) -> u8 {
        self.mechanism.motors()
    }

    fn counts(&self) -> [i32; MAX_ENCODERS] {
        self.mechanism.counts()
    }

    fn currents(&self) -> [f32; MAX_JOINTS] {
        self.mechanism.currents()
    }

    fn home(&mut self) {
        self.mechanism.home();
    }

    fn simulation(&mut self) -> Option<&mut dyn Simulation> {
        self.mechanism.simulation()
    }
}

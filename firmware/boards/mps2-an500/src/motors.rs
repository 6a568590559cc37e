//! The simulated mechanism behind an enable output that can be seen: LED 0 is on while motors are enabled.

use mortise_firmware::board::{Drive, Mechanism, Sensed};
use mortise_haptics::{Pose, Wrench};
use mortise_protocol::message::{HandScript, InputFault};
use mortise_protocol::rig::Rig;
use mortise_simulation::simulated_rig::SimulatedRig;

use crate::device::Registers;

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
    const SIMULATED: bool = true;
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

    fn hand(&self) -> Option<Wrench> {
        self.mechanism.hand()
    }

    fn set_hand(&mut self, script: Option<&HandScript>) {
        self.mechanism.set_hand(script);
    }

    fn home(&mut self) {
        self.mechanism.home();
    }

    fn set_input_faults(&mut self, faults: &[InputFault]) {
        self.mechanism.set_input_faults(faults);
    }

    fn reset(&mut self) -> Option<Pose> {
        self.mechanism.reset()
    }
}

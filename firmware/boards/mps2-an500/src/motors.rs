//! The simulated mechanism behind an enable output that can be seen: LED 0 is on while motors are enabled.

use mortise_firmware::board::{Drive, Mechanism, Sensed};
use mortise_firmware::simulated::Simulated;
use mortise_haptics::{Pose, Wrench};
use mortise_protocol::message::HandScript;

use crate::device::Registers;

const LEDS: usize = 0x0;

/// Enable output inactive. Safe from any context.
pub fn off() {
    Registers::FPGAIO.write::<LEDS>(0);
}

/// Simulated mechanism with an enable output.
pub struct Motors(Simulated);

impl Motors {
    /// Off.
    pub fn new() -> Self {
        off();
        Self(Simulated::new())
    }
}

impl Mechanism for Motors {
    const SIMULATED: bool = true;

    fn sense(&mut self) -> Sensed {
        self.0.sense()
    }

    fn drive(&mut self, drive: Drive) {
        Registers::FPGAIO.write::<LEDS>(u32::from(drive != Drive::Off));
        self.0.drive(drive);
    }

    fn hand(&self) -> Option<Wrench> {
        self.0.hand()
    }

    fn set_hand(&mut self, script: Option<&HandScript>) {
        self.0.set_hand(script);
    }

    fn reset(&mut self) -> Option<Pose> {
        self.0.reset()
    }
}

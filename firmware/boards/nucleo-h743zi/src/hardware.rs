//! Encoders and motors of this board as the shared device uses them.

use mortise_board::device::Hardware;
use mortise_board::set_value::{FULL_CURRENT_A, Setpoint};
use mortise_protocol::limits::MAX_JOINTS as AXES;
use stm32h743::motor_timer;

use crate::encoders::Encoders;
use crate::motors::Motors;

/// See the module.
pub struct Wired {
    pub encoders: Encoders,
    pub motors: Motors,
}

impl Hardware for Wired {
    const FULL_CURRENT_A: f32 = FULL_CURRENT_A;

    fn counts(&mut self) -> [i32; AXES] {
        self.encoders.read()
    }

    fn restart_counts(&mut self) {
        self.encoders.home();
    }

    fn drive(&mut self, currents: [f32; AXES]) {
        self.motors.drive(currents.map(Setpoint::of));
    }

    fn off(&mut self) {
        self.motors.off();
    }

    fn stop_open(&mut self) -> bool {
        self.motors.stopped()
    }

    fn supply_low(&mut self) -> bool {
        motor_timer::supply_is_low()
    }

    fn driver_fault(&mut self, motors: usize) -> Option<u8> {
        self.motors.driver_fault(motors)
    }
}

//! Encoders and motors of a board with this chip, as the shared device uses them.

use mortise_board::device::Hardware;
use mortise_board::set_value::{FULL_CURRENT_A, Setpoint};
use mortise_protocol::limits::MAX_JOINTS;

use crate::encoders::Encoder;
use crate::motor_timer;
use crate::motors::Motors;

/// See the module. In the order of the description's joints.
pub struct Wired {
    /// One for each joint.
    pub encoders: [Encoder; MAX_JOINTS],
    /// One for each joint, enable output and stop input.
    pub motors: Motors,
}

impl Hardware for Wired {
    const FULL_CURRENT_A: f32 = FULL_CURRENT_A;

    fn counts(&mut self) -> [i32; MAX_JOINTS] {
        // Close together: the counters run on.
        self.encoders.each_mut().map(Encoder::read)
    }

    fn restart_counts(&mut self) {
        self.encoders.iter_mut().for_each(Encoder::restart);
    }

    fn drive(&mut self, currents: [f32; MAX_JOINTS]) {
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

//! Motor outputs, enable output and stop input on one timer, so that the stop input acts in hardware ([`crate::motor_timer`]).
//!
//! | line | what it is, and what the board must have outside |
//! |---|---|
//! | PWM | 5 kHz, active high; a set value ([`mortise_board::set_value`]) |
//! | enable | active high; 10 kΩ to ground keep it low through reset and power-up |
//! | stop | contact to ground, normally closed; open or broken wire = stop. 1 kΩ and 10 nF against noise |
//! | direction | high = forward |
//! | driver fault | low = fault; the driver pulls up (10 kΩ or less), so a broken wire is a fault |

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Input, Level, Output, Pin, Pull, Speed};
use embassy_stm32::peripherals::TIM1;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch1, Ch2, Ch3, Ch4};
use mortise_board::set_value::Setpoint;

use crate::motor_timer::{MOTORS, MotorTimer, outputs_on};
use crate::stop_input::StopInput;

/// Pins of the motor side. Until they are made, after the timer, they float and the resistors outside hold them.
pub struct Lines {
    /// PWM of the motors.
    pub pwm: (
        PwmPin<'static, TIM1, Ch1>,
        PwmPin<'static, TIM1, Ch2>,
        PwmPin<'static, TIM1, Ch3>,
    ),
    /// Enable line of all drivers.
    pub enable: PwmPin<'static, TIM1, Ch4>,
    /// Stop contact.
    pub stop: StopInput,
    /// Directions of the motors.
    pub directions: [Output<'static>; MOTORS],
    /// Fault lines of the drivers.
    pub faults: [Input<'static>; MOTORS],
}

/// A direction line, low.
pub fn direction(pin: Peri<'static, impl Pin>) -> Output<'static> {
    Output::new(pin, Level::Low, Speed::Low)
}

/// A driver's fault line: pulled down here against the driver's stronger pull-up.
pub fn driver_fault(pin: Peri<'static, impl Pin>) -> Input<'static> {
    Input::new(pin, Pull::Down)
}

/// All of the motor side.
pub struct Motors {
    timer: MotorTimer,
    lines: Lines,
    live: bool,
}

impl Motors {
    /// Outputs stay off.
    pub fn new(timer: MotorTimer, lines: Lines) -> Self {
        Self {
            timer,
            lines,
            live: false,
        }
    }

    /// Sets all motors and switches the outputs on if they are off. Takes effect with the next PWM period (200 µs); the direction at once,
    /// which only matters where a current changes sign, and there the slew limit keeps it small.
    pub fn drive(&mut self, setpoints: [Setpoint; MOTORS]) {
        for (motor, (setpoint, direction)) in setpoints.iter().zip(&mut self.lines.directions).enumerate() {
            self.timer.set_duty(motor, setpoint.duty);
            direction.set_level(setpoint.forward.into());
        }
        if !self.live {
            self.live = true;
            // Does not take while the stop input is open. A stop since the last `stopped` has left its flag, and the next call reports it.
            self.timer.enable();
        }
    }

    /// Outputs off, enable line low on return.
    pub fn off(&mut self) {
        self.live = false;
        self.timer.off();
    }

    /// The stop input is open, was open for a moment since the last call, or the hardware has cut the outputs for another reason.
    pub fn stopped(&mut self) -> bool {
        let broke = self.timer.broke();
        let cut = self.live && !outputs_on();
        self.lines.stop.is_open() || broke || cut
    }

    /// First of `motors` motors whose driver reports a fault; what is not connected reads as one.
    pub fn driver_fault(&self, motors: usize) -> Option<u8> {
        let faults = self.lines.faults.iter().take(motors);
        { faults }.position(Input::is_low).map(|motor| motor as u8)
    }
}

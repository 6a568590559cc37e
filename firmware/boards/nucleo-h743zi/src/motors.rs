//! Motor outputs, enable output and stop input: one timer, so that the stop input acts in hardware.
//!
//! TIM1 makes all four signals: channels 1–3 the PWM of motors A–C, channel 4 the enable line, held high while outputs are on. Its break input is
//! the stop input. When the stop contact opens, the timer forces all four lines low within nanoseconds and without any instruction; the same
//! happens when the processor locks up or the supply falls under 2.7 V. They stay low until software switches them on again, which
//! does not take while the stop input is open. `LOCK` level 1 keeps software from changing the break settings until the next reset.
//!
//! | signal | pin | Zio | |
//! |---|---|---|---|
//! | PWM A, B, C | PE9, PE11, PE13 | D6, D5, D3 | 5 kHz, active high |
//! | enable | PE14 | D38 | active high; 10 kΩ to ground outside keeps it low through reset and power-up |
//! | stop | PE15 | D37 | contact to ground, normally closed; open or broken wire = stop. 1 kΩ and 10 nF outside against noise |
//! | direction A, B, C | PF13, PF14, PF15 | D7, D4, D2 | high = forward |
//! | driver fault A, B, C | PE7, PE8, PE10 | D41, D42, D40 | low = fault; the driver pulls up (10 kΩ or less), so a broken wire is a fault |

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::pac;
use embassy_stm32::peripherals::{PE7, PE8, PE9, PE10, PE11, PE13, PE14, PE15, PF13, PF14, PF15, TIM1};
use embassy_stm32::timer::simple_pwm::{PwmPin, PwmPinConfig};
use embassy_stm32::timer::{BkIn1, BreakInputPin, Ch1, Ch2, Ch3, Ch4};
use mortise_board::set_value::Setpoint;
use mortise_protocol::limits::MAX_JOINTS as AXES;
use stm32h743::motor_timer::{MotorTimer, outputs_on, release};

/// Bits 13, 14, 15 of port F.
const DIRECTION_SHIFT: usize = 13;
const STOP_PIN: usize = 15;
const ENABLE_PIN: usize = 14;

/// Pins of the motor side, named as in the wiring table above.
pub struct Pins {
    pub pwm_a: Peri<'static, PE9>,
    pub pwm_b: Peri<'static, PE11>,
    pub pwm_c: Peri<'static, PE13>,
    pub enable: Peri<'static, PE14>,
    pub stop: Peri<'static, PE15>,
    pub direction_a: Peri<'static, PF13>,
    pub direction_b: Peri<'static, PF14>,
    pub direction_c: Peri<'static, PF15>,
    pub fault_a: Peri<'static, PE7>,
    pub fault_b: Peri<'static, PE8>,
    pub fault_c: Peri<'static, PE10>,
}

/// All of the motor side.
pub struct Motors {
    timer: MotorTimer,
    live: bool,
    faults: [Input<'static>; AXES],
    _directions: [Output<'static>; AXES],
    _lines: Lines,
}

/// Kept so that the pins stay what they are.
struct Lines {
    _a: PwmPin<'static, TIM1, Ch1>,
    _b: PwmPin<'static, TIM1, Ch2>,
    _c: PwmPin<'static, TIM1, Ch3>,
    _enable: PwmPin<'static, TIM1, Ch4>,
    _stop: Flex<'static>,
}

/// Forces all outputs low, from any context, whatever state the program is in: through the timer, and the enable pin once more by itself.
/// Only a reset brings the enable line back.
pub fn cut() {
    release();
    pac::GPIOE.bsrr().write(|w| w.set_br(ENABLE_PIN, true));
    pac::GPIOE
        .moder()
        .modify(|w| w.set_moder(ENABLE_PIN, pac::gpio::vals::Moder::OUTPUT));
    cortex_m::asm::dsb();
}

/// See [`mortise_board::crash`].
// SAFETY: the hook's name and signature; defined once.
#[unsafe(no_mangle)]
fn mortise_cut_motors() {
    cut();
}

/// Lets the opening stop contact also raise the EXTI15_10 interrupt. The line watches the pin beside the timer that owns it.
pub fn listen_to_stop() {
    /// SYSCFG_EXTICR: port E.
    const PORT_E: u8 = 4;
    pac::SYSCFG
        .exticr(STOP_PIN / 4)
        .modify(|w| w.set_exti(STOP_PIN % 4, PORT_E));
    pac::EXTI.rtsr(0).modify(|w| w.set_line(STOP_PIN, true));
    acknowledge_stop();
    pac::EXTI.imr(0).modify(|w| w.set_line(STOP_PIN, true));
}

/// Ends the stop interrupt.
pub fn acknowledge_stop() {
    // Written ones clear.
    pac::EXTI.pr(0).write(|w| w.set_line(STOP_PIN, true));
}

/// The stop input is open.
pub fn stop_is_open() -> bool {
    pac::GPIOE.idr().read().idr(STOP_PIN) == pac::gpio::vals::Idr::HIGH
}

impl Motors {
    /// Takes the timer and its pins; outputs stay off.
    pub fn new(timer: Peri<'static, TIM1>, pins: Pins) -> Self {
        let timer = MotorTimer::new(timer);
        // Pins last: until here they float and the resistors outside hold them.
        let line = PwmPinConfig {
            output_type: OutputType::PushPull,
            speed: Speed::Medium,
            pull: Pull::Down,
        };
        let stop_function = BreakInputPin::<TIM1, BkIn1>::af_num(&*pins.stop);
        let mut stop = Flex::new(pins.stop);
        stop.set_as_af_unchecked(stop_function, AfType::input(Pull::Up));
        Self {
            timer,
            live: false,
            // Pulled down here against the driver's stronger pull-up.
            faults: [
                Input::new(pins.fault_a, Pull::Down),
                Input::new(pins.fault_b, Pull::Down),
                Input::new(pins.fault_c, Pull::Down),
            ],
            _directions: [
                Output::new(pins.direction_a, Level::Low, Speed::Low),
                Output::new(pins.direction_b, Level::Low, Speed::Low),
                Output::new(pins.direction_c, Level::Low, Speed::Low),
            ],
            _lines: Lines {
                _a: PwmPin::new_with_config(pins.pwm_a, line),
                _b: PwmPin::new_with_config(pins.pwm_b, line),
                _c: PwmPin::new_with_config(pins.pwm_c, line),
                _enable: PwmPin::new_with_config(pins.enable, line),
                _stop: stop,
            },
        }
    }

    /// Sets all three motors and switches the outputs on if they are off. Takes effect with the next PWM period (200 µs); the direction at once,
    /// which only matters where a current changes sign, and there the slew limit keeps it small.
    pub fn drive(&mut self, setpoints: [Setpoint; AXES]) {
        let mut forward = 0u32;
        for (axis, setpoint) in setpoints.iter().enumerate() {
            self.timer.set_duty(axis, setpoint.duty);
            forward |= u32::from(setpoint.forward) << (DIRECTION_SHIFT + axis);
        }
        const ALL: u32 = 0b111 << DIRECTION_SHIFT;
        // Upper half resets, lower half sets.
        pac::GPIOF
            .bsrr()
            .write(|w| w.0 = ((ALL & !forward) << 16) | forward);
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
        stop_is_open() || broke || cut
    }

    /// First of `motors` motors whose driver reports a fault; what is not connected reads as one.
    pub fn driver_fault(&self, motors: usize) -> Option<u8> {
        let faults = self.faults.iter().take(motors);
        { faults }.position(Input::is_low).map(|axis| axis as u8)
    }
}

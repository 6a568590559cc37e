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
use embassy_stm32::pac::timer::vals::{Bkp, Lock, OcmGp, Ossi, Ossr, Urs};
use embassy_stm32::peripherals::{PE7, PE8, PE9, PE10, PE11, PE13, PE14, PE15, PF13, PF14, PF15, TIM1};
use embassy_stm32::rcc;
use embassy_stm32::timer::simple_pwm::{PwmPin, PwmPinConfig};
use embassy_stm32::timer::{BkIn1, BreakInputPin, Ch1, Ch2, Ch3, Ch4};
use nucleo_h743zi::drive::{AXES, Setpoint};

/// PWM frequency of the set value: the highest a maxon ESCON accepts (10 Hz to 5 kHz); the driver switches its power stage by itself.
const PWM_HZ: u32 = 5_000;
/// Channel of the enable line, counted from 0.
const ENABLE: usize = 3;
/// PWR_CR1.PLS: 2.7 V.
const SUPPLY_LEVEL: u8 = 0b101;
/// SYSCFG_CFGR: processor lock-up and supply monitor act on the timers' break input. Not in the PAC; bits as in ST's headers.
const SYSCFG_CFGR: *mut u32 = 0x5800_0418 as *mut u32;
const LOCKUP_BREAKS: u32 = 1 << 6;
const SUPPLY_BREAKS: u32 = 1 << 2;
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
    period: u32,
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
    pac::TIM1.bdtr().modify(|w| w.set_moe(false));
    pac::GPIOE.bsrr().write(|w| w.set_br(ENABLE_PIN, true));
    pac::GPIOE
        .moder()
        .modify(|w| w.set_moder(ENABLE_PIN, pac::gpio::vals::Moder::OUTPUT));
    cortex_m::asm::dsb();
}

/// Outputs off; [`Motors::drive`] may switch them on again. For the stop handler.
pub fn release() {
    pac::TIM1.bdtr().modify(|w| w.set_moe(false));
}

/// PWM and enable line are live.
pub fn outputs_on() -> bool {
    pac::TIM1.bdtr().read().moe()
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

/// The supply is under the level at which the timer cuts the motors.
pub fn supply_is_low() -> bool {
    pac::PWR.csr1().read().pvdo()
}

/// The stop input is open.
pub fn stop_is_open() -> bool {
    pac::GPIOE.idr().read().idr(STOP_PIN) == pac::gpio::vals::Idr::HIGH
}

impl Motors {
    /// Takes the timer and its pins; outputs stay off.
    pub fn new(_timer: Peri<'static, TIM1>, pins: Pins) -> Self {
        watch_processor_and_supply();
        let period = set_up_timer();
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
            period,
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
            // Duty is 0 to 1: at most `period`, which fits 16 bits.
            let compare = (setpoint.duty * self.period as f32) as u16;
            pac::TIM1.ccr(axis).write(|w| w.set_ccr(compare));
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
            pac::TIM1.bdtr().modify(|w| w.set_moe(true));
        }
    }

    /// Outputs off, enable line low on return.
    pub fn off(&mut self) {
        self.live = false;
        release();
        for axis in 0..AXES {
            pac::TIM1.ccr(axis).write(|w| w.set_ccr(0));
        }
        cortex_m::asm::dsb();
    }

    /// The stop input is open, was open for a moment since the last call, or the hardware has cut the outputs for another reason.
    pub fn stopped(&mut self) -> bool {
        let flags = pac::TIM1.sr().read();
        let broke = flags.bif(0) || flags.sbif();
        if broke {
            clear_breaks();
        }
        let cut = self.live && !outputs_on();
        stop_is_open() || broke || cut
    }

    /// First of `motors` motors whose driver reports a fault; what is not connected reads as one.
    pub fn driver_fault(&self, motors: usize) -> Option<u8> {
        let faults = self.faults.iter().take(motors);
        { faults }.position(Input::is_low).map(|axis| axis as u8)
    }
}

/// Clears the break flags; those whose cause is still there stay set.
fn clear_breaks() {
    // Flags are cleared by writing 0; 1 leaves the others as they are.
    pac::TIM1.sr().write(|w| {
        w.0 = u32::MAX;
        w.set_bif(0, false);
        w.set_sbif(false);
    });
}

/// Lets a processor lock-up and a supply under 2.7 V act on the timer's break input, until the next reset.
fn watch_processor_and_supply() {
    pac::PWR.cr1().modify(|w| {
        w.set_pls(SUPPLY_LEVEL);
        w.set_pvde(true);
    });
    // SAFETY: SYSCFG is clocked since the HAL's `init`; write-once bits, nobody else writes this register.
    unsafe {
        SYSCFG_CFGR.write_volatile(SYSCFG_CFGR.read_volatile() | LOCKUP_BREAKS | SUPPLY_BREAKS);
    }
}

/// Sets TIM1 up with all outputs off; returns counts in a PWM period.
fn set_up_timer() -> u32 {
    rcc::enable_and_reset::<TIM1>();
    let period = rcc::frequency::<TIM1>().0 / PWM_HZ;
    let timer = pac::TIM1;
    // 240 MHz / 5 kHz = 48,000: fits 16 bits without a prescaler.
    timer.psc().write_value(0);
    timer.arr().write(|w| w.set_arr((period - 1) as u16));
    for axis in 0..AXES {
        timer.ccmr_output(axis / 2).modify(|w| {
            w.set_ocm(axis % 2, OcmGp::PWM_MODE1);
            w.set_ocpe(axis % 2, true);
        });
        timer.ccr(axis).write(|w| w.set_ccr(0));
    }
    timer
        .ccmr_output(ENABLE / 2)
        .modify(|w| w.set_ocm(ENABLE % 2, OcmGp::FORCE_ACTIVE));
    for channel in 0..=ENABLE {
        // Idle level low: what a break forces.
        timer.cr2().modify(|w| w.set_ois(channel, false));
        timer.ccer().modify(|w| {
            w.set_ccp(channel, false);
            w.set_cce(channel, true);
        });
    }
    timer.bdtr().write(|w| {
        w.set_moe(false);
        w.set_aoe(false);
        // Off means driven to the idle level, not floating.
        w.set_ossi(Ossi::IDLE_LEVEL);
        w.set_ossr(Ossr::IDLE_LEVEL);
        // No filter: the path from pin to outputs then needs no clock.
        w.set_bke(0, true);
        w.set_bkp(0, Bkp::ACTIVE_HIGH);
    });
    // In a write of its own, so that it freezes what the first one set.
    timer.bdtr().modify(|w| w.set_lock(Lock::LEVEL1));
    timer.cr1().modify(|w| {
        w.set_urs(Urs::COUNTER_ONLY);
        w.set_arpe(true);
    });
    timer.egr().write(|w| w.set_ug(true));
    timer.cr1().modify(|w| w.set_cen(true));
    period
}

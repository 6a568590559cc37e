//! TIM1 as a motor timer: channels 1–3 make the PWM of the set values, channel 4 the enable line, and a break input cuts all four.
//!
//! When the break input rises, the processor locks up or the supply falls under 2.7 V, the timer forces all four lines low within nanoseconds and without
//! any instruction. They stay low until software switches them on again, which does not take while the break input is high. `LOCK` level 1 keeps software
//! from changing the break settings until the next reset.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{OutputType, Pull, Speed};
use embassy_stm32::pac;
use embassy_stm32::pac::timer::vals::{Bkp, Lock, OcmGp, Ossi, Ossr, Urs};
use embassy_stm32::peripherals::TIM1;
use embassy_stm32::rcc;
use embassy_stm32::timer::simple_pwm::{PwmPin, PwmPinConfig};
use embassy_stm32::timer::{BkIn1, BreakInputPin, TimerChannel, TimerPin};

use crate::stop_input::StopInput;

/// Motors with a channel.
pub const MOTORS: usize = 3;
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

/// Port and number of the enable line's pin, for [`cut`].
pub type EnablePin = (pac::gpio::Gpio, usize);

/// Outputs off; [`MotorTimer::enable`] may switch them on again. For the stop handler.
pub fn release() {
    pac::TIM1.bdtr().modify(|w| w.set_moe(false));
}

/// Forces all outputs low, from any context, whatever state the program is in: through the timer, and the enable pin once more by itself.
/// Only a reset brings the enable line back.
pub fn cut((port, pin): EnablePin) {
    release();
    port.bsrr().write(|w| w.set_br(pin, true));
    port.moder()
        .modify(|w| w.set_moder(pin, pac::gpio::vals::Moder::OUTPUT));
    cortex_m::asm::dsb();
}

/// PWM and enable line are live.
pub fn outputs_on() -> bool {
    pac::TIM1.bdtr().read().moe()
}

/// The supply is under the level at which the timer cuts the motors.
pub fn supply_is_low() -> bool {
    pac::PWR.csr1().read().pvdo()
}

/// The timer, set up, with all outputs off at first.
pub struct MotorTimer {
    /// Counts in a PWM period.
    period: u32,
}

impl MotorTimer {
    /// Sets the timer up; a processor lock-up and a low supply act on it until the next reset.
    pub fn new(_timer: Peri<'static, TIM1>) -> Self {
        watch_processor_and_supply();
        Self {
            period: set_up_timer(),
        }
    }

    /// A PWM or enable line, by its channel.
    pub fn line<C: TimerChannel>(
        &self,
        pin: Peri<'static, impl TimerPin<TIM1, C>>,
    ) -> PwmPin<'static, TIM1, C> {
        let line = PwmPinConfig {
            output_type: OutputType::PushPull,
            speed: Speed::Medium,
            pull: Pull::Down,
        };
        PwmPin::new_with_config(pin, line)
    }

    /// The stop input: from here on its contact cuts the outputs.
    pub fn stop_input(&self, pin: Peri<'static, impl BreakInputPin<TIM1, BkIn1>>) -> StopInput {
        StopInput::new(pin)
    }

    /// Share of the period, 0 to 1, that a motor's line is high from the next period (200 µs) on.
    pub fn set_duty(&mut self, motor: usize, duty: f32) {
        // At most `period`, which fits 16 bits.
        let compare = (duty * self.period as f32) as u16;
        pac::TIM1.ccr(motor).write(|w| w.set_ccr(compare));
    }

    /// Switches the outputs on. Does not take while the break input is high. A break since the last [`Self::broke`] has left its flag.
    pub fn enable(&mut self) {
        pac::TIM1.bdtr().modify(|w| w.set_moe(true));
    }

    /// Outputs off, enable line low on return.
    pub fn off(&mut self) {
        release();
        for motor in 0..MOTORS {
            pac::TIM1.ccr(motor).write(|w| w.set_ccr(0));
        }
        cortex_m::asm::dsb();
    }

    /// The outputs were cut since the last call.
    pub fn broke(&mut self) -> bool {
        let flags = pac::TIM1.sr().read();
        let broke = flags.bif(0) || flags.sbif();
        if broke {
            clear_breaks();
        }
        broke
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
    for motor in 0..MOTORS {
        timer.ccmr_output(motor / 2).modify(|w| {
            w.set_ocm(motor % 2, OcmGp::PWM_MODE1);
            w.set_ocpe(motor % 2, true);
        });
        timer.ccr(motor).write(|w| w.set_ccr(0));
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

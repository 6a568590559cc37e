//! A quadrature encoder counted by a timer without the processor: on all four edges, its inputs with pull-ups for open-collector encoders.
//!
//! The inputs are filtered: a level must hold for 8 timer clocks (33 ns), so edges up to 10 MHz pass and spikes do not.

use embassy_stm32::Peri;
use embassy_stm32::gpio::Pull;
use embassy_stm32::pac::timer::TimGp16;
use embassy_stm32::pac::timer::vals::FilterValue;
use embassy_stm32::timer::qei::{Config, Qei, QeiMode};
use embassy_stm32::timer::{Ch1, Ch2, GeneralInstance4Channel, TimerPin};
use mortise_mechanism::encoder::Follower;

/// An encoder. It only counts: where it counts from is set by [`Self::restart`].
pub struct Encoder {
    registers: TimGp16,
    follower: Follower,
}

impl Encoder {
    /// Starts counting from 0.
    pub fn new<T: GeneralInstance4Channel>(
        timer: Peri<'static, T>,
        a: Peri<'static, impl TimerPin<T, Ch1>>,
        b: Peri<'static, impl TimerPin<T, Ch2>>,
    ) -> Self {
        let config = Config {
            ch1_pull: Pull::Up,
            ch2_pull: Pull::Up,
            mode: QeiMode::Mode3,
            auto_reload: u16::MAX,
        };
        // Dropped, it would disable timer and pins. They are taken, so nothing else uses them.
        core::mem::forget(Qei::new(timer, a, b, config));
        // SAFETY: the registers of a timer with four channels, of which those of a 16-bit timer are a part.
        let registers = unsafe { TimGp16::from_ptr(T::regs()) };
        // The HAL leaves the input filter off.
        for channel in 0..2 {
            registers
                .ccmr_input(0)
                .modify(|w| w.set_icf(channel, FilterValue::FCK_INT_N8));
        }
        Self {
            registers,
            follower: Follower::new(registers.cnt().read().cnt()),
        }
    }

    /// The count is 0 here.
    pub fn restart(&mut self) {
        self.follower.restart();
    }

    /// Counts since the start or the last [`Self::restart`]. Call before the timer has counted half its range, 32,768.
    pub fn read(&mut self) -> i32 {
        self.follower.follow(self.registers.cnt().read().cnt())
    }
}

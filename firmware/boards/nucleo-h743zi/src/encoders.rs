//! Three quadrature encoders, each counted by a timer without the processor.
//!
//! | encoder | timer | A | B |
//! |---|---|---|---|
//! | A (joint 1) | TIM4 | PD12 (D29) | PD13 (D28) |
//! | B (joint 2) | TIM3 | PB4 (D25) | PB5 (D22) |
//! | C (joint 3) | TIM8 | PC6 (D16) | PC7 (D21) |
//!
//! All four edges count. Inputs have pull-ups for open-collector encoders and are filtered: a level must hold for 8 timer clocks (33 ns), so edges up
//! to 10 MHz pass and spikes do not.

use embassy_stm32::Peri;
use embassy_stm32::gpio::Pull;
use embassy_stm32::pac;
use embassy_stm32::pac::timer::vals::FilterValue;
use embassy_stm32::peripherals::{PB4, PB5, PC6, PC7, PD12, PD13, TIM3, TIM4, TIM8};
use embassy_stm32::timer::qei::{Config, Qei, QeiMode};
use mortise_mechanism::encoder::Follower;
use nucleo_h743zi::drive::AXES;

/// Pins of the encoders, named as in the wiring table above.
pub struct Pins {
    pub base_a: Peri<'static, PD12>,
    pub base_b: Peri<'static, PD13>,
    pub upper_a: Peri<'static, PB4>,
    pub upper_b: Peri<'static, PB5>,
    pub lower_a: Peri<'static, PC6>,
    pub lower_b: Peri<'static, PC7>,
}

/// The three encoders. They only count: where they count from is set by [`Encoders::home`].
pub struct Encoders {
    base: Qei<'static, TIM4>,
    upper: Qei<'static, TIM3>,
    lower: Qei<'static, TIM8>,
    followers: [Follower; AXES],
}

impl Encoders {
    /// Starts counting from 0.
    pub fn new(
        base: Peri<'static, TIM4>,
        upper: Peri<'static, TIM3>,
        lower: Peri<'static, TIM8>,
        pins: Pins,
    ) -> Self {
        let config = Config {
            ch1_pull: Pull::Up,
            ch2_pull: Pull::Up,
            mode: QeiMode::Mode3,
            auto_reload: u16::MAX,
        };
        let base = Qei::new(base, pins.base_a, pins.base_b, config);
        let upper = Qei::new(upper, pins.upper_a, pins.upper_b, config);
        let lower = Qei::new(lower, pins.lower_a, pins.lower_b, config);
        // The HAL leaves the input filter off.
        for channel in 0..2 {
            let filter = FilterValue::FCK_INT_N8;
            pac::TIM4.ccmr_input(0).modify(|w| w.set_icf(channel, filter));
            pac::TIM3.ccmr_input(0).modify(|w| w.set_icf(channel, filter));
            pac::TIM8.ccmr_input(0).modify(|w| w.set_icf(channel, filter));
        }
        let followers = [base.count(), upper.count(), lower.count()].map(Follower::new);
        Self {
            base,
            upper,
            lower,
            followers,
        }
    }

    /// The mechanism stands in its home pose: all counts are 0.
    pub fn home(&mut self) {
        self.followers.iter_mut().for_each(Follower::restart);
    }

    /// Reads all three, close together (the counters run on).
    pub fn read(&mut self) -> [i32; AXES] {
        let raw = [self.base.count(), self.upper.count(), self.lower.count()];
        core::array::from_fn(|axis| self.followers[axis].follow(raw[axis]))
    }
}

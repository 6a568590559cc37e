//! The stop input: a break input of the motor timer, whose opening contact also raises an interrupt.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Pull};
use embassy_stm32::pac;
use embassy_stm32::peripherals::TIM1;
use embassy_stm32::timer::{BkIn1, BreakInputPin};

/// The pin, given to the timer, with a pull-up: an open contact reads high.
pub struct StopInput {
    line: StopLine,
    pin: Flex<'static>,
}

/// Port (0 = A) and number of a stop input's pin, for the interrupt.
#[derive(Clone, Copy)]
pub struct StopLine {
    port: u8,
    pin: u8,
}

impl StopInput {
    /// From here on the contact acts on the timer.
    pub(crate) fn new(pin: Peri<'static, impl BreakInputPin<TIM1, BkIn1>>) -> Self {
        let line = StopLine {
            port: pin.port(),
            pin: pin.pin(),
        };
        let function = pin.af_num();
        let mut pin = Flex::new(pin);
        pin.set_as_af_unchecked(function, AfType::input(Pull::Up));
        Self { line, pin }
    }

    /// The contact is open.
    pub fn is_open(&self) -> bool {
        self.pin.is_high()
    }

    /// The pin's place.
    pub fn line(&self) -> StopLine {
        self.line
    }
}

impl StopLine {
    /// Lets the opening contact raise the interrupt of its EXTI line, which watches the pin beside the timer that owns it.
    pub fn listen(self) {
        let pin = usize::from(self.pin);
        pac::SYSCFG
            .exticr(pin / 4)
            .modify(|w| w.set_exti(pin % 4, self.port));
        pac::EXTI.rtsr(0).modify(|w| w.set_line(pin, true));
        self.acknowledge();
        pac::EXTI.imr(0).modify(|w| w.set_line(pin, true));
    }

    /// Ends the interrupt.
    pub fn acknowledge(self) {
        // Written ones clear.
        pac::EXTI.pr(0).write(|w| w.set_line(usize::from(self.pin), true));
    }
}

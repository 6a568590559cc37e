//! The independent watchdog, and how it is given time for what stops the processor on purpose.

use embassy_stm32::pac;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};
use embassy_stm32::peripherals::IWDG1;
use embassy_stm32::{Peri, wdg};

/// It resets when so long no healthy tick has fed it: five ticks.
const PERIOD_US: u32 = 5_000;
/// While a description is erased: the longest, 4096 · 256 periods of its 32 kHz, 33 s.
const PATIENT: (Pr, u16) = (Pr::DIVIDE_BY256, 0xfff);

/// The watchdog at work.
pub struct Watchdog(wdg::IndependentWatchdog<'static, IWDG1>);

impl Watchdog {
    /// Starts it. Only a reset ends it.
    pub fn start(timer: Peri<'static, IWDG1>) -> Self {
        let mut watchdog = wdg::IndependentWatchdog::new(timer, PERIOD_US);
        watchdog.unleash();
        Self(watchdog)
    }

    /// A healthy tick has run.
    pub fn feed(&mut self) {
        self.0.pet();
    }
}

/// Does `work`, which may stop the processor for seconds, under the longest period. The watchdog must be at work, the motors off. Before and after `work`
/// the tick goes on feeding it.
pub fn patiently<T>(work: impl FnOnce() -> T) -> T {
    let (divider, reload) = (pac::IWDG1.pr().read().pr(), pac::IWDG1.rlr().read().rl());
    set(PATIENT.0, PATIENT.1);
    let done = work();
    set(divider, reload);
    done
}

/// Another period, in effect on return and from its beginning.
fn set(divider: Pr, reload: u16) {
    let watchdog = pac::IWDG1;
    // Feeding closes the registers again: no tick may come between.
    cortex_m::interrupt::free(|_| {
        watchdog.kr().write(|w| w.set_key(Key::ENABLE));
        watchdog.pr().write(|w| w.set_pr(divider));
        watchdog.rlr().write(|w| w.set_rl(reload));
    });
    // Some periods of its slow clock, below a millisecond at the short period.
    while {
        let status = watchdog.sr().read();
        status.pvu() || status.rvu()
    } {}
    watchdog.kr().write(|w| w.set_key(Key::RESET));
}

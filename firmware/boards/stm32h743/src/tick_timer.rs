//! The 1 kHz timer and what it says about time: when a tick was due, what it cost, how many deadlines passed.
//!
//! TIM7 gives the interrupt, the processor's cycle counter (DWT) measures. At the interrupt the timer's count says how long ago the tick was due,
//! to 8 cycles; from there the cycle counter runs on, so a cost includes the interrupt's latency and may exceed the period.

use core::num::NonZeroU32;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::{DCB, DWT};
use embassy_stm32::pac;
use embassy_stm32::pac::timer::vals::Urs;
use embassy_stm32::peripherals::TIM7;
use embassy_stm32::{Peri, rcc};
use mortise_firmware::board::{Clock, TICK_HZ};

/// Timer clock divider: a period of 60,000 counts at 240 MHz.
const DIVIDER: u32 = 4;

/// The last tick was not done when the next was due. Written at a tick's end, read at the next one's start.
static OVERRAN: AtomicBool = AtomicBool::new(false);
/// Ticks were left out on purpose since the last that began.
static SKIPPED: AtomicBool = AtomicBool::new(true);

/// The application's clock: processor cycles since the running tick was due.
pub struct Cycles {
    cycles_per_count: u32,
    cycles_per_tick: NonZeroU32,
    due: u32,
}

impl Cycles {
    /// Sets timer and cycle counter up, timer stopped.
    pub fn new(_timer: Peri<'static, TIM7>, core_hz: u32, dcb: &mut DCB, dwt: &mut DWT) -> Self {
        dcb.enable_trace();
        // A Cortex-M7 keeps the counter locked until reported otherwise.
        DWT::unlock();
        dwt.enable_cycle_counter();

        rcc::enable_and_reset::<TIM7>();
        let timer_hz = rcc::frequency::<TIM7>().0;
        let timer = pac::TIM7;
        // 3 and 59,999: both fit 16 bits.
        timer.psc().write_value((DIVIDER - 1) as u16);
        let counts = timer_hz / DIVIDER / u32::from(TICK_HZ);
        timer.arr().write(|w| w.set_arr((counts - 1) as u16));
        timer.cr1().modify(|w| w.set_urs(Urs::COUNTER_ONLY));
        timer.egr().write(|w| w.set_ug(true));
        timer.dier().modify(|w| w.set_uie(true));
        Self {
            cycles_per_count: core_hz / timer_hz * DIVIDER,
            // Some 480,000.
            cycles_per_tick: NonZeroU32::new(core_hz / u32::from(TICK_HZ)).unwrap_or(NonZeroU32::MIN),
            due: 0,
        }
    }
}

/// Starts ticking. The first interrupt comes a period later.
pub fn start() {
    pac::TIM7.cr1().modify(|w| w.set_cen(true));
}

/// First thing in the tick: the interrupt is being served.
pub fn acknowledge() {
    pac::TIM7.sr().write(|w| w.set_uif(false));
}

/// Last thing in the tick: notes whether the next was due meanwhile.
pub fn finish() {
    OVERRAN.store(pac::TIM7.sr().read().uif(), Ordering::Relaxed);
}

/// This tick is left out on purpose (flash is being erased, motors off): no deadline passed.
pub fn skip() {
    SKIPPED.store(true, Ordering::Relaxed);
}

impl Clock for Cycles {
    fn begin(&mut self) -> u32 {
        let now = DWT::cycle_count();
        let late = u32::from(pac::TIM7.cnt().read().cnt()) * self.cycles_per_count;
        let due = now.wrapping_sub(late);
        let since = due.wrapping_sub(self.due);
        self.due = due;
        if SKIPPED.swap(false, Ordering::Relaxed) {
            return 0;
        }
        // Rounded: the count is read some cycles after the cycle counter.
        let periods = since.saturating_add(self.cycles_per_tick.get() / 2) / self.cycles_per_tick;
        u32::from(OVERRAN.load(Ordering::Relaxed)) + periods.saturating_sub(1)
    }

    fn cost(&mut self) -> u32 {
        DWT::cycle_count().wrapping_sub(self.due)
    }
}

//! The millisecond and what it costs.
//!
//! Both timers count 25 MHz of virtual time. With `-icount shift=1` an instruction takes 2 ns, so a count is 20 instructions and a
//! tick has 500,000; without `-icount` virtual time follows the host and the figure means host time in units of 2 ns.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use mortise_firmware::board::{Clock, TICK_HZ};

use crate::deadlines::Deadlines;
use crate::registers::Registers;

/// Timer counts in a second.
const TIMER_HZ: u32 = 25_000_000;
/// Timer counts in a tick.
const PERIOD: u32 = TIMER_HZ / TICK_HZ as u32;
/// Instructions in a timer count at shift 1.
const INSTRUCTIONS: u32 = 20;
/// Instructions in a tick at shift 1.
pub const BUDGET: u32 = PERIOD * INSTRUCTIONS;

const CTRL: usize = 0x0;
const VALUE: usize = 0x4;
const RELOAD: usize = 0x8;
const CLEAR: usize = 0xc;
const ENABLE: u32 = 1;
const INTERRUPT: u32 = 1 << 3;

/// The timers stand still, and begin again with the next tick.
static STOPPED: AtomicBool = AtomicBool::new(true);
/// They began again: time is 0 and a tick is due.
static BEGUN: AtomicBool = AtomicBool::new(false);

/// Starts the ticks: time is 0 and a tick is due now, the next one period later.
pub fn start() {
    let (tick, free) = (Registers::TIMER0, Registers::TIMER1);
    // No reload: each tick arms the next, see `arm`.
    tick.write::<RELOAD>(0);
    tick.write::<VALUE>(PERIOD);
    free.write::<RELOAD>(u32::MAX);
    free.write::<VALUE>(u32::MAX);
    free.write::<CTRL>(ENABLE);
    tick.write::<CTRL>(ENABLE | INTERRUPT);
    BEGUN.store(true, Ordering::Release);
    STOPPED.store(false, Ordering::Release);
}

/// Stops the ticks: lockstep waits for the host. With no timer running QEMU sleeps instead of racing through virtual time, which leaves the
/// host's processor to the host.
pub fn stop() {
    Registers::TIMER0.write::<CTRL>(0);
    Registers::TIMER1.write::<CTRL>(0);
    STOPPED.store(true, Ordering::Release);
}

/// Whether the ticks are stopped.
pub fn is_stopped() -> bool {
    STOPPED.load(Ordering::Acquire)
}

/// Has the next tick come when the free timer reads `at`, or at once when that has passed.
///
/// Not by reloading: QEMU sets a reloading timer anew before it raises the interrupt, and with `sleep=off` a sleeping processor's time then
/// leaps to the timer's next end as well (`timerlist_rearm`), so that every other tick would be lost.
fn arm(at: u32) {
    let left = at.wrapping_sub(now()) as i32;
    Registers::TIMER0.write::<VALUE>(left.max(1) as u32);
}

/// Takes the tick's interrupt back.
pub fn clear_interrupt() {
    Registers::TIMER0.write::<CLEAR>(1);
}

/// Counts up from [`start`], wraps after 171 s.
fn now() -> u32 {
    // The timer counts down.
    u32::MAX - Registers::TIMER1.read::<VALUE>()
}

/// Ticks run since start.
static MILLISECONDS: AtomicU32 = AtomicU32::new(0);

/// A tick has run.
pub fn count_tick() {
    MILLISECONDS.fetch_add(1, Ordering::Relaxed);
}

/// Ticks run since start, for the log's timestamps.
pub fn milliseconds() -> u32 {
    MILLISECONDS.load(Ordering::Relaxed)
}

/// The application's clock: instructions since the running tick was due.
pub struct TickClock(Deadlines<PERIOD>);

impl TickClock {
    /// For ticks that [`start`] begins.
    pub const fn new() -> Self {
        Self(Deadlines::new())
    }
}

impl Default for TickClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for TickClock {
    fn begin(&mut self) -> u32 {
        if BEGUN.swap(false, Ordering::AcqRel) {
            // `start` has armed the next.
            self.0 = Deadlines::new();
            return 0;
        }
        let missed = self.0.begin(now());
        arm(self.0.next());
        missed
    }

    fn cost(&mut self) -> u32 {
        self.0.cost(now()).saturating_mul(INSTRUCTIONS)
    }
}

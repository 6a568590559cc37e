//! The idle loop: polls an embassy executor at the lowest priority and sleeps between interrupts.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_executor::Spawner;
use embassy_executor::raw::Executor;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use static_cell::StaticCell;

/// The executor has work.
static PENDING: AtomicBool = AtomicBool::new(true);
/// See [`note`].
static NOTED: AtomicBool = AtomicBool::new(false);
/// Something may have happened that concerns the link: set after [`note`], by the idle loop.
pub static WAKE: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// Called by the executor's wakers, also from interrupts.
// SAFETY: the name and signature embassy-executor calls; defined once.
#[unsafe(export_name = "__pender")]
fn pender(_context: *mut ()) {
    PENDING.store(true, Ordering::Release);
}

/// Something happened that may concern the link: a tick, a byte, an empty sender. One store, for interrupts above critical sections: a waker would need
/// one.
pub fn note() {
    NOTED.store(true, Ordering::Release);
}

/// Runs for ever, once, in the idle task. `begin` spawns the tasks.
pub fn run(begin: impl FnOnce(Spawner)) -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    let executor = EXECUTOR.init_with(|| Executor::new(core::ptr::null_mut()));
    begin(executor.spawner());
    loop {
        if NOTED.swap(false, Ordering::AcqRel) {
            WAKE.signal(());
        }
        PENDING.store(false, Ordering::Release);
        // SAFETY: only here, never from within a task; `pender` only sets a flag.
        unsafe { executor.poll() };
        // With interrupts masked nothing can come between the check and the sleep; a pending interrupt still ends the sleep.
        cortex_m::interrupt::free(|_| {
            if !PENDING.load(Ordering::Acquire) && !NOTED.load(Ordering::Acquire) {
                cortex_m::asm::wfi();
            }
        });
    }
}

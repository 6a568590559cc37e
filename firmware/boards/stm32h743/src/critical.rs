//! Critical sections that hold back everything except the tick and the stop input.
//!
//! The usual implementation masks all interrupts, so that a long section anywhere (USB, log) delays the tick. This one raises BASEPRI to the
//! level just below the tick. The price is a rule: **the tick and the stop handler use no critical section** and nothing that has
//! one inside (embassy wakers, defmt); they talk to the rest through atomics and single-producer queues only. Breaking the rule is a panic, which
//! turns the motors off, not a silent race.

use core::arch::asm;

use critical_section::RawRestoreState;
use embassy_stm32::pac::Interrupt;

/// RTIC priority of the stop input: hardware level 0.
pub const STOP_PRIORITY: u8 = 16;
/// RTIC priority of the tick: hardware level 1.
pub const TICK_PRIORITY: u8 = 15;
/// Exception numbers of the two, as IPSR shows them.
const ABOVE: [u32; 2] = [16 + Interrupt::TIM7 as u32, 16 + Interrupt::EXTI15_10 as u32];
/// BASEPRI that masks hardware levels 2 and below; the chip has the upper 4 bits.
const MASK: u8 = 2 << 4;

struct BelowTick;
critical_section::set_impl!(BelowTick);

// SAFETY: single core; all users run at hardware level 2 or lower (see the module's rule), so raising BASEPRI to level 2 keeps every other user out
// until it is restored. Sections nest because the old value is restored. Compiler fences: `asm!` without `nomem`.
unsafe impl critical_section::Impl for BelowTick {
    // SAFETY: see the `impl`.
    unsafe fn acquire() -> RawRestoreState {
        let (old, running): (u32, u32);
        // BASEPRI_MAX only raises the mask. The barrier makes it effective before the next instruction.
        // SAFETY: reads and raises BASEPRI and reads IPSR; no memory, no stack, no flags.
        unsafe {
            asm!(
                "mrs {old}, BASEPRI",
                "msr BASEPRI_MAX, {mask}",
                "isb",
                "mrs {running}, IPSR",
                old = out(reg) old,
                running = out(reg) running,
                mask = in(reg) u32::from(MASK),
                options(nostack, preserves_flags),
            );
        }
        assert!(!ABOVE.contains(&running), "critical section above BASEPRI");
        old as u8
    }

    // SAFETY: the caller passes what `acquire` returned, in reverse order of nesting.
    unsafe fn release(old: RawRestoreState) {
        // SAFETY: restores the BASEPRI that `acquire` read; no memory, no stack, no flags.
        unsafe {
            asm!("msr BASEPRI, {old}", old = in(reg) u32::from(old), options(nostack, preserves_flags));
        }
    }
}

//! When the firmware fails: motors off first, then keep the reason where a reset does not clear it, then reset.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::{read_volatile, write_volatile};

use cortex_m::peripheral::SCB;
use cortex_m_rt::ExceptionFrame;
use mortise_protocol::message::ResetReason;

use crate::motors;

/// Says that the rest is a reason and not what was in RAM at power-on.
const MAGIC: u32 = 0x6d6f_7274;

#[repr(C)]
#[derive(Clone, Copy)]
struct Reason {
    magic: u32,
    kind: u32,
    /// Source line of a panic, address of the instruction that faulted.
    place: u32,
    /// Complement of the sum of the others.
    check: u32,
}

const REQUESTED: u32 = 1;
const PANIC: u32 = 2;
const HARD_FAULT: u32 = 3;

// SAFETY: the section exists in the linker script and start-up leaves it alone; every bit pattern is a valid `MaybeUninit`.
#[unsafe(link_section = ".uninit.REASON")]
static mut REASON: MaybeUninit<Reason> = MaybeUninit::uninit();

/// Starts since power-on, and the complement that says so.
// SAFETY: as above.
#[unsafe(link_section = ".uninit.STARTS")]
static mut STARTS: MaybeUninit<[u32; 2]> = MaybeUninit::uninit();

fn check(kind: u32, place: u32) -> u32 {
    !MAGIC.wrapping_add(kind).wrapping_add(place)
}

fn keep(kind: u32, place: u32) {
    let reason = Reason {
        magic: MAGIC,
        kind,
        place,
        check: check(kind, place),
    };
    // SAFETY: called where nothing else runs any more, or by the one task that restarts; read only at start.
    unsafe { write_volatile((&raw mut REASON).cast::<Reason>(), reason) };
}

/// Why the board started; asking forgets it. Call once, first thing.
pub fn reset_reason() -> ResetReason {
    // SAFETY: plain words, every pattern is valid; nothing else runs yet.
    let reason = unsafe { read_volatile((&raw const REASON).cast::<Reason>()) };
    // SAFETY: as above.
    unsafe { write_volatile((&raw mut REASON).cast::<u32>(), 0) };
    if reason.magic != MAGIC || reason.check != check(reason.kind, reason.place) {
        return ResetReason::PowerOn;
    }
    match reason.kind {
        REQUESTED => ResetReason::Requested,
        PANIC => ResetReason::Panic { line: reason.place },
        HARD_FAULT => ResetReason::HardFault { pc: reason.place },
        _ => ResetReason::Unknown,
    }
}

/// Starts since power-on, this one included. Call once.
pub fn starts() -> u32 {
    // SAFETY: plain words, every pattern is valid; nothing else runs yet.
    let [starts, check] = unsafe { read_volatile((&raw const STARTS).cast::<[u32; 2]>()) };
    let starts = if check == !starts {
        starts.wrapping_add(1)
    } else {
        1
    };
    // SAFETY: as above.
    unsafe { write_volatile((&raw mut STARTS).cast::<[u32; 2]>(), [starts, !starts]) };
    starts
}

/// Restarts because the host asked.
pub fn restart() -> ! {
    motors::off();
    keep(REQUESTED, 0);
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    motors::off();
    cortex_m::interrupt::disable();
    keep(PANIC, info.location().map_or(0, |l| l.line()));
    SCB::sys_reset()
}

// SAFETY: only the processor calls it; it touches registers and `REASON`, and never returns to what it interrupted.
#[cortex_m_rt::exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    motors::off();
    keep(HARD_FAULT, frame.pc());
    SCB::sys_reset()
}

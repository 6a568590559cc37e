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

#[unsafe(link_section = ".uninit.REASON")]
static mut REASON: MaybeUninit<Reason> = MaybeUninit::uninit();

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

#[cortex_m_rt::exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    motors::off();
    keep(HARD_FAULT, frame.pc());
    SCB::sys_reset()
}

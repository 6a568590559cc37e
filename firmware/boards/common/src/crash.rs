//! What happens when the firmware fails: motors off, a record that survives, restart.
//!
//! Two ways in: a Rust panic, and a processor fault (hard fault, or any exception nobody handles). The order is always motors first; the record
//! second; reset last. A restart that the host asked for takes the same way out.

use core::arch::naked_asm;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::{read_volatile, write_volatile};

use cortex_m::asm::dsb;
use cortex_m::peripheral::SCB;

use crate::record::{Crash, CrashRecord, RECORD_WORDS, crash, record};

// SAFETY: the board defines it, without arguments and result; it may be called from any context.
unsafe extern "Rust" {
    /// The board's hook: all motors off on return, from any context, whatever state the program is in.
    safe fn mortise_cut_motors();
}

/// Record and one spare word. The memory's error correction holds back the last write until the next one: the spare takes that place.
// SAFETY: the section exists in every board's memory.x and start-up leaves it alone; every bit pattern is a valid `MaybeUninit`.
#[unsafe(link_section = ".crash.record")]
static mut RECORD: MaybeUninit<[u32; RECORD_WORDS + 1]> = MaybeUninit::uninit();

/// Takes the record of the last crash, if there is one, and clears it. Once, in `init`.
///
/// After power-on (`memory_is_new`) nothing is read: memory never written has no valid error correction.
pub fn take(memory_is_new: bool) -> Option<Crash> {
    let mut words: CrashRecord = [0; RECORD_WORDS];
    let place = (&raw mut RECORD).cast::<u32>();
    for (i, word) in words.iter_mut().enumerate() {
        // SAFETY: inside RECORD; any bits are a u32. Nothing else runs yet.
        unsafe {
            if !memory_is_new {
                *word = read_volatile(place.add(i));
            }
            write_volatile(place.add(i), 0);
        }
    }
    crash(words)
}

fn die(cause: Crash) -> ! {
    let place = (&raw mut RECORD).cast::<u32>();
    for (i, word) in record(cause).into_iter().chain([0]).enumerate() {
        // SAFETY: inside RECORD, RECORD_WORDS + 1 words long; no other code runs any more.
        unsafe { write_volatile(place.add(i), word) };
    }
    dsb();
    SCB::sys_reset()
}

/// Restarts because the host asked.
pub fn restart() -> ! {
    mortise_cut_motors();
    die(Crash::Requested)
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    mortise_cut_motors();
    cortex_m::interrupt::disable();
    die(Crash::Panic {
        line: info.location().map_or(0, |at| at.line()),
    })
}

/// Hard fault. Bus, memory and usage faults escalate here.
///
/// Naked: after a stack overflow the first push of an ordinary function would fault again and lock the processor up. The stack starts anew; nothing
/// returns.
// SAFETY: the name cortex-m-rt puts into the vector table. Only the processor calls it; it needs no stack before it sets a new one, and does not
// return.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        "mrs r0, MSP",
        "movw r1, #:lower16:_stack_start",
        "movt r1, #:upper16:_stack_start",
        "msr MSP, r1",
        "b {fault}",
        fault = sym fault,
    )
}

/// Exceptions nobody handles: an NMI (clock or memory failure), an interrupt that should not be enabled.
// SAFETY: the name cortex-m-rt puts into the vector table; only the processor calls it, and it does not return.
#[unsafe(no_mangle)]
unsafe extern "C" fn DefaultHandler() -> ! {
    // SAFETY: a null frame lies outside the stack, so `fault` does not read it.
    unsafe { fault(core::ptr::null()) }
}

/// `frame`: the stack pointer at the fault, whose sixth word is the faulting instruction's address if the stack still held.
///
/// # Safety
/// Nothing else may run afterwards. Any `frame` is allowed: one outside the stack is not read.
unsafe extern "C" fn fault(frame: *const u32) -> ! {
    mortise_cut_motors();
    // SAFETY: symbols of the linker script; only their addresses are used.
    unsafe extern "C" {
        static _stack_end: u32;
        static _stack_start: u32;
    }
    /// Words the processor pushes: r0–r3, r12, lr, pc, xpsr.
    const FRAME_WORDS: usize = 8;
    const PC: usize = 6;
    let (low, high) = (&raw const _stack_end, &raw const _stack_start);
    let readable = frame >= low && frame.wrapping_add(FRAME_WORDS) <= high;
    // SAFETY: inside the stack's memory, checked above; SCB registers are always readable.
    let (pc, status) = unsafe {
        let pc = if readable { read_volatile(frame.add(PC)) } else { 0 };
        (pc, (*SCB::PTR).cfsr.read())
    };
    die(Crash::HardFault { pc, status })
}

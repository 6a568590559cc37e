//! Memory protection, caches, stack measurement.
//!
//! | region | what | access |
//! |---|---|---|
//! | 0 | external memory space 0x6000_0000–0xdfff_ffff (nothing is there) | none: no speculative reads either (ST AN4838) |
//! | 1 | 0x0000_0000, 64 KiB instruction RAM, unused | none: a null pointer faults |
//! | 2 | last 256 bytes of the stack | none: an overflow faults |
//! | 3 | flash bank 2 (scenes) | read-only, cached; see [`Access`] |
//! | 4 | last two sectors of bank 1 (descriptions) | likewise |
//!
//! No DMA is used (USB moves its data through the OTG FIFO with the processor), so no memory needs to be uncached for that.

use cortex_m::Peripherals;
use cortex_m::asm::{dsb, isb};
use cortex_m::peripheral::{MPU, SCB};
use nucleo_h743zi::flash_map::{self, Bank};

/// RASR: execute never.
const NEVER_EXECUTE: u32 = 1 << 28;
const NO_ACCESS: u32 = 0b000 << 24;
const READ_WRITE: u32 = 0b001 << 24;
const READ_ONLY: u32 = 0b101 << 24;
/// TEX=0 C=1 B=0: normal memory, write-through.
const CACHED: u32 = 0b10 << 16;
/// TEX=1 C=0 B=0: normal memory, not cached.
const UNCACHED: u32 = 0b001 << 19;
/// TEX=0 C=0 B=1: device memory, no speculative access.
const DEVICE: u32 = 0b01 << 16;

/// RBAR.VALID: the write also selects the region.
const VALID: u32 = 1 << 4;

/// How the slots in a bank of the flash may be reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Cached, read-only: a stray write faults.
    Read,
    /// Uncached and writable: a flash word is being programmed. Reads wait for it, about 0.1 ms.
    Program,
    /// Device memory: a sector is being erased, up to 2 s. Nobody may read, not even speculatively, or the processor stops with it.
    Erase,
}

const fn size(bytes: u64) -> u32 {
    (bytes.ilog2() - 1) << 1
}

fn set_region(number: u32, base: u32, attributes: u32) {
    // SAFETY: writes two registers of the MPU; what a region means is argued where it is set. Callers run in `init` or in the link's
    // context; neither the tick nor an interrupt touches the MPU.
    unsafe {
        let mpu = &*MPU::PTR;
        mpu.rbar.write(base | VALID | number);
        mpu.rasr.write(attributes | 1);
    }
}

/// Sets how the slots in `bank` may be reached, in effect on return.
pub fn set_access(bank: Bank, how: Access) {
    let attributes = match how {
        Access::Read => READ_ONLY | CACHED,
        Access::Program => READ_WRITE | UNCACHED,
        Access::Erase => READ_WRITE | DEVICE,
    };
    let (region, start, length) = match bank {
        Bank::Two => (3, flash_map::BANK_2, flash_map::BANK_LENGTH),
        Bank::One => (4, flash_map::RIGS, flash_map::RIGS_LENGTH),
    };
    dsb();
    set_region(region, start, attributes | NEVER_EXECUTE | size(length.into()));
    dsb();
    isb();
}

/// Protects memory and switches both caches on. Once, first thing in `init`.
pub fn protect_and_cache(core: &mut Peripherals) {
    // SAFETY: symbols of the linker script; only their addresses are used.
    unsafe extern "C" {
        static _stack_end: u32;
    }
    // The guard lies under `_stack_end` (memory.x).
    let guard = (&raw const _stack_end) as u32 - 256;

    // Subregions 0–2 and 7 of the 4 GiB are left to the other regions and the default map.
    set_region(
        0,
        0,
        NO_ACCESS | NEVER_EXECUTE | DEVICE | (0x87 << 8) | size(1 << 32),
    );
    set_region(1, 0, NO_ACCESS | NEVER_EXECUTE | DEVICE | size(64 * 1024));
    set_region(2, guard, NO_ACCESS | NEVER_EXECUTE | UNCACHED | size(256));
    set_access(Bank::One, Access::Read);
    set_access(Bank::Two, Access::Read);
    // SAFETY: regions are set; everything else keeps the default map (PRIVDEFENA), which is what the program was linked for.
    unsafe { core.MPU.ctrl.write(0b101) };
    dsb();
    isb();

    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);
}

/// Drops cached lines of `length` bytes from `address`, both multiples of 32, after flash changed under them.
pub fn forget(address: u32, length: u32) {
    // SAFETY: all slots are write-through or uncached, so no line of them is dirty and nothing is lost.
    unsafe {
        let mut scb: SCB = core::mem::transmute(());
        scb.invalidate_dcache_by_address(address as usize, length as usize);
    }
}

/// Paints the free part of the stack anew, so that [`deepest_stack`] leaves out what start-up needed (it moves large values about). Once, when `idle`
/// begins. Interrupts are off for about 0.1 ms.
pub fn repaint_stack() {
    // SAFETY: symbols of the linker script; only their addresses are used.
    unsafe extern "C" {
        static _stack_end: u32;
    }
    /// Left unpainted under the stack pointer, bytes: this function's own needs.
    const MARGIN: u32 = 256;
    cortex_m::interrupt::free(|_| {
        let end = cortex_m::register::msp::read() - MARGIN;
        let mut at = (&raw const _stack_end) as u32;
        while at < end {
            // SAFETY: below the stack pointer and above the guard: nobody's memory while no interrupt can come.
            unsafe { (at as *mut u32).write_volatile(cortex_m_rt::STACK_PAINT_VALUE) };
            at += 4;
        }
    });
}

/// Deepest the stack has been since [`repaint_stack`], bytes: looks for paint.
pub fn deepest_stack() -> u32 {
    // SAFETY: symbols of the linker script; only their addresses are used.
    unsafe extern "C" {
        static _stack_end: u32;
        static _stack_start: u32;
    }
    let (end, start) = (
        (&raw const _stack_end) as usize,
        (&raw const _stack_start) as usize,
    );
    let mut at = end;
    // SAFETY: reads the stack's own memory, word by word, above the guard.
    while at < start && unsafe { (at as *const u32).read_volatile() } == cortex_m_rt::STACK_PAINT_VALUE {
        at += 4;
    }
    (start - at) as u32
}

//! Memory that survives a reset: external RAM standing in for the flash of a real board, and the count of starts.

use core::mem::MaybeUninit;
use core::ptr::{read_volatile, write_volatile};

use cortex_m::peripheral::MPU;
use mortise_firmware::board::{FlashWord, WRITE_SIZE};
use mortise_simulation::ram_flash::{ERASE_SIZE, RamFlash};

use crate::starts::{Counted, after_one_more};

/// Start of the external RAM (QEMU puts it here for AN500, at 0x21000000 for the other images of the board).
const PSRAM: usize = 0x6000_0000;
/// Start of the stack's memory, as in every board's memory.x.
const GUARD: u32 = 0x2000_0000;
/// Bytes in all slots: 2 MiB for each scene, and a sector for each of the rig's descriptions.
const SLOTS_SIZE: usize = 2 * (2 * 1024 * 1024 + ERASE_SIZE);

/// The scene slots. Call once.
///
/// # Safety
/// A second call would alias the memory.
pub unsafe fn scene_flash() -> RamFlash<'static> {
    // SAFETY: 16 MiB of RAM that nothing else uses (memory.x does not name it), aligned, any bit pattern is a byte.
    let words = unsafe { core::slice::from_raw_parts_mut(PSRAM as *mut FlashWord, SLOTS_SIZE / WRITE_SIZE) };
    RamFlash::new(words)
}

/// Makes the lowest 256 bytes of the stack's memory forbidden: an overflow is a fault, not a corrupted return address. (QEMU ignores
/// accesses to addresses where this board has nothing, so the end of the memory alone would not stop it.)
pub fn guard_stack(mpu: &mut MPU) {
    const VALID: u32 = 1 << 4;
    const SIZE_256: u32 = 7 << 1;
    const NO_ACCESS_NEVER_EXECUTE: u32 = 1 << 28;
    // Everything else as without an MPU.
    const ENABLE_WITH_DEFAULT_MAP: u32 = 0b101;
    // SAFETY: forbids memory below `_stack_end`, where nothing lies (memory.x).
    unsafe {
        mpu.rbar.write(GUARD | VALID);
        mpu.rasr.write(NO_ACCESS_NEVER_EXECUTE | SIZE_256 | 1);
        mpu.ctrl.write(ENABLE_WITH_DEFAULT_MAP);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// See [`crate::starts`].
// SAFETY: the section exists in the linker script and start-up leaves it alone; every bit pattern is a valid `MaybeUninit`.
#[unsafe(link_section = ".uninit.STARTS")]
static mut STARTS: MaybeUninit<Counted> = MaybeUninit::uninit();

/// Starts since power-on, this one included. Call once.
pub fn starts() -> u32 {
    let place = (&raw mut STARTS).cast::<Counted>();
    // SAFETY: plain words, every pattern is valid; nothing else runs yet.
    let counted = after_one_more(unsafe { read_volatile(place) });
    // SAFETY: as above.
    unsafe { write_volatile(place, counted) };
    counted[0]
}

//! Memory that survives a reset: external RAM standing in for the flash of a real board, and the stack's high-water mark.

use mortise_firmware::board::WRITE_SIZE;
use mortise_firmware::ram_flash::{FlashWord, RamFlash};

/// Start of the external RAM (QEMU puts it here for AN500, at 0x21000000 for the other images of the board).
const PSRAM: usize = 0x6000_0000;
/// Bytes in both scene slots: 2 MiB each.
const SLOTS_SIZE: usize = 2 * 2 * 1024 * 1024;

/// The scene slots. Call once.
///
/// # Safety
/// A second call would alias the memory.
pub unsafe fn scene_flash() -> RamFlash<'static> {
    // SAFETY: 16 MiB of RAM that nothing else uses (memory.x does not name it), aligned, any bit pattern is a byte.
    let words = unsafe { core::slice::from_raw_parts_mut(PSRAM as *mut FlashWord, SLOTS_SIZE / WRITE_SIZE) };
    RamFlash::new(words)
}

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Deepest stack since start, bytes: below it start-up's paint is untouched. Reads the unused part of the stack.
pub fn deepest_stack() -> u32 {
    let (top, mut word) = (&raw const _stack_start, &raw const _stack_end);
    // SAFETY: from the end of the stack's memory to its start, read only.
    unsafe {
        while word < top && word.read_volatile() == cortex_m_rt::STACK_PAINT_VALUE {
            word = word.add(1);
        }
        top.byte_offset_from_unsigned(word) as u32
    }
}

//! Flash in RAM with a flash's manners: bytes are erased in sectors to `0xff`, and a flash word is written once between two erasures.
//!
//! Used by the simulated rig (heap), the emulated board (external RAM that survives a reset) and the tests.

use core::marker::PhantomData;
use core::ptr::NonNull;

use crate::board::{Flash, FlashError, SLOTS, WRITE_SIZE};

/// Bytes erased at once, as on an STM32H743.
pub const ERASE_SIZE: usize = 128 * 1024;

/// One flash word, aligned as scenes need it.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub struct FlashWord(pub [u8; WRITE_SIZE]);

/// An erased word.
pub const ERASED: FlashWord = FlashWord([0xff; WRITE_SIZE]);

/// Two slots in RAM.
#[derive(Debug)]
pub struct RamFlash<'s> {
    memory: NonNull<FlashWord>,
    /// Bytes in a slot.
    capacity: usize,
    lifetime: PhantomData<&'s mut [FlashWord]>,
}

// SAFETY: `RamFlash` owns its memory exclusively for 's; plain bytes may move between threads.
unsafe impl Send for RamFlash<'_> {}

impl<'s> RamFlash<'s> {
    /// Both slots in `memory`, half each, rounded down to whole sectors. What is there is kept: it may be a scene from before a reset.
    pub fn new(memory: &'s mut [FlashWord]) -> Self {
        let slot = size_of_val(memory) / SLOTS;
        Self {
            capacity: slot - slot % ERASE_SIZE,
            memory: NonNull::from(memory).cast(),
            lifetime: PhantomData,
        }
    }

    fn word(&self, slot: usize, offset: usize) -> Result<NonNull<FlashWord>, FlashError> {
        if slot >= SLOTS || !offset.is_multiple_of(WRITE_SIZE) || offset >= self.capacity {
            return Err(FlashError);
        }
        let index = (slot * self.capacity + offset) / WRITE_SIZE;
        // SAFETY: below SLOTS · capacity bytes, which the memory has.
        Ok(unsafe { self.memory.add(index) })
    }
}

// SAFETY: FlashWord is aligned to WRITE_SIZE and capacity is a multiple of it, so both slots start aligned; the memory is borrowed for
// 's; only `erase` and `write` change it, each within its slot.
unsafe impl<'s> Flash<'s> for RamFlash<'s> {
    fn capacity(&self) -> usize {
        self.capacity
    }

    fn erase_size(&self) -> usize {
        ERASE_SIZE
    }

    unsafe fn slot(&self, slot: usize) -> &'s [u8] {
        debug_assert!(slot < SLOTS);
        // SAFETY: within the memory, initialised; the caller uses it for nothing while the slot changes.
        unsafe {
            let start = self.memory.cast::<u8>().add(slot * self.capacity);
            core::slice::from_raw_parts(start.as_ptr(), self.capacity)
        }
    }

    fn erase(&mut self, slot: usize, offset: usize) -> Result<(), FlashError> {
        if !offset.is_multiple_of(ERASE_SIZE) {
            return Err(FlashError);
        }
        let first = self.word(slot, offset)?;
        for i in 0..ERASE_SIZE / WRITE_SIZE {
            // SAFETY: capacity is a multiple of ERASE_SIZE, so the whole sector lies in the slot.
            unsafe { first.add(i).write(ERASED) };
        }
        Ok(())
    }

    fn write(&mut self, slot: usize, offset: usize, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
        let place = self.word(slot, offset)?;
        // SAFETY: inside the memory, and nobody else writes it.
        unsafe {
            if place.read().0 != ERASED.0 {
                return Err(FlashError);
            }
            place.write(FlashWord(*word));
        }
        Ok(())
    }
}

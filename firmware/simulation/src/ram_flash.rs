//! Flash in RAM with the semantics of flash: bytes are erased in sectors to `0xff`, and a flash word is written once between two erasures.
//!
//! Used by the simulated rig (heap), the emulated board (external RAM that survives a reset) and the tests.

use core::marker::PhantomData;
use core::ptr::NonNull;

use mortise_firmware::board::{ERASED, Flash, FlashError, FlashWord, RIG_SLOTS, SLOTS, WRITE_SIZE};

/// Bytes in an erasable sector, as on an STM32H743.
pub const ERASE_SIZE: usize = 128 * 1024;

/// Two scene slots in RAM, followed by two sectors for the rig's description.
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
    /// All slots in `memory`: two sectors at its end for the rig, half of the rest for each scene, rounded down to whole sectors. Existing content is
    /// kept: it may be from before a reset.
    pub fn new(memory: &'s mut [FlashWord]) -> Self {
        let slot = (size_of_val(memory) / SLOTS).saturating_sub(ERASE_SIZE);
        Self {
            capacity: slot - slot % ERASE_SIZE,
            memory: NonNull::from(memory).cast(),
            lifetime: PhantomData,
        }
    }

    fn word(&self, slot: usize, offset: usize) -> Result<NonNull<FlashWord>, FlashError> {
        let (start, length) = self.place(slot);
        if !offset.is_multiple_of(WRITE_SIZE) || offset >= length {
            return Err(FlashError);
        }
        // SAFETY: inside a slot, and all slots lie in the memory.
        Ok(unsafe { self.memory.add((start + offset) / WRITE_SIZE) })
    }

    /// First byte and length of a slot. Scenes first; the rig's slots exist when the scenes' do, because `new` takes both from the same halves.
    fn place(&self, slot: usize) -> (usize, usize) {
        if slot < SLOTS {
            (slot * self.capacity, self.capacity)
        } else if RIG_SLOTS.contains(&slot) && self.capacity > 0 {
            (SLOTS * self.capacity + (slot - SLOTS) * ERASE_SIZE, ERASE_SIZE)
        } else {
            (0, 0)
        }
    }
}

// SAFETY: FlashWord is aligned to WRITE_SIZE and capacity is a multiple of it, so all slots start aligned; the memory is borrowed for
// 's; only `erase` and `write` change it, each within its slot.
unsafe impl<'s> Flash<'s> for RamFlash<'s> {
    fn capacity(&self) -> usize {
        self.capacity
    }

    fn erase_size(&self) -> usize {
        ERASE_SIZE
    }

    // SAFETY: the trait's contract is the caller's: the slot is not written while the slice lives.
    unsafe fn slot(&self, slot: usize) -> &'s [u8] {
        let (start, length) = self.place(slot);
        // SAFETY: within the memory, initialised; the caller does not use it while the slot changes.
        unsafe { core::slice::from_raw_parts(self.memory.cast::<u8>().add(start).as_ptr(), length) }
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
        // SAFETY: inside the memory, and there is no other writer.
        unsafe {
            if place.read().0 != ERASED.0 {
                return Err(FlashError);
            }
            place.write(FlashWord(*word));
        }
        Ok(())
    }
}

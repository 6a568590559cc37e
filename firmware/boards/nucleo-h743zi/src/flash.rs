//! Scene slots in flash bank 2, erased and written while the program runs from bank 1.
//!
//! The HAL's flash driver is not used: on this chip it clears errors in the status register, where they cannot be cleared (they must be written to
//! FLASH_CCR), so that one error would refuse every later write, and it knows nothing of caches.
//!
//! - Erasing a sector takes up to 2 s, writing a word about 0.1 ms. Both wait here, at the lowest priority; the tick goes on.
//! - A read of bank 2 during an erasure would stop the processor until it is over. So [`erasing`] tells the tick to leave the control plane alone
//!   (motors are off then: the application stores scenes only so), and the bank is device memory meanwhile, which the processor does not read on
//!   speculation.
//! - A word whose writing was cut off by a power failure may fail its error correction for ever after, and reading it is a bus fault.
//!   [`SceneFlash::new`] looks for such words before anything else reads the slots, and erases their sectors.

use core::ptr::write_volatile;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::asm::{dsb, isb};
use cortex_m::peripheral::{DWT, SCB};
use embassy_stm32::Peri;
use embassy_stm32::pac;
use embassy_stm32::pac::flash::regs::Ccr;
use embassy_stm32::peripherals::FLASH;
use mortise_firmware::board::{Flash, FlashError, WRITE_SIZE};
use nucleo_h743zi::flash_map::{self, BANK_2, BANK_LENGTH, SECTOR, SLOT_LENGTH, WORD};

use crate::memory::{Bank2, forget, set_bank_2};

const _: () =
    assert!(WORD as usize == WRITE_SIZE && mortise_firmware::board::SLOTS as u32 == flash_map::SLOTS);

/// Keys of FLASH_KEYR2, from the reference manual.
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
/// Bank 2 in the register block.
const BANK: usize = 1;
/// FLASH_CR.PSIZE: 32 bits at once, right for 2.7–3.6 V.
const PARALLELISM: u8 = 2;
/// All error and end flags of FLASH_CCR: bits 16–19, 21–28.
const ALL_FLAGS: u32 = 0x1fef_0000;
/// FLASH_SR: write protection, sequence, strobe, inconsistency, operation. Errors of reads are not among them: they are no failure to write.
const ERRORS: u32 = 0x006e_0000;
/// FLASH_SR.DBECCERR: a word could not be corrected.
const UNCORRECTABLE: u32 = 1 << 26;
/// SCB_CCR.BFHFNMIGN: bus faults of loads are ignored while FAULTMASK is set.
const IGNORE_BUS_FAULTS: u32 = 1 << 8;

/// SCB_CFSR: the bus fault byte.
const BUS_FAULT_FLAGS: u32 = 0xff00;

/// A sector is being erased.
static ERASING: AtomicBool = AtomicBool::new(false);

/// A sector is being erased: the tick must not touch scenes, and the motors must be off.
pub fn erasing() -> bool {
    ERASING.load(Ordering::Relaxed)
}

/// Both scene slots.
pub struct SceneFlash {
    /// Cycles after which an erasure has failed: 5 s, the longest the data sheet gives is 4 s.
    erase_cycles: u32,
}

impl SceneFlash {
    /// Looks at every word of both slots; sectors with a word that cannot be read are erased, which loses a scene that was lost already.
    /// 0.5 ms when all is well. Call before the tick starts.
    pub fn new(_flash: Peri<'static, FLASH>, core_hz: u32) -> Self {
        let mut flash = Self {
            // 2.4·10⁹ fits 32 bits.
            erase_cycles: core_hz.saturating_mul(5),
        };
        for sector in (BANK_2..BANK_2 + BANK_LENGTH).step_by(SECTOR as usize) {
            // Twice: a fault of the moment must not cost a scene.
            if !readable(sector, SECTOR) && !readable(sector, SECTOR) {
                // A sector that cannot be erased stays unreadable; opening the store will then fault, and the record says where.
                let _ = flash.erase_sector(sector);
            }
        }
        flash
    }

    fn erase_sector(&mut self, address: u32) -> Result<(), FlashError> {
        ERASING.store(true, Ordering::Relaxed);
        set_bank_2(Bank2::Erase);
        let bank = pac::FLASH.bank(BANK);
        unlock();
        bank.cr().modify(|w| {
            w.set_psize(PARALLELISM);
            w.set_snb(flash_map::sector(address));
            w.set_ser(true);
        });
        bank.cr().modify(|w| w.set_start(true));
        let done = wait(self.erase_cycles);
        bank.cr().modify(|w| w.set_ser(false));
        lock();
        // Still device memory: nothing can be read into the cache in between.
        forget(address, SECTOR);
        set_bank_2(Bank2::Read);
        ERASING.store(false, Ordering::Relaxed);
        done
    }

    fn write_word(&mut self, address: u32, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
        set_bank_2(Bank2::Program);
        let bank = pac::FLASH.bank(BANK);
        unlock();
        bank.cr().modify(|w| {
            w.set_psize(PARALLELISM);
            w.set_pg(true);
        });
        isb();
        dsb();
        for (i, bytes) in word.chunks_exact(4).enumerate() {
            let value = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            // SAFETY: inside a slot of bank 2 (checked by the caller), writable now; the flash takes the eight words as one.
            unsafe { write_volatile((address as *mut u32).add(i), value) };
        }
        dsb();
        // Programming takes 0.1 ms, 0.5 ms at the worst: a hundredth of the time of an erasure is ample.
        let done = wait(self.erase_cycles / 100);
        bank.cr().modify(|w| w.set_pg(false));
        lock();
        forget(address, WORD);
        set_bank_2(Bank2::Read);
        done?;
        verify(address, word)
    }
}

// SAFETY: slots are aligned to sectors, in memory-mapped flash that lives as long as the program; only `erase` and `write` of the same slot change
// it.
unsafe impl Flash<'static> for SceneFlash {
    fn capacity(&self) -> usize {
        SLOT_LENGTH as usize
    }

    fn erase_size(&self) -> usize {
        SECTOR as usize
    }

    // SAFETY: the trait's contract is the caller's: the slot is not written while the slice lives.
    unsafe fn slot(&self, slot: usize) -> &'static [u8] {
        match flash_map::address(slot, 0, SLOT_LENGTH, SECTOR) {
            // SAFETY: a slot is SLOT_LENGTH bytes of flash.
            Ok(start) => unsafe { core::slice::from_raw_parts(start as *const u8, SLOT_LENGTH as usize) },
            Err(_) => &[],
        }
    }

    fn erase(&mut self, slot: usize, offset: usize) -> Result<(), FlashError> {
        let address = flash_map::address(slot, offset, SECTOR, SECTOR).map_err(|_| FlashError)?;
        self.erase_sector(address)
    }

    fn write(&mut self, slot: usize, offset: usize, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
        let address = flash_map::address(slot, offset, WORD, WORD).map_err(|_| FlashError)?;
        self.write_word(address, word)
    }
}

fn clear_flags() {
    pac::FLASH.bank(BANK).ccr().write_value(Ccr(ALL_FLAGS));
}

/// Bank 2 may be changed; errors left by reads are forgotten, or the next operation would be refused.
fn unlock() {
    clear_flags();
    let bank = pac::FLASH.bank(BANK);
    if bank.cr().read().lock() {
        for key in KEYS {
            bank.keyr().write_value(key);
        }
    }
}

fn lock() {
    pac::FLASH.bank(BANK).cr().modify(|w| w.set_lock(true));
}

/// Waits for the operation under way, at most `cycles`.
fn wait(cycles: u32) -> Result<(), FlashError> {
    let start = DWT::cycle_count();
    loop {
        let status = pac::FLASH.bank(BANK).sr().read();
        if !status.qw() && !status.bsy() {
            let failed = status.0 & ERRORS != 0;
            clear_flags();
            return if failed { Err(FlashError) } else { Ok(()) };
        }
        if DWT::cycle_count().wrapping_sub(start) > cycles {
            return Err(FlashError);
        }
    }
}

/// Runs `read` with bus faults of loads ignored; whether the flash met no word it could not correct.
fn guarded(read: impl FnOnce()) -> bool {
    clear_flags();
    // SAFETY: the register belongs to nobody else; FAULTMASK keeps every handler out, so nothing sees the half-set state.
    unsafe {
        core::arch::asm!("cpsid f", options(nostack, preserves_flags));
        let scb = &*SCB::PTR;
        scb.ccr.modify(|w| w | IGNORE_BUS_FAULTS);
        dsb();
        isb();
        read();
        dsb();
        scb.ccr.modify(|w| w & !IGNORE_BUS_FAULTS);
        // Written ones clear: a later crash must not show an old bus fault.
        scb.cfsr.write(BUS_FAULT_FLAGS);
        dsb();
        isb();
        core::arch::asm!("cpsie f", options(nostack, preserves_flags));
    }
    let sound = pac::FLASH.bank(BANK).sr().read().0 & UNCORRECTABLE == 0;
    clear_flags();
    sound
}

/// Whether every flash word of this piece of bank 2 can be read. Holds off all interrupts for about 15 ns a word.
fn readable(address: u32, length: u32) -> bool {
    guarded(|| {
        for word in (address..address + length).step_by(WORD as usize) {
            // SAFETY: inside bank 2. One read checks the whole flash word.
            unsafe { core::ptr::read_volatile(word as *const u32) };
        }
    })
}

/// Whether the word just written reads back as it was meant. Holds off the tick for less than a microsecond.
fn verify(address: u32, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
    let mut found = [0u8; WRITE_SIZE];
    let sound = guarded(|| {
        for (i, byte) in found.iter_mut().enumerate() {
            // SAFETY: inside bank 2.
            *byte = unsafe { core::ptr::read_volatile((address as *const u8).add(i)) };
        }
    });
    if sound && found == *word {
        Ok(())
    } else {
        Err(FlashError)
    }
}

//! Scene slots in flash bank 2, erased and written while the program runs from bank 1, and the rig's description in the last sectors of bank 1.
//!
//! The HAL's flash driver is not used: on this chip it clears errors in the status register, where they cannot be cleared (they must be written to
//! FLASH_CCR), so that one error would refuse every later write, and it knows nothing of caches.
//!
//! - Erasing a sector takes up to 2 s, writing a word about 0.1 ms. Both wait here, at the lowest priority; the tick goes on.
//! - A read of a bank during an erasure stops the processor until it is over. So [`erasing`] tells the tick to leave the control plane alone
//!   (motors are off then: the application writes flash only so), and bank 2 is device memory meanwhile, which the processor does not read on
//!   speculation.
//! - The program itself is read from bank 1: while a description's sector is erased the processor stands, and no tick runs. The motors are off, the
//!   timer's break input needs no processor, and the watchdog is given the time first ([`crate::watchdog`]).
//! - A word whose writing was cut off by a power failure may fail its error correction for ever after, and reading it is a bus fault.
//!   [`SlotFlash::new`] looks for such words before anything else reads the slots, and erases their sectors.

use core::ptr::write_volatile;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::asm::{dsb, isb};
use cortex_m::peripheral::{DWT, SCB};
use embassy_stm32::Peri;
use embassy_stm32::pac;
use embassy_stm32::pac::flash::regs::Ccr;
use embassy_stm32::peripherals::FLASH;
use mortise_firmware::board::{Flash, FlashError, WRITE_SIZE};
use nucleo_h743zi::flash_map::{self, Bank, SECTOR, SLOT_LENGTH, WORD};

use crate::memory::{Access, forget, set_access};
use crate::watchdog;

const _: () =
    assert!(WORD as usize == WRITE_SIZE && mortise_firmware::board::SLOTS as u32 == flash_map::SLOTS);
const _: () =
    assert!(mortise_firmware::board::RIG_SLOTS[1] == (flash_map::SLOTS + flash_map::RIG_SLOTS) as usize - 1);

/// Keys of FLASH_KEYR1 and FLASH_KEYR2, from the reference manual.
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
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

/// All slots.
pub struct SlotFlash {
    /// Cycles after which an erasure has failed: 5 s, the longest the data sheet gives is 4 s.
    erase_cycles: u32,
}

impl SlotFlash {
    /// Looks at every word of all slots; sectors with a word that cannot be read are erased, which loses a scene or a description that was lost already.
    /// 0.6 ms when all is well. Call before tick and watchdog start.
    pub fn new(_flash: Peri<'static, FLASH>, core_hz: u32) -> Self {
        let mut flash = Self {
            // 2.4·10⁹ fits 32 bits.
            erase_cycles: core_hz.saturating_mul(5),
        };
        for sector in flash_map::sectors() {
            // Twice: a fault of the moment must not cost a scene.
            if !readable(sector, SECTOR) && !readable(sector, SECTOR) {
                // A sector that cannot be erased stays unreadable; opening the store will then fault, and the record says where.
                let _ = flash.erase_sector(sector);
            }
        }
        flash
    }

    fn erase_sector(&mut self, address: u32) -> Result<(), FlashError> {
        let (bank, sector) = flash_map::sector(address);
        ERASING.store(true, Ordering::Relaxed);
        set_access(bank, Access::Erase);
        let registers = pac::FLASH.bank(bank as usize);
        unlock(bank);
        registers.cr().modify(|w| {
            w.set_psize(PARALLELISM);
            w.set_snb(sector);
            w.set_ser(true);
        });
        registers.cr().modify(|w| w.set_start(true));
        let done = wait(bank, self.erase_cycles);
        registers.cr().modify(|w| w.set_ser(false));
        lock(bank);
        // Still device memory: nothing can be read into the cache in between.
        forget(address, SECTOR);
        set_access(bank, Access::Read);
        ERASING.store(false, Ordering::Relaxed);
        done
    }

    fn write_word(&mut self, address: u32, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
        let (bank, _) = flash_map::sector(address);
        set_access(bank, Access::Program);
        let registers = pac::FLASH.bank(bank as usize);
        unlock(bank);
        registers.cr().modify(|w| {
            w.set_psize(PARALLELISM);
            w.set_pg(true);
        });
        isb();
        dsb();
        for (i, bytes) in word.chunks_exact(4).enumerate() {
            let value = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            // SAFETY: inside a slot (checked by the caller), writable now; the flash takes the eight words as one.
            unsafe { write_volatile((address as *mut u32).add(i), value) };
        }
        dsb();
        // Programming takes 0.1 ms, 0.5 ms at the worst: a hundredth of the time of an erasure is ample.
        let done = wait(bank, self.erase_cycles / 100);
        registers.cr().modify(|w| w.set_pg(false));
        lock(bank);
        forget(address, WORD);
        set_access(bank, Access::Read);
        done?;
        verify(address, word)
    }
}

// SAFETY: slots are aligned to sectors, in memory-mapped flash that lives as long as the program; only `erase` and `write` of the same slot change
// it.
unsafe impl Flash<'static> for SlotFlash {
    fn capacity(&self) -> usize {
        SLOT_LENGTH as usize
    }

    fn erase_size(&self) -> usize {
        SECTOR as usize
    }

    // SAFETY: the trait's contract is the caller's: the slot is not written while the slice lives.
    unsafe fn slot(&self, slot: usize) -> &'static [u8] {
        match flash_map::slot(slot) {
            // SAFETY: a slot is so many bytes of flash.
            Ok((start, length)) => unsafe {
                core::slice::from_raw_parts(start as *const u8, length as usize)
            },
            Err(_) => &[],
        }
    }

    fn erase(&mut self, slot: usize, offset: usize) -> Result<(), FlashError> {
        let address = flash_map::address(slot, offset, SECTOR, SECTOR).map_err(|_| FlashError)?;
        match flash_map::sector(address) {
            (Bank::One, _) => watchdog::patiently(|| self.erase_sector(address)),
            (Bank::Two, _) => self.erase_sector(address),
        }
    }

    fn write(&mut self, slot: usize, offset: usize, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
        let address = flash_map::address(slot, offset, WORD, WORD).map_err(|_| FlashError)?;
        self.write_word(address, word)
    }
}

fn clear_flags(bank: Bank) {
    pac::FLASH.bank(bank as usize).ccr().write_value(Ccr(ALL_FLAGS));
}

/// `bank` may be changed; errors left by reads are cleared, or the next operation would be refused.
fn unlock(bank: Bank) {
    clear_flags(bank);
    let registers = pac::FLASH.bank(bank as usize);
    if registers.cr().read().lock() {
        for key in KEYS {
            registers.keyr().write_value(key);
        }
    }
}

fn lock(bank: Bank) {
    pac::FLASH.bank(bank as usize).cr().modify(|w| w.set_lock(true));
}

/// Waits for the operation under way, at most `cycles`.
fn wait(bank: Bank, cycles: u32) -> Result<(), FlashError> {
    let start = DWT::cycle_count();
    loop {
        let status = pac::FLASH.bank(bank as usize).sr().read();
        if !status.qw() && !status.bsy() {
            let failed = status.0 & ERRORS != 0;
            clear_flags(bank);
            return if failed { Err(FlashError) } else { Ok(()) };
        }
        if DWT::cycle_count().wrapping_sub(start) > cycles {
            return Err(FlashError);
        }
    }
}

/// Runs `read` with bus faults of loads ignored; whether the flash met no word it could not correct.
fn guarded(bank: Bank, read: impl FnOnce()) -> bool {
    clear_flags(bank);
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
    let sound = pac::FLASH.bank(bank as usize).sr().read().0 & UNCORRECTABLE == 0;
    clear_flags(bank);
    sound
}

/// Whether every flash word of this piece of a slot can be read. Holds off all interrupts for about 15 ns a word.
fn readable(address: u32, length: u32) -> bool {
    guarded(flash_map::sector(address).0, || {
        for word in (address..address + length).step_by(WORD as usize) {
            // SAFETY: inside a slot. One read checks the whole flash word.
            unsafe { core::ptr::read_volatile(word as *const u32) };
        }
    })
}

/// Whether the word just written reads back as it was meant. Holds off the tick for less than a microsecond.
fn verify(address: u32, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
    let mut found = [0u8; WRITE_SIZE];
    let sound = guarded(flash_map::sector(address).0, || {
        for (i, byte) in found.iter_mut().enumerate() {
            // SAFETY: inside a slot.
            *byte = unsafe { core::ptr::read_volatile((address as *const u8).add(i)) };
        }
    });
    if sound && found == *word {
        Ok(())
    } else {
        Err(FlashError)
    }
}

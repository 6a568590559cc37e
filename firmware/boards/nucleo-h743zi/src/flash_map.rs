//! Where things lie in the 2 MiB of flash.
//!
//! ```text
//! bank 1  0x0800_0000  1 MiB   firmware: code and constants
//! bank 2  0x0810_0000  512 KiB scene slot 0   (4 sectors of 128 KiB)
//!         0x0818_0000  512 KiB scene slot 1   (4 sectors of 128 KiB)
//! ```
//!
//! Why this split: the chip erases one bank while it executes from the other, so with all code in bank 1 and all scenes in bank 2 an upload never
//! stops the tick. A slot in what is left of bank 1 would be 768 KiB, but erasing it would stop the processor for up to two seconds a sector. Two
//! slots are needed because the old scene must survive a cut upload. So 512 KiB is the largest scene.

/// Bytes erased at once.
pub const SECTOR: u32 = 128 * 1024;
/// First address of bank 2.
pub const BANK_2: u32 = 0x0810_0000;
/// Bytes in a bank.
pub const BANK_LENGTH: u32 = 1024 * 1024;
/// Bytes in a scene slot.
pub const SLOT_LENGTH: u32 = BANK_LENGTH / SLOTS;
/// Bytes programmed at once: a flash word with its error-correcting code.
pub const WORD: u32 = 32;
/// Scene slots.
pub const SLOTS: u32 = 2;

/// A piece outside a slot or not aligned to the unit it is erased or written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutsideSlot;

/// Address of `length` bytes at `offset` of a slot, all of it inside the slot, `offset` a multiple of `unit`.
pub const fn address(slot: usize, offset: usize, length: u32, unit: u32) -> Result<u32, OutsideSlot> {
    if slot >= SLOTS as usize || offset >= SLOT_LENGTH as usize {
        return Err(OutsideSlot);
    }
    let offset = offset as u32;
    if !offset.is_multiple_of(unit) || length > SLOT_LENGTH - offset {
        return Err(OutsideSlot);
    }
    Ok(BANK_2 + slot as u32 * SLOT_LENGTH + offset)
}

/// Number of the sector, within bank 2, that `address` lies in.
pub const fn sector(address: u32) -> u8 {
    ((address - BANK_2) / SECTOR) as u8
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Whatever is asked for: inside bank 2, inside the slot, or refused.
        #[test]
        fn never_outside_the_slot(slot in 0usize..4, offset in 0usize..3_000_000, length in 0u32..2_000_000) {
            match address(slot, offset, length, WORD) {
                Ok(found) => {
                    let start = BANK_2 + slot as u32 * SLOT_LENGTH;
                    prop_assert!(slot < SLOTS as usize && found >= start && found + length <= start + SLOT_LENGTH);
                    prop_assert!(found.is_multiple_of(WORD));
                    prop_assert!(u32::from(sector(found)) < BANK_LENGTH / SECTOR);
                }
                Err(OutsideSlot) => {
                    let whole = slot < SLOTS as usize && offset + length as usize <= SLOT_LENGTH as usize;
                    prop_assert!(!whole || offset >= SLOT_LENGTH as usize || offset % WORD as usize != 0);
                }
            }
        }
    }

    #[test]
    fn slots_do_not_share_a_sector() {
        let last = address(0, (SLOT_LENGTH - SECTOR) as usize, SECTOR, SECTOR).unwrap();
        let first = address(1, 0, SECTOR, SECTOR).unwrap();
        assert_eq!((sector(last), sector(first)), (3, 4));
        assert_eq!(address(0, 32, SECTOR, SECTOR), Err(OutsideSlot));
    }
}

//! Where things lie in the 2 MiB of flash.
//!
//! ```text
//! bank 1  0x0800_0000  768 KiB firmware: code and constants (memory.x)
//!         0x080c_0000  128 KiB description of the rig, slot 0   (sector 6)
//!         0x080e_0000  128 KiB description of the rig, slot 1   (sector 7)
//! bank 2  0x0810_0000  512 KiB scene slot 0   (4 sectors of 128 KiB)
//!         0x0818_0000  512 KiB scene slot 1   (4 sectors of 128 KiB)
//! ```
//!
//! Why this split: the chip erases one bank while it executes from the other, so with all code in bank 1 and all scenes in bank 2 an upload never
//! stops the tick. Two slots are needed because the old scene must survive a cut upload; so 512 KiB is the largest scene, and bank 2 is full. A
//! description is sent once in a rig's life: its sectors are in bank 1, where erasing one stops the processor for up to two seconds, with the motors
//! off.

/// Bytes erased at once.
pub const SECTOR: u32 = 128 * 1024;
/// First address of bank 1.
pub const BANK_1: u32 = 0x0800_0000;
/// First address of bank 2.
pub const BANK_2: u32 = 0x0810_0000;
/// Bytes in a bank.
pub const BANK_LENGTH: u32 = 1024 * 1024;
/// First address of the rig's descriptions, in bank 1.
pub const RIGS: u32 = 0x080c_0000;
/// Bytes of both of them.
pub const RIGS_LENGTH: u32 = RIG_SLOTS * SECTOR;
/// Bytes in a scene slot.
pub const SLOT_LENGTH: u32 = BANK_LENGTH / SLOTS;
/// Bytes programmed at once: a flash word with its error-correcting code.
pub const WORD: u32 = 32;
/// Scene slots: numbers 0 and 1.
pub const SLOTS: u32 = 2;
/// Slots of the rig's description, a sector each: numbers 2 and 3.
pub const RIG_SLOTS: u32 = 2;

const _: () = assert!(RIGS + RIGS_LENGTH == BANK_1 + BANK_LENGTH && RIGS.is_multiple_of(RIGS_LENGTH));

/// A piece outside a slot or not aligned to the unit it is erased or written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutsideSlot;

/// First address and length of a slot: scenes, then descriptions.
pub const fn slot(number: usize) -> Result<(u32, u32), OutsideSlot> {
    match number {
        0 | 1 => Ok((BANK_2 + number as u32 * SLOT_LENGTH, SLOT_LENGTH)),
        2 | 3 => Ok((RIGS + (number as u32 - SLOTS) * SECTOR, SECTOR)),
        _ => Err(OutsideSlot),
    }
}

/// Address of `length` bytes at `offset` of a slot, all of it inside the slot, `offset` a multiple of `unit`.
pub const fn address(number: usize, offset: usize, length: u32, unit: u32) -> Result<u32, OutsideSlot> {
    let (start, size) = match slot(number) {
        Ok(found) => found,
        Err(outside) => return Err(outside),
    };
    if offset >= size as usize {
        return Err(OutsideSlot);
    }
    let offset = offset as u32;
    if !offset.is_multiple_of(unit) || length > size - offset {
        return Err(OutsideSlot);
    }
    Ok(start + offset)
}

/// Banks of the chip, numbered as in its register block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bank {
    /// Code and descriptions.
    One = 0,
    /// Scenes.
    Two = 1,
}

/// The bank that `address` lies in, and the number of its sector there.
pub const fn sector(address: u32) -> (Bank, u8) {
    let (bank, start) = if address < BANK_2 {
        (Bank::One, BANK_1)
    } else {
        (Bank::Two, BANK_2)
    };
    (bank, ((address - start) / SECTOR) as u8)
}

/// First address of every sector of every slot.
pub fn sectors() -> impl Iterator<Item = u32> {
    (RIGS..BANK_2 + BANK_LENGTH).step_by(SECTOR as usize)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Whatever is given: inside the slot, or refused.
        #[test]
        fn never_outside_the_slot(number in 0usize..6, offset in 0usize..3_000_000, length in 0u32..2_000_000) {
            match address(number, offset, length, WORD) {
                Ok(found) => {
                    let (start, size) = slot(number).unwrap();
                    prop_assert!(found >= start && found + length <= start + size);
                    prop_assert!(found.is_multiple_of(WORD));
                    prop_assert!(sectors().any(|sector| (sector..sector + SECTOR).contains(&found)));
                }
                Err(OutsideSlot) => {
                    let whole = slot(number).is_ok_and(|(_, size)| offset < size as usize && offset + length as usize <= size as usize);
                    prop_assert!(!whole || offset % WORD as usize != 0);
                }
            }
        }
    }

    #[test]
    fn no_two_slots_share_a_sector_and_all_have_theirs() {
        let all: [_; 4] = core::array::from_fn(|number| {
            let (start, size) = slot(number).unwrap();
            (sector(start), sector(start + size - 1))
        });
        let (one, two) = (Bank::One, Bank::Two);
        assert_eq!(
            all,
            [
                ((two, 0), (two, 3)),
                ((two, 4), (two, 7)),
                ((one, 6), (one, 6)),
                ((one, 7), (one, 7))
            ]
        );
        assert_eq!(slot(4), Err(OutsideSlot));
        assert_eq!(sectors().count(), 10);
        assert_eq!(address(0, 32, SECTOR, SECTOR), Err(OutsideSlot));
    }

    /// The linker puts no code where a description is erased.
    #[test]
    fn code_ends_where_descriptions_begin() {
        let script = include_str!("../memory.x");
        assert!(script.contains("FLASH : ORIGIN = 0x08000000, LENGTH = 768K"));
        assert_eq!(BANK_1 + 768 * 1024, RIGS);
    }
}

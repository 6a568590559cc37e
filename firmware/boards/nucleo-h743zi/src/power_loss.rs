//! Power lost at every operation of this board's flash while a description is kept: the old one or the whole new one is found again.
//!
//! The model is the chip's flash behind the board's own map ([`crate::flash_map`]): sectors of 128 KiB, flash words written once, and words that were cut
//! off in the middle and cannot be read any more, which on the chip is a bus fault. Start-up erases the sectors of such words before anything
//! reads them, as the board does.

use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::rc::Rc;
use std::vec;
use std::vec::Vec;

use mortise_firmware::board::{ERASED, Flash, FlashError, FlashWord, RIG_SLOTS, WRITE_SIZE};
use mortise_firmware::store::rig::{Kept, keep, kept};

use crate::flash_map::{self, BANK_2, BANK_LENGTH, RIGS, SECTOR, SLOT_LENGTH, WORD};
use rigs::{arm, paddle, pantograph};

#[path = "../../../app/tests/support/rigs.rs"]
mod rigs;

/// Words of one sector.
const WORDS: usize = (SECTOR / WORD) as usize;

/// The chip: what a power cycle leaves.
#[derive(Clone)]
struct Chip {
    /// From the first slot's first word to the last one's last; leaked, one for each test.
    memory: *mut FlashWord,
    /// Addresses of words that cannot be read.
    broken: Rc<RefCell<HashSet<u32>>>,
    /// Operations left until the power goes.
    fuse: Rc<Cell<Option<u32>>>,
    operations: Rc<Cell<u32>>,
}

#[derive(PartialEq)]
enum Power {
    On,
    Going,
    Off,
}

impl Chip {
    fn new() -> Self {
        let words = ((BANK_2 + BANK_LENGTH - RIGS) / WORD) as usize;
        Self {
            memory: Vec::leak(vec![ERASED; words]).as_mut_ptr(),
            broken: Rc::default(),
            fuse: Rc::default(),
            operations: Rc::default(),
        }
    }

    /// With two descriptions kept, the pantograph's in use.
    fn prepared() -> Self {
        let mut chip = Self::new();
        keep(&mut chip, &paddle()).unwrap();
        keep(&mut chip, &pantograph()).unwrap();
        // A scene's bytes, which nothing here may change.
        for slot in 0..2 {
            chip.write(slot, SLOT_LENGTH as usize - WRITE_SIZE, &[0x5a; WRITE_SIZE])
                .unwrap();
        }
        chip
    }

    fn word(&self, address: u32) -> *mut FlashWord {
        assert!((RIGS..BANK_2 + BANK_LENGTH).contains(&address) && address.is_multiple_of(WORD));
        // SAFETY: inside the memory.
        unsafe { self.memory.add(((address - RIGS) / WORD) as usize) }
    }

    fn power(&self) -> Power {
        self.operations.set(self.operations.get() + 1);
        match self.fuse.get() {
            None => Power::On,
            Some(0) => Power::Off,
            Some(left) => {
                self.fuse.set(Some(left - 1));
                if left == 1 { Power::Going } else { Power::On }
            }
        }
    }

    fn erase_sector(&self, address: u32) -> Result<(), FlashError> {
        let power = self.power();
        let words = match power {
            Power::On => WORDS,
            Power::Going => WORDS / 2,
            Power::Off => 0,
        };
        for word in (address..).step_by(WORD as usize).take(words) {
            // SAFETY: inside a sector of a slot.
            unsafe { self.word(word).write(ERASED) };
            self.broken.borrow_mut().remove(&word);
        }
        if power == Power::Going {
            // Where the erasure stood.
            self.broken.borrow_mut().insert(address + words as u32 * WORD);
        }
        if power == Power::On {
            Ok(())
        } else {
            Err(FlashError)
        }
    }

    /// What the board does at start: sectors with a word that cannot be read are erased.
    fn start(&self) {
        self.fuse.set(None);
        self.recover();
    }

    fn recover(&self) {
        for sector in flash_map::sectors() {
            let unreadable = self
                .broken
                .borrow()
                .iter()
                .any(|word| (sector..sector + SECTOR).contains(word));
            if unreadable {
                let _ = self.erase_sector(sector);
            }
        }
    }

    fn scenes(&self) -> Vec<u8> {
        let first = self.word(BANK_2).cast::<u8>();
        // SAFETY: all of bank 2, copied at once.
        unsafe { std::slice::from_raw_parts(first, BANK_LENGTH as usize) }.to_vec()
    }
}

// SAFETY: aligned words in leaked memory; `erase` and `write` stay in their slot by the board's own map; one thread.
unsafe impl Flash<'static> for Chip {
    fn capacity(&self) -> usize {
        SLOT_LENGTH as usize
    }

    fn erase_size(&self) -> usize {
        SECTOR as usize
    }

    // SAFETY: the trait's contract is the caller's.
    unsafe fn slot(&self, slot: usize) -> &'static [u8] {
        let (start, length) = flash_map::slot(slot).unwrap();
        let broken = self.broken.borrow();
        if RIG_SLOTS.contains(&slot) && self.fuse.get().is_none() {
            assert!(
                !broken.iter().any(|word| (start..start + length).contains(word)),
                "a word is read that cannot be"
            );
        }
        // SAFETY: a slot of the memory.
        unsafe { std::slice::from_raw_parts(self.word(start).cast::<u8>(), length as usize) }
    }

    fn erase(&mut self, slot: usize, offset: usize) -> Result<(), FlashError> {
        let address = flash_map::address(slot, offset, SECTOR, SECTOR).map_err(|_| FlashError)?;
        self.erase_sector(address)
    }

    fn write(&mut self, slot: usize, offset: usize, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
        let address = flash_map::address(slot, offset, WORD, WORD).map_err(|_| FlashError)?;
        let power = self.power();
        // SAFETY: inside the memory; one thread.
        let now = unsafe { &mut *self.word(address) };
        assert_eq!(now.0, ERASED.0, "written twice without erasing");
        match power {
            Power::On => now.0 = *word,
            Power::Going => {
                now.0[..WRITE_SIZE / 2].copy_from_slice(&word[..WRITE_SIZE / 2]);
                self.broken.borrow_mut().insert(address);
            }
            Power::Off => {}
        }
        if power == Power::On {
            Ok(())
        } else {
            Err(FlashError)
        }
    }
}

fn operations() -> u32 {
    let mut chip = Chip::prepared();
    let before = chip.operations.get();
    keep(&mut chip, &arm()).unwrap();
    chip.operations.get() - before
}

#[test]
fn power_lost_at_any_operation_leaves_the_description_in_use_and_every_scene() {
    let operations = operations();
    // Erase, description, record.
    assert!(operations > 8, "{operations} operations cover nothing");
    for cut in 1..=operations {
        let mut chip = Chip::prepared();
        let scenes = chip.scenes();
        chip.fuse.set(Some(cut));
        assert!(keep(&mut chip, &arm()).is_err(), "cut {cut}");
        chip.start();
        assert_eq!(kept(&chip), Kept::Rig(pantograph()), "cut {cut}");
        keep(&mut chip, &arm()).unwrap();
        assert_eq!(kept(&chip), Kept::Rig(arm()), "cut {cut}");
        assert!(chip.scenes() == scenes, "cut {cut}");
    }
}

#[test]
fn power_lost_again_while_start_up_erases_what_the_first_loss_broke_does_no_more_harm() {
    for cut in 1..=operations() {
        let mut chip = Chip::prepared();
        chip.fuse.set(Some(cut));
        assert!(keep(&mut chip, &arm()).is_err(), "cut {cut}");
        chip.fuse.set(Some(1));
        chip.recover();
        chip.start();
        assert_eq!(kept(&chip), Kept::Rig(pantograph()), "cut {cut}");
    }
}

#[test]
fn the_first_description_comes_whole_or_not_at_all() {
    let mut chip = Chip::new();
    keep(&mut chip, &arm()).unwrap();
    for cut in 1..=chip.operations.get() {
        let mut chip = Chip::new();
        chip.fuse.set(Some(cut));
        assert!(keep(&mut chip, &arm()).is_err(), "cut {cut}");
        chip.start();
        assert_eq!(kept(&chip), Kept::Nothing, "cut {cut}");
    }
}

//! Flash with small sectors that loses power after a number of operations, in the middle of one.

use std::cell::{Cell, UnsafeCell};
use std::rc::Rc;

use mortise_firmware::board::{ERASED, Flash, FlashError, FlashWord, RIG_SLOTS, SLOTS, WRITE_SIZE};

pub const SECTOR: usize = 512;
pub const SLOT: usize = 16 * SECTOR;
/// The scenes' slots, then the rig's, of equal size: only their first sector is used.
const ALL: usize = SLOTS + RIG_SLOTS.len();
const WORDS: usize = ALL * SLOT / WRITE_SIZE;

struct Memory(UnsafeCell<[FlashWord; WORDS]>);

impl Memory {
    fn leaked(content: [FlashWord; WORDS]) -> &'static Self {
        Box::leak(Box::new(Self(UnsafeCell::new(content))))
    }
}

/// Operations left until power fails; `None`: it never fails.
pub type Fuse = Rc<Cell<Option<u32>>>;

/// A handle on leaked memory: cloning it corresponds to moving the chip to another board.
#[derive(Clone)]
pub struct TestFlash {
    memory: Rc<Cell<&'static Memory>>,
    pub fuse: Fuse,
    /// Operations done so far.
    pub operations: Rc<Cell<u32>>,
}

impl TestFlash {
    pub fn leaked() -> Self {
        Self {
            memory: Rc::new(Cell::new(Memory::leaked([ERASED; WORDS]))),
            fuse: Rc::default(),
            operations: Rc::default(),
        }
    }

    /// Changes a byte as a failing cell would. No reference into the slot may be in use.
    pub fn damage(&self, slot: usize, offset: usize) {
        let word = self.word(slot, offset / WRITE_SIZE * WRITE_SIZE);
        // SAFETY: inside the memory; the tests are single-threaded.
        unsafe { (*word).0[offset % WRITE_SIZE] ^= 0x10 };
    }

    /// The same while references are in use: the chip is replaced by one with the same content except for that byte. References handed out before
    /// still point to the old one, since memory behind a shared reference must not change; a new read of the flash sees the damage.
    pub fn damage_in_use(&self, slot: usize, offset: usize) {
        // SAFETY: whole and initialised; only read here.
        let content = unsafe { *self.memory.get().0.get() };
        self.memory.set(Memory::leaked(content));
        self.damage(slot, offset);
    }

    /// Erases the whole chip. No reference into it may be in use.
    pub fn erase_all(&self) {
        // SAFETY: the tests are single-threaded, and no reference into the memory is in use.
        unsafe { *self.memory.get().0.get() = [ERASED; WORDS] };
        self.fuse.set(None);
        self.operations.set(0);
    }

    /// A copy of a slot's current content.
    pub fn content(&self, slot: usize) -> Vec<u8> {
        // SAFETY: SLOT bytes from the slot's first word; nothing writes meanwhile, the tests are single-threaded.
        unsafe { std::slice::from_raw_parts(self.word(slot, 0).cast::<u8>(), SLOT) }.to_vec()
    }

    fn word(&self, slot: usize, offset: usize) -> *mut FlashWord {
        assert!(slot < ALL && offset < SLOT && offset.is_multiple_of(WRITE_SIZE));
        let index = (slot * SLOT + offset) / WRITE_SIZE;
        // SAFETY: index < WORDS.
        unsafe { self.memory.get().0.get().cast::<FlashWord>().add(index) }
    }

    /// Fate of the next operation: complete, half (power fails), or none.
    fn power(&self) -> Power {
        self.operations.set(self.operations.get() + 1);
        match self.fuse.get() {
            None => Power::On,
            Some(0) => Power::Off,
            Some(1) => {
                self.fuse.set(Some(0));
                Power::Going
            }
            Some(left) => {
                self.fuse.set(Some(left - 1));
                Power::On
            }
        }
    }
}

#[derive(PartialEq)]
enum Power {
    On,
    Going,
    Off,
}

// SAFETY: aligned words, leaked memory; `erase` and `write` stay in their slot.
unsafe impl Flash<'static> for TestFlash {
    fn capacity(&self) -> usize {
        SLOT
    }

    fn erase_size(&self) -> usize {
        SECTOR
    }

    // SAFETY: the trait's contract is the caller's: the slot is not written while the slice lives.
    unsafe fn slot(&self, slot: usize) -> &'static [u8] {
        // SAFETY: SLOT bytes from the slot's first word.
        unsafe { std::slice::from_raw_parts(self.word(slot, 0).cast::<u8>(), SLOT) }
    }

    fn erase(&mut self, slot: usize, offset: usize) -> Result<(), FlashError> {
        assert!(offset.is_multiple_of(SECTOR));
        let power = self.power();
        let words = match power {
            Power::On => SECTOR / WRITE_SIZE,
            Power::Going => SECTOR / WRITE_SIZE / 2,
            Power::Off => 0,
        };
        for i in 0..words {
            // SAFETY: inside the slot.
            unsafe { self.word(slot, offset + i * WRITE_SIZE).write(ERASED) };
        }
        if power == Power::On {
            Ok(())
        } else {
            Err(FlashError)
        }
    }

    fn write(&mut self, slot: usize, offset: usize, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
        let power = self.power();
        let place = self.word(slot, offset);
        // SAFETY: inside the slot.
        let now = unsafe { &mut *place };
        assert_eq!(now.0, ERASED.0, "written twice without erasing");
        match power {
            Power::On => now.0 = *word,
            Power::Going => now.0[..WRITE_SIZE / 2].copy_from_slice(&word[..WRITE_SIZE / 2]),
            Power::Off => {}
        }
        if power == Power::On {
            Ok(())
        } else {
            Err(FlashError)
        }
    }
}

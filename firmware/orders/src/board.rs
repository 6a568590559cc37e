//! A board in memory, cheap to build: flash of two small slots, a mechanism whose readings the enumeration controls, a line that can be full.

use std::cell::{Cell, UnsafeCell};

use mortise_firmware::board::{
    Clock, Drive, ERASED, Flash, FlashError, FlashWord, Identity, Mechanism, Outbound, SLOTS, Sensed,
    WRITE_SIZE,
};
use mortise_firmware::store::{IMAGE_OFFSET, commit_record};
use mortise_mechanism::hardware_limits::HardwareLimits;
use mortise_protocol::image::{CRC, PART_GRABBABLE, PartRecord};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{CostUnit, ResetReason};

/// Bytes of a slot, erased at once: one record and one small scene.
const SLOT: usize = 640;
const WORDS: usize = SLOTS * SLOT / WRITE_SIZE;

pub(crate) const IDENTITY: Identity = Identity {
    board: "enumeration",
    force_axes: 3,
    torque_axes: 3,
    cost_unit: CostUnit::Nanoseconds,
    cost_budget: 0,
    reset: ResetReason::PowerOn,
    overrun_ticks: 0,
    hardware_limits: HardwareLimits::LARGEST,
    entropy: 0,
};

/// The smallest scene of the protocol's tests with its one part twice: one to grab, and one a metre away to guide it to.
pub(crate) fn scene() -> Vec<u8> {
    let mut image = include_bytes!("../../../protocol/tests/golden/occupancy.scene").to_vec();
    let word = |image: &[u8], at: usize| {
        u32::from_le_bytes([image[at], image[at + 1], image[at + 2], image[at + 3]])
    };
    let size = size_of::<PartRecord>();
    // The parts' section is the first of all: its place in the header comes after magic, layout, length, checksum and the place of energies.
    let first = word(&image, 24) as usize;
    let mut fixed = image[first..first + size].to_vec();
    // After its shape, flags and x, y.
    fixed[16..20].copy_from_slice(&1f32.to_le_bytes());
    image[first + 4] |= PART_GRABBABLE as u8;
    image.splice(first + size..first + size, fixed);
    image[28..32].copy_from_slice(&2u32.to_le_bytes());
    for section in (32..first).step_by(8) {
        let moved = word(&image, section) + size as u32;
        image[section..section + 4].copy_from_slice(&moved.to_le_bytes());
    }
    let length = image.len() as u32;
    image[12..16].copy_from_slice(&length.to_le_bytes());
    let crc = CRC.checksum(&image[20..]);
    image[16..20].copy_from_slice(&crc.to_le_bytes());
    image
}

/// The flash chip, and a second one with the same content except for one byte: memory behind a shared reference must not change, so damage swaps the
/// chips. Earlier references continue to read the old chip; a new access to the flash reads the damage.
pub(crate) struct Chip {
    words: [UnsafeCell<[FlashWord; WORDS]>; 2],
    in_use: Cell<usize>,
}

impl Clone for Chip {
    fn clone(&self) -> Self {
        let copy = Self {
            words: [const { UnsafeCell::new([ERASED; WORDS]) }; 2],
            in_use: Cell::new(0),
        };
        copy.set(self);
        copy
    }
}

impl Chip {
    /// A chip with `scene` in slot 0.
    pub fn with(scene: &[u8]) -> Self {
        let mut words = [ERASED; WORDS];
        let mut bytes = commit_record(1, scene).to_vec();
        bytes.extend_from_slice(scene);
        assert!(bytes.len() <= SLOT && IMAGE_OFFSET == WRITE_SIZE);
        for (word, piece) in words.iter_mut().zip(bytes.chunks(WRITE_SIZE)) {
            word.0[..piece.len()].copy_from_slice(piece);
        }
        Self {
            words: [UnsafeCell::new(words), UnsafeCell::new([ERASED; WORDS])],
            in_use: Cell::new(0),
        }
    }

    /// Whether [`Self::damage`] was used.
    pub fn is_damaged(&self) -> bool {
        self.in_use.get() == 1
    }

    /// Changes one byte of the scene in each slot, once.
    pub fn damage(&self) {
        if self.in_use.replace(1) == 1 {
            return;
        }
        // SAFETY: one thread; no reference to the second chip exists yet.
        unsafe {
            let mut words = *self.words[0].get();
            for slot in 0..SLOTS {
                words[(slot * SLOT + 200) / WRITE_SIZE].0[8] ^= 0x10;
            }
            *self.words[1].get() = words;
        }
    }

    /// The slot of the scene whose image begins at this address, before or after damage.
    pub fn slot_at(&self, image: *const u8) -> Option<usize> {
        let slots = (0..SLOTS).map(|slot| (slot, slot * SLOT + IMAGE_OFFSET));
        slots
            .filter(|(_, at)| {
                let chips = self.words.iter();
                chips
                    .map(|words| words.get().cast::<u8>().wrapping_add(*at))
                    .any(|first| std::ptr::eq(first, image))
            })
            .map(|(slot, _)| slot)
            .next()
    }

    /// Whether this slot holds exactly these bytes as its image now.
    pub fn holds(&self, slot: usize, image: &[u8]) -> bool {
        // SAFETY: one thread, and nothing is written while the slice lives.
        let words = unsafe { &*self.words[self.in_use.get()].get() };
        let bytes = words.iter().flat_map(|word| word.0);
        bytes
            .skip(slot * SLOT + IMAGE_OFFSET)
            .take(image.len())
            .eq(image.iter().copied())
    }

    /// Takes the content of `other`.
    pub fn set(&self, other: &Self) {
        self.in_use.set(other.in_use.get());
        for (to, from) in self.words.iter().zip(&other.words) {
            // SAFETY: two chips, one thread; whoever reads the flash is put back together with it.
            unsafe { *to.get() = *from.get() };
        }
    }

    fn word(&self, slot: usize, offset: usize) -> Result<*mut FlashWord, FlashError> {
        if slot >= SLOTS || offset >= SLOT || !offset.is_multiple_of(WRITE_SIZE) {
            return Err(FlashError);
        }
        let index = (slot * SLOT + offset) / WRITE_SIZE;
        // SAFETY: inside the array.
        Ok(unsafe { self.words[self.in_use.get()].get().cast::<FlashWord>().add(index) })
    }
}

/// The flash as seen by the store. Records a change while motors are driven.
pub(crate) struct ChipFlash<'s> {
    pub chip: &'s Chip,
    pub rig: &'s Rig,
}

// SAFETY: aligned words that live for 's; `erase` and `write` stay in their slot.
unsafe impl<'s> Flash<'s> for ChipFlash<'s> {
    fn capacity(&self) -> usize {
        SLOT
    }

    fn erase_size(&self) -> usize {
        SLOT
    }

    // SAFETY: the trait's contract is passed to the caller: the slot is not written while the slice lives.
    unsafe fn slot(&self, slot: usize) -> &'s [u8] {
        match self.chip.word(slot, 0) {
            // SAFETY: SLOT bytes from the slot's first word.
            Ok(first) => unsafe { std::slice::from_raw_parts(first.cast::<u8>(), SLOT) },
            // There are no slots for a rig's description.
            Err(FlashError) => &[],
        }
    }

    fn erase(&mut self, slot: usize, offset: usize) -> Result<(), FlashError> {
        self.rig.note_flash();
        for at in (offset..SLOT).step_by(WRITE_SIZE) {
            // SAFETY: inside the slot; one thread.
            unsafe { *self.chip.word(slot, at)? = ERASED };
        }
        Ok(())
    }

    fn write(&mut self, slot: usize, offset: usize, word: &[u8; WRITE_SIZE]) -> Result<(), FlashError> {
        self.rig.note_flash();
        // SAFETY: inside the slot; one thread.
        unsafe { *self.chip.word(slot, offset)? = FlashWord(*word) };
        Ok(())
    }
}

/// Readings of the mechanism, and its last command.
#[derive(Clone)]
pub(crate) struct Rig {
    pub sensed: Cell<Sensed>,
    pub driven: Cell<bool>,
    pub flash_while_driven: Cell<bool>,
}

impl Rig {
    pub fn at_rest() -> Self {
        Self {
            sensed: Cell::new(Sensed::AT_REST),
            driven: Cell::new(false),
            flash_while_driven: Cell::new(false),
        }
    }

    /// Takes the state of `other`.
    pub fn set(&self, other: &Self) {
        self.sensed.set(other.sensed.get());
        self.driven.set(other.driven.get());
        self.flash_while_driven.set(other.flash_while_driven.get());
    }

    pub fn sense(&self, change: impl FnOnce(&mut Sensed)) {
        let mut sensed = self.sensed.get();
        change(&mut sensed);
        self.sensed.set(sensed);
    }

    fn note_flash(&self) {
        if self.driven.get() {
            self.flash_while_driven.set(true);
        }
    }
}

pub(crate) struct Puppet<'s>(pub &'s Rig);

impl Mechanism for Puppet<'_> {
    fn sense(&mut self) -> Sensed {
        self.0.sensed.get()
    }

    fn drive(&mut self, drive: Drive) {
        self.0.driven.set(drive != Drive::Off);
    }

    fn motors(&self) -> u8 {
        1
    }

    fn home(&mut self) {
        self.0.sense(|sensed| sensed.referenced = true);
    }
}

/// A clock in which no time passes except by ticks.
pub(crate) struct NoClock;

impl Clock for NoClock {
    fn begin(&mut self) -> u32 {
        0
    }

    fn cost(&mut self) -> u32 {
        0
    }
}

/// The line to the host.
#[derive(Default)]
pub(crate) struct Line {
    pub bytes: Vec<u8>,
    pub full: bool,
}

impl Outbound for Line {
    fn room(&self) -> usize {
        if self.full { 0 } else { 64 * MAX_FRAME }
    }

    fn write(&mut self, frame: &[u8]) {
        self.bytes.extend_from_slice(frame);
    }
}

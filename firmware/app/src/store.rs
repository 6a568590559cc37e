//! The scene store (and, in [`rig`], the rig's description): two slots in flash, the newest valid one in use, the other free for an upload.
//!
//! ```text
//! slot: | record, 32 bytes | image ... |
//! record: magic "MSCENE01" | sequence u32 | length u32 | image CRC-32 u32 | layout u32 | zero u32 | record CRC-32 u32   (little-endian)
//! ```
//!
//! The record is one flash word and written last: until it is complete, the slot holds no scene. Beginning an upload erases the free slot's record
//! first. After an interruption at any moment, the scene in use is untouched in its own slot and found again at the next start.

pub mod rig;
mod sequence;

use core::hash::{Hash, Hasher};

use mortise_protocol::image::{CRC, Header, ImageError, LAYOUT_VERSION, SceneImage};
use mortise_protocol::limits::MAX_PARTS;
use mortise_protocol::message::Refusal;
use mortise_protocol::rig::Rig;

use self::sequence::newer;
use crate::board::{Flash, FlashError, SLOTS, WRITE_SIZE};

/// First bytes of a commit record.
pub const RECORD_MAGIC: [u8; 8] = *b"MSCENE01";
/// Bytes before the image: the record, one flash word.
pub const IMAGE_OFFSET: usize = WRITE_SIZE;

/// Content of a commit record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Record {
    sequence: u32,
    length: u32,
    crc: u32,
    layout: u32,
}

impl Record {
    fn to_bytes(self) -> [u8; WRITE_SIZE] {
        let mut bytes = [0u8; WRITE_SIZE];
        bytes[..8].copy_from_slice(&RECORD_MAGIC);
        for (place, word) in
            bytes[8..]
                .chunks_exact_mut(4)
                .zip([self.sequence, self.length, self.crc, self.layout, 0])
        {
            place.copy_from_slice(&word.to_le_bytes());
        }
        let crc = CRC.checksum(&bytes[..28]);
        bytes[28..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    fn from_slot(slot: &[u8]) -> Option<Self> {
        let bytes: &[u8; WRITE_SIZE] = slot.first_chunk()?;
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let sound = bytes[..8] == RECORD_MAGIC && CRC.checksum(&bytes[..28]) == word(28);
        sound.then(|| Self {
            sequence: word(8),
            length: word(12),
            crc: word(16),
            layout: word(20),
        })
    }
}

/// The commit record for `image`: the first [`IMAGE_OFFSET`] bytes of a slot, written after the image, which make it a stored scene. For tools that
/// fill flash without a running board; newer scenes have larger sequence numbers.
pub fn commit_record(sequence: u32, image: &[u8]) -> [u8; WRITE_SIZE] {
    Record {
        sequence,
        // No flash holds 4 GiB.
        length: image.len() as u32,
        crc: CRC.checksum(image),
        layout: LAYOUT_VERSION,
    }
    .to_bytes()
}

/// A scene in flash.
#[derive(Clone, Copy, Debug)]
pub struct Stored<'s> {
    /// The image, read in place.
    pub image: SceneImage<'s>,
    /// CRC-32 over the whole image: identifies the scene to the host.
    pub crc: u32,
    /// Length of the image, bytes.
    length: usize,
    slot: usize,
    /// Sequence number of its commit record: differs from that of the previous scene.
    pub sequence: u32,
}

/// An upload in progress.
#[derive(Clone, Copy, Debug)]
struct Upload {
    slot: usize,
    length: u32,
    crc: u32,
    received: u32,
    /// Offset and length of the last chunk, to recognise a repetition.
    last: (u32, u32),
    /// Bytes of the slot erased so far.
    erased: usize,
    /// Bytes of an incomplete flash word.
    word: [u8; WRITE_SIZE],
    filled: usize,
}

/// The two slots and the upload.
pub struct Store<'s, F> {
    flash: F,
    current: Option<Stored<'s>>,
    upload: Option<Upload>,
    /// A committed scene that the control plane does not use yet; until it does, both slots are occupied.
    next: Option<Stored<'s>>,
}

impl<'s, F: Flash<'s>> Store<'s, F> {
    /// Opens the newest slot that passes every check.
    pub fn open(flash: F) -> Self {
        let mut store = Self {
            flash,
            current: None,
            upload: None,
            next: None,
        };
        for slot in 0..SLOTS {
            if let Ok(found) = store.read(slot)
                && store.current.is_none_or(|c| newer(found.sequence, c.sequence))
            {
                store.current = Some(found);
            }
        }
        store
    }

    /// The scene in use.
    pub fn current(&self) -> Option<&Stored<'s>> {
        self.current.as_ref()
    }

    /// Whether there is a scene in use and the flash still holds it. Reads all of it from the flash anew: the compiler may assume that memory behind
    /// an earlier reference has not changed.
    pub fn is_sound(&self) -> bool {
        self.current.is_some_and(|scene| {
            let bytes = self.memory(scene.slot).get(IMAGE_OFFSET..);
            bytes
                .and_then(|bytes| bytes.get(..scene.length))
                .is_some_and(|image| CRC.checksum(image) == scene.crc)
        })
    }

    /// Largest image, bytes.
    pub fn capacity(&self) -> u32 {
        self.flash
            .capacity()
            .saturating_sub(IMAGE_OFFSET)
            .min(u32::MAX as usize) as u32
    }

    /// Whether an upload is in progress or awaits the control plane.
    pub fn busy(&self) -> bool {
        self.upload.is_some() || self.next.is_some()
    }

    /// Starts an upload into the free slot; one in progress is discarded.
    pub fn begin(&mut self, length: u32, crc: u32, layout: u32) -> Result<(), Refusal> {
        if self.next.is_some() {
            return Err(Refusal::Busy);
        }
        self.upload = None;
        if layout != LAYOUT_VERSION {
            return Err(Refusal::SceneImage(ImageError::Layout {
                expected: LAYOUT_VERSION,
                found: layout,
            }));
        }
        if length > self.capacity() {
            return Err(Refusal::SceneTooLarge {
                capacity: self.capacity(),
            });
        }
        let header = size_of::<Header>() as u32;
        if length < header {
            return Err(Refusal::SceneImage(ImageError::TooShort {
                needed: header,
                got: length,
            }));
        }
        let slot = self.current.map_or(0, |c| 1 - c.slot);
        let erased = self.flash.erase_size();
        self.flash.erase(slot, 0).map_err(|_| Refusal::Flash)?;
        self.upload = Some(Upload {
            slot,
            length,
            crc,
            received: 0,
            last: (0, 0),
            erased,
            word: [0xff; WRITE_SIZE],
            filled: 0,
        });
        Ok(())
    }

    /// Stores the next bytes. A repetition of the last chunk is acknowledged again without effect.
    pub fn chunk(&mut self, offset: u32, data: &[u8]) -> Result<(), Refusal> {
        let upload = self.upload.as_mut().ok_or(Refusal::NoUpload)?;
        // A chunk is at most MAX_CHUNK bytes.
        let length = data.len() as u32;
        if (offset, length) == upload.last && length > 0 {
            return Ok(());
        }
        if offset != upload.received {
            return Err(Refusal::ChunkOrder {
                expected: upload.received,
            });
        }
        if length > upload.length - upload.received {
            return Err(Refusal::SceneTooLarge {
                capacity: upload.length,
            });
        }
        for &byte in data {
            upload.word[upload.filled] = byte;
            upload.filled += 1;
            upload.received += 1;
            if upload.filled == WRITE_SIZE {
                let at = IMAGE_OFFSET + upload.received as usize - WRITE_SIZE;
                if write_word(&mut self.flash, upload, at).is_err() {
                    self.upload = None;
                    return Err(Refusal::Flash);
                }
            }
        }
        upload.last = (offset, length);
        Ok(())
    }

    /// Checks the uploaded image and writes the record. The result is for the control plane; [`Self::taken_over`] makes it the scene in use.
    ///
    /// Ends the upload whatever the outcome, except that an incomplete one continues.
    pub fn commit(&mut self) -> Result<Stored<'s>, Refusal> {
        let mut upload = self.upload.ok_or(Refusal::NoUpload)?;
        if upload.received != upload.length {
            return Err(Refusal::SceneIncomplete {
                received: upload.received,
            });
        }
        self.upload = None;
        if upload.filled > 0 {
            upload.word[upload.filled..].fill(0xff);
            let at = IMAGE_OFFSET + upload.length as usize - upload.filled;
            write_word(&mut self.flash, &mut upload, at).map_err(|_| Refusal::Flash)?;
        }
        let image = &self.memory(upload.slot)[IMAGE_OFFSET..][..upload.length as usize];
        let found = CRC.checksum(image);
        if found != upload.crc {
            return Err(Refusal::SceneCrc {
                expected: upload.crc,
                found,
            });
        }
        check(image).map_err(|error| match error {
            ReadError::Image(error) => Refusal::SceneImage(error),
            ReadError::TooManyParts => Refusal::TooManyParts {
                capacity: MAX_PARTS as u16,
            },
            ReadError::NoRecord | ReadError::Damaged => Refusal::Flash,
        })?;
        let record = Record {
            sequence: self.current.map_or(1, |c| c.sequence.wrapping_add(1)),
            length: upload.length,
            crc: upload.crc,
            layout: LAYOUT_VERSION,
        };
        self.flash
            .write(upload.slot, 0, &record.to_bytes())
            .map_err(|_| Refusal::Flash)?;
        // Read back as the next start would.
        let stored = self.read(upload.slot).map_err(|_| Refusal::Flash)?;
        self.next = Some(stored);
        Ok(stored)
    }

    /// Notes that the control plane uses the committed scene: the old one's slot is free.
    pub fn taken_over(&mut self) {
        if let Some(next) = self.next.take() {
            self.current = Some(next);
        }
    }

    /// Notes that the control plane refused the committed scene: it is discarded, in flash too, and the scene in use stays.
    pub fn not_taken_over(&mut self) -> Result<(), Refusal> {
        match self.next.take() {
            None => Ok(()),
            Some(next) => self.flash.erase(next.slot, 0).map_err(|_| Refusal::Flash),
        }
    }

    /// Discards an upload in progress; `false` when there was none.
    pub fn abort(&mut self) -> bool {
        self.upload.take().is_some()
    }

    /// The rig's description in flash.
    pub fn rig(&self) -> rig::Kept {
        rig::kept(&self.flash)
    }

    /// Stores a description that was checked.
    ///
    /// # Errors
    /// `Flash`; the previous description stays.
    pub fn keep_rig(&mut self, rig: &Rig) -> Result<(), Refusal> {
        rig::keep(&mut self.flash, rig)
    }

    /// The flash, for inspection by a test.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// Adds the scene in use and the upload in progress to `hasher`, with the content of their slots. Sequence numbers are relative to `number`, and the
    /// slots to each other: the store treats both alike.
    pub(crate) fn fingerprint(&self, number: u32, hasher: &mut impl Hasher) {
        // The record is read at the start only.
        let image = |slot| self.memory(slot).get(IMAGE_OFFSET..);
        for scene in [self.current, self.next] {
            let content = scene.map(|scene| (scene.sequence.wrapping_sub(number), image(scene.slot)));
            content.hash(hasher);
        }
        let upload = self.upload.map(|upload| (upload.received, image(upload.slot)));
        upload.hash(hasher);
    }

    fn memory(&self, slot: usize) -> &'s [u8] {
        // SAFETY: `slot` is 0 or 1. The slot of `current` or `next` is never erased or written: `begin` takes the other slot and refuses while both
        // are in use, and `taken_over` frees the old one only after the control plane has dropped it. Other results do not outlive a call.
        unsafe { self.flash.slot(slot) }
    }

    fn read(&self, slot: usize) -> Result<Stored<'s>, ReadError> {
        let memory = self.memory(slot);
        let record = Record::from_slot(memory).ok_or(ReadError::NoRecord)?;
        let bytes = memory
            .get(IMAGE_OFFSET..)
            .and_then(|m| m.get(..record.length as usize))
            .ok_or(ReadError::NoRecord)?;
        if CRC.checksum(bytes) != record.crc {
            return Err(ReadError::Damaged);
        }
        Ok(Stored {
            image: check(bytes)?,
            crc: record.crc,
            length: bytes.len(),
            slot,
            sequence: record.sequence,
        })
    }
}

/// Reason why a slot's content is not used.
enum ReadError {
    NoRecord,
    Damaged,
    Image(ImageError),
    TooManyParts,
}

/// Opens an image and checks that this firmware supports it.
fn check(bytes: &[u8]) -> Result<SceneImage<'_>, ReadError> {
    let image = SceneImage::open(bytes).map_err(ReadError::Image)?;
    if image.parts().len() > MAX_PARTS {
        return Err(ReadError::TooManyParts);
    }
    Ok(image)
}

/// Writes the collected word at byte `at` of the slot, erasing ahead where needed.
fn write_word<'s, F: Flash<'s>>(flash: &mut F, upload: &mut Upload, at: usize) -> Result<(), FlashError> {
    while at + WRITE_SIZE > upload.erased {
        flash.erase(upload.slot, upload.erased)?;
        upload.erased += flash.erase_size();
    }
    upload.filled = 0;
    flash.write(upload.slot, at, &upload.word)
}

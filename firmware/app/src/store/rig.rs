//! The rig's description in flash: two slots of one erasable piece each, the newest valid one in use.
//!
//! ```text
//! slot: | record, 32 bytes | description, postcard |
//! record: magic "MRIG0001" | sequence u32 | length u32 | CRC-32 of the description u32 | layout u32 | zero u32 | record CRC-32 u32   (little-endian)
//! ```
//!
//! As with scenes the record is one flash word and written last, into the slot that is not in use: after an interruption at any moment, the previous
//! description is found again. A complete record whose description does not match it, or has another release's layout, is **damaged**: the mechanism
//! this board drives is then unknown, and the board does not arm until a description is uploaded.

use mortise_protocol::image::CRC;
use mortise_protocol::limits::MAX_MESSAGE;
use mortise_protocol::message::Refusal;
use mortise_protocol::rig::{Rig, layout};

use super::sequence::newer;
use crate::board::{Flash, RIG_SLOTS, WRITE_SIZE};

const MAGIC: [u8; 8] = *b"MRIG0001";

/// Content of the flash.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "no heap on the board, and one of these at start"
)]
pub enum Kept {
    /// No description was ever stored.
    Nothing,
    /// A valid description.
    Rig(Rig),
    /// A description that is unreadable or was stored by another release.
    Damaged,
}

impl Kept {
    /// The description, if there is a valid one.
    pub fn rig(&self) -> Option<&Rig> {
        match self {
            Self::Rig(rig) => Some(rig),
            Self::Nothing | Self::Damaged => None,
        }
    }
}

/// A complete record and its slot.
#[derive(Clone, Copy)]
struct Record {
    slot: usize,
    sequence: u32,
    length: usize,
    crc: u32,
    layout: u32,
}

/// Reads what `flash` holds; at most a kilobyte.
pub fn kept<'s, F: Flash<'s>>(flash: &F) -> Kept {
    let Some(record) = newest(flash) else {
        return Kept::Nothing;
    };
    // SAFETY: a rig slot; the bytes are read here and not used afterwards.
    let memory = unsafe { flash.slot(record.slot) };
    let bytes = memory.get(WRITE_SIZE..).and_then(|m| m.get(..record.length));
    let rig = bytes
        .filter(|bytes| record.layout == layout() && CRC.checksum(bytes) == record.crc)
        .and_then(|bytes| postcard::from_bytes::<Rig>(bytes).ok())
        .filter(|rig| rig.check().is_ok());
    rig.map_or(Kept::Damaged, Kept::Rig)
}

/// Writes `rig`, already checked, into the slot that is not in use.
///
/// # Errors
/// `Flash`; the previous description stays.
pub fn keep<'s, F: Flash<'s>>(flash: &mut F, rig: &Rig) -> Result<(), Refusal> {
    let before = newest(flash);
    let slot = match before {
        Some(record) if record.slot == RIG_SLOTS[0] => RIG_SLOTS[1],
        _ => RIG_SLOTS[0],
    };
    let mut buffer = [0u8; MAX_MESSAGE];
    // It arrived in a message, so it fits.
    let bytes = postcard::to_slice(rig, &mut buffer).map_err(|_| Refusal::Flash)?;
    let length = bytes.len();
    let crc = CRC.checksum(bytes);
    flash.erase(slot, 0).map_err(|_| Refusal::Flash)?;
    for (number, piece) in bytes.chunks(WRITE_SIZE).enumerate() {
        let mut word = [0xff; WRITE_SIZE];
        word[..piece.len()].copy_from_slice(piece);
        (flash.write(slot, WRITE_SIZE * (1 + number), &word)).map_err(|_| Refusal::Flash)?;
    }
    let mut record = [0u8; WRITE_SIZE];
    record[..8].copy_from_slice(&MAGIC);
    let sequence = before.map_or(1, |record| record.sequence.wrapping_add(1));
    for (place, word) in record[8..]
        .chunks_exact_mut(4)
        .zip([sequence, length as u32, crc, layout(), 0])
    {
        place.copy_from_slice(&word.to_le_bytes());
    }
    let crc = CRC.checksum(&record[..28]);
    record[28..].copy_from_slice(&crc.to_le_bytes());
    flash.write(slot, 0, &record).map_err(|_| Refusal::Flash)?;
    // Read back as the next start would.
    match kept(flash) {
        Kept::Rig(found) if found == *rig => Ok(()),
        _ => Err(Refusal::Flash),
    }
}

fn newest<'s, F: Flash<'s>>(flash: &F) -> Option<Record> {
    let mut newest: Option<Record> = None;
    for slot in RIG_SLOTS {
        // SAFETY: a rig slot; the bytes are read here and not used afterwards.
        let memory = unsafe { flash.slot(slot) };
        let Some(bytes) = memory.first_chunk::<WRITE_SIZE>() else {
            continue;
        };
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        if bytes[..8] != MAGIC || CRC.checksum(&bytes[..28]) != word(28) {
            continue;
        }
        let found = Record {
            slot,
            sequence: word(8),
            length: word(12) as usize,
            crc: word(16),
            layout: word(20),
        };
        if newest.is_none_or(|newest| newer(found.sequence, newest.sequence)) {
            newest = Some(found);
        }
    }
    newest
}

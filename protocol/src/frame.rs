//! Frames: `COBS( sequence: u16 LE | message: postcard | stamp | CRC-32/ISO-HDLC: u32 LE ) 0x00`.
//!
//! The [`Stamp`] (session: u32 LE, count: u32 LE) is absent from every frame of a board and from a host's greeting. The checksum covers all preceding
//! bytes. The delimiter never occurs inside a frame, so a reader that has lost synchronisation regains it at the next zero: garbage costs at most one
//! good frame after it.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::image::CRC;
use crate::limits::MAX_FRAME;

const SEQUENCE: usize = 2;
const CHECKSUM: usize = 4;

/// Distinguishes a new command from one that was repeated, delayed, or sent to an earlier session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Stamp {
    /// [`crate::message::Capabilities::session`] of the session the command is meant for.
    pub session: u32,
    /// Increases with every frame that the host sends in that session.
    pub count: u32,
}

impl Stamp {
    /// Size of a stamp in a frame, bytes.
    pub const BYTES: usize = 8;

    fn to_bytes(self) -> [u8; Self::BYTES] {
        let word = u64::from(self.session) | u64::from(self.count) << 32;
        word.to_le_bytes()
    }

    fn from_bytes(bytes: [u8; Self::BYTES]) -> Self {
        let word = u64::from_le_bytes(bytes);
        Self {
            session: word as u32,
            count: (word >> 32) as u32,
        }
    }
}

/// Content of a valid frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received<M> {
    /// Sequence number.
    pub sequence: u16,
    /// The stamp, if the sender included one.
    pub stamp: Option<Stamp>,
    /// The message.
    pub message: M,
}

/// Why bytes between two delimiters are not a valid frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// Longer than [`MAX_FRAME`].
    TooLong,
    /// Not COBS, or shorter than a sequence number and a checksum.
    Malformed,
    /// The checksum does not match.
    Crc,
    /// A valid frame whose message is unknown in this version. Contains the sequence number so that the frame can be refused.
    Undecodable(u16),
}

/// A message did not fit into [`crate::limits::MAX_MESSAGE`] bytes or into the given buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge;

/// Writes one frame with delimiter and without a stamp into `out`; a buffer of [`MAX_FRAME`] bytes is always large enough. Returns the used part.
pub fn encode<'o, M: Serialize>(sequence: u16, message: &M, out: &'o mut [u8]) -> Result<&'o [u8], TooLarge> {
    encode_stamped(sequence, None, message, out)
}

/// As [`encode`], with a stamp.
pub fn encode_stamped<'o, M: Serialize>(
    sequence: u16,
    stamp: Option<Stamp>,
    message: &M,
    out: &'o mut [u8],
) -> Result<&'o [u8], TooLarge> {
    let mut raw = [0u8; crate::limits::MAX_MESSAGE + SEQUENCE + Stamp::BYTES + CHECKSUM];
    raw[..SEQUENCE].copy_from_slice(&sequence.to_le_bytes());
    let room = SEQUENCE + crate::limits::MAX_MESSAGE;
    let body = postcard::to_slice(message, &mut raw[SEQUENCE..room])
        .map_err(|_| TooLarge)?
        .len();
    let mut end = SEQUENCE + body;
    if let Some(stamp) = stamp {
        raw[end..end + Stamp::BYTES].copy_from_slice(&stamp.to_bytes());
        end += Stamp::BYTES;
    }
    let crc = CRC.checksum(&raw[..end]);
    raw[end..end + CHECKSUM].copy_from_slice(&crc.to_le_bytes());
    if out.len() < cobs::max_encoding_length(end + CHECKSUM) + 1 {
        return Err(TooLarge);
    }
    let used = cobs::encode(&raw[..end + CHECKSUM], out);
    out[used] = 0;
    Ok(&out[..=used])
}

/// Collects bytes into frames. Stores at most [`MAX_FRAME`] bytes for any input.
#[derive(Clone, Debug)]
pub struct Decoder {
    buffer: [u8; MAX_FRAME],
    used: usize,
    overflow: bool,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// Creates an empty decoder.
    pub const fn new() -> Self {
        Self {
            buffer: [0; MAX_FRAME],
            used: 0,
            overflow: false,
        }
    }

    /// Takes one byte; at a delimiter it returns the result for the bytes before it. Empty frames (repeated delimiters) are skipped, so a sender may
    /// start with a delimiter to flush garbage. The stamp, if any, is read and discarded.
    pub fn push<M: DeserializeOwned>(&mut self, byte: u8) -> Option<Result<(u16, M), FrameError>> {
        let received = self.push_stamped(byte)?;
        Some(received.map(|frame| (frame.sequence, frame.message)))
    }

    /// As [`Self::push`], but also returns the stamp.
    pub fn push_stamped<M: DeserializeOwned>(&mut self, byte: u8) -> Option<Result<Received<M>, FrameError>> {
        if byte != 0 {
            if let Some(place) = self.buffer.get_mut(self.used) {
                *place = byte;
                self.used += 1;
            } else {
                self.overflow = true;
            }
            return None;
        }
        let used = core::mem::take(&mut self.used);
        if core::mem::take(&mut self.overflow) {
            return Some(Err(FrameError::TooLong));
        }
        if used == 0 {
            return None;
        }
        Some(decode(&mut self.buffer[..used]))
    }
}

fn decode<M: DeserializeOwned>(cobs_bytes: &mut [u8]) -> Result<Received<M>, FrameError> {
    let length = cobs::decode_in_place(cobs_bytes).map_err(|_| FrameError::Malformed)?;
    let raw = &cobs_bytes[..length];
    let body_end = length
        .checked_sub(CHECKSUM)
        .filter(|&n| n > SEQUENCE)
        .ok_or(FrameError::Malformed)?;
    let (covered, crc) = raw.split_at(body_end);
    if CRC.checksum(covered).to_le_bytes() != crc {
        return Err(FrameError::Crc);
    }
    let sequence = u16::from_le_bytes([covered[0], covered[1]]);
    let undecodable = FrameError::Undecodable(sequence);
    let (message, rest) = postcard::take_from_bytes(&covered[SEQUENCE..]).map_err(|_| undecodable)?;
    let stamp = match rest {
        [] => None,
        _ => Some(Stamp::from_bytes(rest.try_into().map_err(|_| undecodable)?)),
    };
    Ok(Received {
        sequence,
        stamp,
        message,
    })
}

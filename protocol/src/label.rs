//! What a file of firmware states about itself: a program that writes it to a board reads it first, and compares it with its own version.
//!
//! A board's program contains one [`Label`] as the static variable [`SYMBOL`]; the ELF file's table of symbols tells where it is.

use crate::message::{SCHEMA_HASH, Version};

/// Name of the variable.
pub const SYMBOL: &str = "MORTISE_FIRMWARE";
/// Longest name of a board or a chip, bytes.
pub const MAX_TEXT: usize = 32;

const MAGIC: [u8; 8] = *b"mortise1";

/// Frozen layout: little-endian numbers, names in UTF-8 that are filled up with zeros.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Label {
    magic: [u8; 8],
    schema: [u8; 8],
    release: [[u8; 2]; 3],
    board: [u8; MAX_TEXT],
    chip: [u8; MAX_TEXT],
}

impl Label {
    /// Size, bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// The label of this build for a board and its chip, the latter as debug probes name it. Does not compile in a constant if a name is longer than
    /// [`MAX_TEXT`].
    pub const fn new(board: &str, chip: &str) -> Self {
        let release = Version::own().release;
        Self {
            magic: MAGIC,
            schema: SCHEMA_HASH.to_le_bytes(),
            release: [
                release[0].to_le_bytes(),
                release[1].to_le_bytes(),
                release[2].to_le_bytes(),
            ],
            board: filled(board),
            chip: filled(chip),
        }
    }

    /// The bytes of the label, as they lie in flash.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let [a, b, c] = self.release;
        let parts: [&[u8]; 7] = [&self.magic, &self.schema, &a, &b, &c, &self.board, &self.chip];
        let mut at = 0;
        for part in parts {
            bytes[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
        bytes
    }

    /// Reads a label; `None` if the bytes are none.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (magic, rest) = bytes.split_first_chunk::<8>()?;
        let (schema, rest) = rest.split_first_chunk()?;
        let (release, rest) = rest.split_first_chunk::<6>()?;
        let (board, rest) = rest.split_first_chunk()?;
        let (chip, _) = rest.split_first_chunk()?;
        let label = Self {
            magic: *magic,
            schema: *schema,
            release: [0, 2, 4].map(|at| [release[at], release[at + 1]]),
            board: *board,
            chip: *chip,
        };
        let names = text(&label.board).is_some() && text(&label.chip).is_some();
        (label.magic == MAGIC && names).then_some(label)
    }

    /// Version of the firmware.
    pub fn version(&self) -> Version {
        Version {
            schema: u64::from_le_bytes(self.schema),
            release: self.release.map(u16::from_le_bytes),
        }
    }

    /// Name of the board that it is for.
    pub fn board(&self) -> &str {
        text(&self.board).unwrap_or_default()
    }

    /// Name of its chip.
    pub fn chip(&self) -> &str {
        text(&self.chip).unwrap_or_default()
    }
}

const fn filled(name: &str) -> [u8; MAX_TEXT] {
    let (mut bytes, mut at) = ([0; MAX_TEXT], 0);
    while at < name.len() {
        bytes[at] = name.as_bytes()[at];
        at += 1;
    }
    bytes
}

/// A name of printable characters, so that it can be an argument of a program.
fn text(bytes: &[u8; MAX_TEXT]) -> Option<&str> {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(MAX_TEXT);
    let name = core::str::from_utf8(&bytes[..end]).ok()?;
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    (name.starts_with(|c: char| c.is_ascii_alphanumeric()) && name.chars().all(plain)).then_some(name)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_label_is_read_as_it_was_made() {
        const LABEL: Label = Label::new("some-board", "STM32H743ZITx");
        let read = Label::read(&LABEL.to_bytes()).unwrap();
        assert_eq!(read, LABEL);
        assert_eq!((read.board(), read.chip()), ("some-board", "STM32H743ZITx"));
        assert_eq!(read.version(), Version::own());
        // As the compiler lays it out.
        let parts = [8, 8, 6, MAX_TEXT, MAX_TEXT];
        assert_eq!(Label::BYTES, parts.iter().sum::<usize>());
    }

    proptest! {
        #[test]
        fn damaged_labels_are_refused_or_keep_plain_names(
            at in 0..Label::BYTES, byte in any::<u8>(), length in 0..=Label::BYTES,
        ) {
            let mut bytes = Label::new("board", "chip").to_bytes();
            bytes[at] = byte;
            if let Some(label) = Label::read(&bytes[..length]) {
                prop_assert_eq!(length, Label::BYTES);
                for name in [label.board(), label.chip()] {
                    prop_assert!(name.starts_with(|c: char| c.is_ascii_alphanumeric()), "{}", name);
                    prop_assert!(!name.contains(|c: char| c.is_whitespace() || c.is_control()));
                }
            }
        }
    }
}

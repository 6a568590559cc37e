//! Why bytes are not a scene image.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Why bytes were refused as a scene image. Each says what to do where there is a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ImageError {
    /// Fewer bytes than a header, or than the header says.
    TooShort {
        /// Bytes needed.
        needed: u32,
        /// Bytes there.
        got: u32,
    },
    /// Not a scene image.
    BadMagic,
    /// Another layout.
    Layout {
        /// This side's version.
        expected: u32,
        /// The image's version.
        found: u32,
    },
    /// Damaged.
    Crc {
        /// As stored.
        expected: u32,
        /// As computed.
        found: u32,
    },
    /// The memory it lies in is not aligned to 4 bytes.
    Misaligned,
    /// A section lies outside the image or overlaps the header.
    Section {
        /// Position in the header's list, from 0.
        section: u8,
    },
    /// A record refers to something that is not there, or holds a number that cannot be.
    Record {
        /// Position of its section in the header's list, from 0.
        section: u8,
        /// Index of the record.
        index: u32,
    },
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort { needed, got } => {
                write!(f, "scene image cut short: {got} of {needed} bytes; bake it again")
            }
            Self::BadMagic => write!(f, "not a scene image: bake a STEP file first"),
            Self::Layout { expected, found } => {
                write!(
                    f,
                    "scene image has layout {found}, this side reads {expected}: bake it again with the matching program"
                )
            }
            Self::Crc { expected, found } => {
                write!(
                    f,
                    "scene image damaged: checksum {found:08x} instead of {expected:08x}; bake or send it again"
                )
            }
            Self::Misaligned => write!(f, "scene image lies at an address that is not a multiple of 4"),
            Self::Section { section } => write!(
                f,
                "scene image damaged: section {section} lies outside it; bake it again"
            ),
            Self::Record { section, index } => {
                write!(
                    f,
                    "scene image damaged: record {index} of section {section} is impossible; bake it again"
                )
            }
        }
    }
}

impl core::error::Error for ImageError {}

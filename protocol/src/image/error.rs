//! Why bytes are not a valid scene image.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Why bytes were refused as a scene image. The messages state a remedy where there is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ImageError {
    /// Fewer bytes than a header, or fewer than the header states.
    TooShort {
        /// Bytes needed.
        needed: u32,
        /// Bytes present.
        got: u32,
    },
    /// No scene image: the magic number is wrong.
    BadMagic,
    /// A different layout version.
    Layout {
        /// Version that this side reads.
        expected: u32,
        /// Version of the image.
        found: u32,
    },
    /// The checksum does not match: the image is damaged.
    Crc {
        /// As stored.
        expected: u32,
        /// As computed.
        found: u32,
    },
    /// The image is in memory that is not aligned to 4 bytes.
    Misaligned,
    /// A section lies outside the image or overlaps the header.
    Section {
        /// Position in the header's list, from 0; energies, their charges and their nodes are 13, 14 and 15.
        section: u8,
    },
    /// A record refers to something outside the image, or contains an impossible number.
    Record {
        /// Position of its section, as above.
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

//! A file of firmware, and its label.

use std::path::{Path, PathBuf};

use mortise_protocol::label::{Label, SYMBOL};
use mortise_protocol::message::Version;
use object::read::elf::ElfFile32;
use object::{LittleEndian, Object, ObjectSegment, ObjectSymbol};

use crate::error::{FlashError, words};

/// Largest file that is read, bytes; a board's flash has 2 MiB, and debug information may be as large again.
const MAX_BYTES: u64 = 256 << 20;

/// Firmware of this program's protocol, ready to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Firmware {
    path: PathBuf,
    label: Label,
}

impl Firmware {
    /// Reads a file's label, and compares its version with this program's.
    ///
    /// # Errors
    /// [`FlashError::Unreadable`], [`FlashError::NotFirmware`], [`FlashError::OtherVersion`].
    pub fn read(path: &Path) -> Result<Self, FlashError> {
        let unreadable = |why| FlashError::Unreadable {
            path: path.to_owned(),
            why,
        };
        let size = std::fs::metadata(path).map_err(unreadable)?.len();
        let not = |why| FlashError::NotFirmware {
            path: path.to_owned(),
            why,
        };
        if size > MAX_BYTES {
            return Err(not("it is larger than any firmware"));
        }
        let bytes = std::fs::read(path).map_err(unreadable)?;
        let label = label_of(&bytes).map_err(not)?;
        let version = label.version();
        if version.schema != Version::own().schema {
            return Err(FlashError::OtherVersion {
                path: path.to_owned(),
                firmware: version,
            });
        }
        Ok(Self {
            path: path.to_owned(),
            label,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The board that it is for.
    pub fn board(&self) -> &str {
        self.label.board()
    }

    /// Its chip, as debug probes name it.
    pub fn chip(&self) -> &str {
        self.label.chip()
    }

    /// Board and release in words.
    pub fn words(&self) -> String {
        format!("{}, release {}", self.board(), words(&self.label.version()))
    }
}

/// The label in an ELF file.
fn label_of(bytes: &[u8]) -> Result<Label, &'static str> {
    let file =
        ElfFile32::<LittleEndian>::parse(bytes).map_err(|_| "not an ELF file for a 32-bit processor")?;
    if file.architecture() != object::Architecture::Arm {
        return Err("for another processor than those of boards");
    }
    let label = (file.symbol_by_name(SYMBOL)).ok_or("it has no label of Mortise's firmware")?;
    let bytes = (file.segments()).find_map(|segment| {
        let found = segment.data_range(label.address(), Label::BYTES as u64);
        found.ok().flatten()
    });
    bytes.and_then(Label::read).ok_or("its label is damaged")
}

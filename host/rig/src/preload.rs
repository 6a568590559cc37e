//! A scene in the emulated board's flash from the start, as if it had been sent before.
//!
//! The emulated UART takes a byte at a time: a scene of 440 kB is 11 s on its way (two cores shared with others, 2026-11-23). QEMU's generic loader
//! copies a file into the board's memory while the machine is made, and again at each reset: a board that restarts has this scene in the first
//! slot, whatever was there.

use std::io::Write as _;

use mortise_firmware::store::{IMAGE_OFFSET, commit_record};
use tempfile::{Builder, NamedTempFile};

/// First byte of the first scene slot: firmware/boards/mps2/src/memory.rs.
const SLOT: u32 = 0x6000_0000;
/// Bytes in a slot, likewise.
const SLOT_SIZE: usize = 2 * 1024 * 1024;

/// What the first slot starts with; the file is removed when this is dropped, which must not be before QEMU has read it.
pub(crate) struct Preload(NamedTempFile);

impl Preload {
    /// The slot with `image` in it; `None` where the image is larger than the slot.
    ///
    /// # Errors
    /// What the operating system says of a temporary file.
    pub fn new(image: &[u8]) -> std::io::Result<Option<Self>> {
        if IMAGE_OFFSET + image.len() > SLOT_SIZE {
            return Ok(None);
        }
        let mut file = Builder::new().prefix("mortise-").suffix(".slot").tempfile()?;
        file.write_all(&commit_record(1, image))?;
        file.write_all(image)?;
        file.flush()?;
        Ok(Some(Self(file)))
    }

    /// QEMU's arguments.
    pub fn arguments(&self) -> [String; 2] {
        // A comma in a value is written twice.
        let file = self.0.path().to_string_lossy().replace(',', ",,");
        let device = format!("loader,file={file},addr={SLOT:#x},force-raw=on");
        ["-device".into(), device]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slot_is_record_and_image() {
        let image = [7; 100];
        let slot = Preload::new(&image).expect("a temporary file").expect("it fits");
        let bytes = std::fs::read(slot.0.path()).expect("written");
        assert_eq!(bytes.len(), IMAGE_OFFSET + image.len());
        assert_eq!(bytes[IMAGE_OFFSET..], image);
        assert!(slot.arguments()[1].ends_with("addr=0x60000000,force-raw=on"));
        let large = vec![0; SLOT_SIZE];
        assert!(Preload::new(&large).expect("nothing to write").is_none());
    }
}

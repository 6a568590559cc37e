//! A scene image without parts, of any size, for checks of the link that need no geometry.

use mortise_protocol::image::{CRC, Header, LAYOUT_VERSION, MAGIC};

/// Sections in a header, and the place of the blob among them.
const SECTIONS: usize = 13;
/// See [`SECTIONS`].
const BLOB: usize = 10;

/// A valid scene image without parts: a header and `filling` bytes (rounded up to 4) that depend on `seed`.
pub fn image(filling: usize, seed: u8) -> Vec<u8> {
    let head = size_of::<Header>();
    let filling = filling.next_multiple_of(4);
    let length = head + filling;
    let mut bytes = MAGIC.to_vec();
    // The header is little-endian `u32`s: layout, length, CRC, energies, then offset and count of each section.
    let words = [LAYOUT_VERSION, length as u32, 0, 0];
    let sections = (0..SECTIONS).flat_map(|section| {
        let count = if section == BLOB { filling as u32 } else { 0 };
        [head as u32, count]
    });
    bytes.extend(words.into_iter().chain(sections).flat_map(u32::to_le_bytes));
    bytes.extend((0..filling).map(|i| (i as u8).wrapping_mul(31).wrapping_add(seed)));
    let crc = CRC.checksum(&bytes[20..]);
    bytes[16..20].copy_from_slice(&crc.to_le_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_the_length_it_says() {
        for filling in [0, 1, 1000, 5001] {
            let bytes = image(filling, 3);
            let said = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]);
            assert_eq!(bytes.len(), said as usize);
            assert_eq!(bytes.len(), size_of::<Header>() + filling.next_multiple_of(4));
        }
    }
}

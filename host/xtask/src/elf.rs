//! Loadable segments of a 32-bit little-endian ELF file, which is what boards run.
//!
//! Source: *Tool Interface Standard, Executable and Linking Format* 1.2, figures 1-3 and 2-1.

use anyhow::{Result, bail};

/// One `PT_LOAD` program header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Where it is when the program runs.
    pub address: u32,
    /// Where it is stored: in flash for initialised data, which start-up copies to RAM.
    pub stored_at: u32,
    /// Bytes stored.
    pub stored_bytes: u32,
    /// Bytes taken when the program runs; what exceeds `stored_bytes` is zeroed.
    pub bytes: u32,
}

const PROGRAM_HEADERS_AT: usize = 0x1c;
const PROGRAM_HEADER_BYTES_AT: usize = 0x2a;
const PROGRAM_HEADER_COUNT_AT: usize = 0x2c;
const TYPE_LOAD: u32 = 1;

/// Segments that take memory, in the file's order.
///
/// # Errors
/// When `file` is not a 32-bit little-endian ELF file, or ends early.
pub fn segments(file: &[u8]) -> Result<Vec<Segment>> {
    // Magic, class 1 (32 bit), data 1 (little-endian).
    if !file.starts_with(b"\x7fELF\x01\x01") {
        bail!("not a 32-bit little-endian ELF file");
    }
    let table = word(file, PROGRAM_HEADERS_AT)? as usize;
    let stride = usize::from(half(file, PROGRAM_HEADER_BYTES_AT)?);
    let count = usize::from(half(file, PROGRAM_HEADER_COUNT_AT)?);
    let mut found = Vec::new();
    for index in 0..count {
        let at = table.saturating_add(index * stride);
        if word(file, at)? == TYPE_LOAD {
            let segment = Segment {
                address: word(file, at.saturating_add(8))?,
                stored_at: word(file, at.saturating_add(12))?,
                stored_bytes: word(file, at.saturating_add(16))?,
                bytes: word(file, at.saturating_add(20))?,
            };
            if segment.bytes > 0 {
                found.push(segment);
            }
        }
    }
    Ok(found)
}

fn word(file: &[u8], at: usize) -> Result<u32> {
    match file
        .get(at..at.saturating_add(4))
        .and_then(|bytes| bytes.try_into().ok())
    {
        Some(bytes) => Ok(u32::from_le_bytes(bytes)),
        None => bail!("the ELF file ends before byte {at}"),
    }
}

fn half(file: &[u8], at: usize) -> Result<u16> {
    match file
        .get(at..at.saturating_add(2))
        .and_then(|bytes| bytes.try_into().ok())
    {
        Some(bytes) => Ok(u16::from_le_bytes(bytes)),
        None => bail!("the ELF file ends before byte {at}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF header of 52 bytes, then program headers of 32 bytes each.
    fn file_with(headers: &[[u32; 8]]) -> Vec<u8> {
        let mut file = vec![0; 52];
        file[..6].copy_from_slice(b"\x7fELF\x01\x01");
        file[0x1c..0x20].copy_from_slice(&52_u32.to_le_bytes());
        file[0x2a..0x2c].copy_from_slice(&32_u16.to_le_bytes());
        file[0x2c..0x2e].copy_from_slice(&(headers.len() as u16).to_le_bytes());
        for header in headers {
            file.extend(header.iter().flat_map(|word| word.to_le_bytes()));
        }
        file
    }

    #[test]
    fn loadable_segments_are_read_and_others_left_out() {
        let file = file_with(&[
            [1, 0x1000, 0x0800_0000, 0x0800_0000, 100, 100, 5, 4],
            [1, 0x2000, 0x2000_0000, 0x0800_0064, 8, 24, 6, 4],
            [1, 0, 0x2000_0018, 0x2000_0018, 0, 0, 6, 4],
            [0x6474_e551, 0, 0, 0, 0, 0, 6, 4],
        ]);
        assert_eq!(
            segments(&file).unwrap(),
            [
                Segment {
                    address: 0x0800_0000,
                    stored_at: 0x0800_0000,
                    stored_bytes: 100,
                    bytes: 100
                },
                Segment {
                    address: 0x2000_0000,
                    stored_at: 0x0800_0064,
                    stored_bytes: 8,
                    bytes: 24
                },
            ]
        );
    }

    #[test]
    fn files_cut_at_any_byte_are_refused() {
        let file = file_with(&[[1, 0x1000, 0x0800_0000, 0x0800_0000, 100, 100, 5, 4]]);
        // The last two words of the header are not read.
        for length in 0..file.len() - 8 {
            assert!(segments(&file[..length]).is_err(), "{length} bytes");
        }
        assert!(segments(b"\x7fELF\x02\x01 a 64-bit file").is_err());
    }
}

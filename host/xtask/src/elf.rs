//! Loadable segments of a 32-bit little-endian ELF file, which is what boards run.

use anyhow::{Context, Result};
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{ElfFile32, FileHeader as _, ProgramHeader as _};
use object::{LittleEndian, Object as _};

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

/// Segments that take memory, in the file's order.
///
/// # Errors
/// When `file` is not a 32-bit little-endian ELF file, or ends early.
pub fn segments(file: &[u8]) -> Result<Vec<Segment>> {
    let header = FileHeader32::<LittleEndian>::parse(file).context("not a 32-bit ELF file")?;
    let endian = header.endian().context("not a little-endian ELF file")?;
    let headers = header
        .program_headers(endian, file)
        .context("the ELF file ends before its program headers")?;
    let segments = headers.iter().filter(|header| header.p_type(endian) == PT_LOAD);
    Ok(segments
        .map(|header| Segment {
            address: header.p_vaddr(endian),
            stored_at: header.p_paddr(endian),
            stored_bytes: header.p_filesz(endian),
            bytes: header.p_memsz(endian),
        })
        .filter(|segment| segment.bytes > 0)
        .collect())
}

/// Whether the file's table of symbols has this name.
///
/// # Errors
/// When `file` is not a 32-bit little-endian ELF file.
pub fn has_symbol(file: &[u8], name: &str) -> Result<bool> {
    let file = ElfFile32::<LittleEndian>::parse(file).context("not a 32-bit ELF file")?;
    Ok(file.symbol_by_name(name).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF header of 52 bytes, then program headers of 32 bytes each.
    fn file_with(headers: &[[u32; 8]]) -> Vec<u8> {
        let mut file = vec![0; 52];
        // Magic, 32 bit, little-endian, version 1.
        file[..7].copy_from_slice(b"\x7fELF\x01\x01\x01");
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
        for length in 0..file.len() {
            assert!(segments(&file[..length]).is_err(), "{length} bytes");
        }
        assert!(segments(b"\x7fELF\x02\x01 a 64-bit file").is_err());
    }
}

//! Memory use of this program and of the emulator, and size of the firmware's statics.

use std::path::Path;

use mortise_rig::{RigSpec, firmware_path};

/// Resident memory, KiB; 0 where the operating system does not report it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    pub(super) program_kib: u64,
    pub(super) emulator_kib: u64,
}

/// Current memory use: on Linux from `/proc`, 0 elsewhere.
pub(super) fn now() -> Memory {
    let own = Path::new("/proc/self");
    let Some(program_kib) = resident(own) else {
        return Memory::default();
    };
    Memory {
        program_kib,
        emulator_kib: emulator(std::process::id()).unwrap_or(0),
    }
}

fn resident(process: &Path) -> Option<u64> {
    let status = std::fs::read_to_string(process.join("status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Resident memory of this process's QEMU child, KiB.
fn emulator(parent: u32) -> Option<u64> {
    let processes = std::fs::read_dir("/proc").ok()?;
    let ours = format!("PPid:\t{parent}");
    processes
        .filter_map(Result::ok)
        .map(|entry| entry.path())
        .find_map(|process| {
            let status = std::fs::read_to_string(process.join("status")).ok()?;
            let qemu = status.lines().next()?.contains("qemu");
            (qemu && status.lines().any(|line| line == ours)).then(|| resident(&process))?
        })
}

/// Bytes of RAM of the firmware's statics: segments of its ELF file in the Cortex-M's SRAM region (0x2000_0000 to 0x3fff_ffff). 0 for a rig without a
/// firmware file.
pub(super) fn statics(spec: &RigSpec) -> u64 {
    let RigSpec::Emulated { firmware, .. } = spec else {
        return 0;
    };
    (firmware_path(firmware.as_deref()).ok())
        .and_then(|path| std::fs::read(path).ok())
        .and_then(|file| in_ram(&file))
        .unwrap_or(0)
}

/// Sum of `p_memsz` over `PT_LOAD` program headers in RAM, of a 32-bit little-endian ELF file (*Tool Interface Standard, ELF* 1.2, figure 2-1).
fn in_ram(file: &[u8]) -> Option<u64> {
    let word = |at: usize| Some(u32::from_le_bytes(file.get(at..at + 4)?.try_into().ok()?));
    let half = |at: usize| {
        Some(usize::from(u16::from_le_bytes(
            file.get(at..at + 2)?.try_into().ok()?,
        )))
    };
    if !file.starts_with(b"\x7fELF\x01\x01") {
        return None;
    }
    let (table, stride, count) = (word(0x1c)? as usize, half(0x2a)?, half(0x2c)?);
    let mut sum = 0;
    for header in (0..count).map(|number| table + number * stride) {
        let (kind, address, bytes) = (word(header)?, word(header + 8)?, word(header + 20)?);
        if kind == 1 && (0x2000_0000..0x4000_0000).contains(&address) {
            sum += u64::from(bytes);
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_in_ram_are_added_up_and_others_are_not() {
        let mut file = vec![0u8; 0x34 + 3 * 32];
        file[..6].copy_from_slice(b"\x7fELF\x01\x01");
        file[0x1c] = 0x34;
        file[0x2a] = 32;
        file[0x2c] = 3;
        for (number, (kind, address, bytes)) in
            [(1u32, 0x2000_0000u32, 70u32), (1, 0, 5), (1, 0x2002_0000, 30)]
                .into_iter()
                .enumerate()
        {
            let at = 0x34 + 32 * number;
            for (place, value) in [(at, kind), (at + 8, address), (at + 20, bytes)] {
                file[place..place + 4].copy_from_slice(&value.to_le_bytes());
            }
        }
        assert_eq!(in_ram(&file), Some(100));
        assert_eq!(in_ram(&file[..0x50]), None);
        assert_eq!(in_ram(b"MZ"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_program_takes_some_memory() {
        assert!(now().program_kib > 100);
    }
}

//! A simulated debug probe with a board, and firmware for it: what tests write to, with faults.

use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use mortise_protocol::label::{Label, SYMBOL};

use crate::prober::Prober;

/// What is wrong with a simulated probe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fault {
    /// Nothing.
    #[default]
    None,
    /// No probe is connected.
    Unplugged,
    /// The operator may not use the probe.
    Forbidden,
    /// A second probe is connected.
    Two,
    /// The board has no power.
    Unpowered,
    /// The cable is pulled while writing.
    Pulled,
    /// What is read back differs from what was written.
    Worn,
    /// The program says nothing more while writing.
    Silent,
    /// The program cannot list probes.
    Unlisted,
    /// The board is written and does not start again.
    NotReset,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::None,
        Self::Unplugged,
        Self::Forbidden,
        Self::Two,
        Self::Unpowered,
        Self::Pulled,
        Self::Worn,
        Self::Silent,
        Self::Unlisted,
        Self::NotReset,
    ];
}

/// A folder with a program that answers as `probe-rs` does, and the flash of a board.
pub struct SimulatedProbe(PathBuf);

impl SimulatedProbe {
    /// Makes one in an empty folder.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn new(folder: &Path, fault: Fault) -> io::Result<Self> {
        let program = folder.join("probe-rs");
        fs::write(&program, script(fault))?;
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755))?;
        Ok(Self(folder.to_owned()))
    }

    /// The program.
    pub fn prober(&self) -> Prober {
        Prober::at(self.0.join("probe-rs"))
    }

    /// The flash of the board, if it was written; a part of the file when writing ended early.
    pub fn flash(&self) -> Option<Vec<u8>> {
        fs::read(self.0.join("flash")).ok()
    }

    /// How the program was called, a line each time.
    pub fn calls(&self) -> String {
        fs::read_to_string(self.0.join("calls")).unwrap_or_default()
    }
}

fn script(fault: Fault) -> String {
    let first = "[0]: STLink V2-1 -- 0483:374b:066FFF485550755187121723 (ST-LINK)";
    let list = match fault {
        Fault::Unplugged => "No debug probes were found.".to_owned(),
        Fault::Forbidden => format!("The following debug probes were found:\n{first} (inaccessible)"),
        Fault::Two => format!(
            "The following debug probes were found:\n{first}\n[1]: J-Link -- 1366:0101:000123456789 (J-Link)"
        ),
        _ => format!("The following debug probes were found:\n{first}"),
    };
    let list = match fault {
        Fault::Unlisted => r#"echo "Error: no USB bus" >&2; exit 1"#.to_owned(),
        _ => format!("echo '{list}'"),
    };
    let reset = match fault {
        Fault::NotReset => r#"echo "Error: reset timed out" >&2; exit 1"#,
        _ => "",
    };
    let download = match fault {
        Fault::Unpowered => {
            r#"echo "Error: Connecting to the chip was unsuccessful." >&2; echo "Caused by: Target device did not respond" >&2; exit 1"#
        }
        Fault::Pulled => {
            r#"head -c 100 "$file" > "$here/flash"; echo "      Erasing"; echo "  Programming"; echo "Error: USB Communication Error" >&2; exit 1"#
        }
        Fault::Worn => {
            r#"cp "$file" "$here/flash"; echo "  Programming"; echo "Error: The verification failed: contents differ" >&2; exit 1"#
        }
        Fault::Silent => r#"echo "      Erasing"; exec sleep 600"#,
        _ => {
            r#"cp "$file" "$here/flash"; echo "      Erasing"; echo "  Programming"; echo "    Verifying"; echo "     Finished in 5.2s""#
        }
    };
    format!(
        r#"#!/bin/sh
here="$(dirname "$0")"
echo "$*" >> "$here/calls"
for argument; do file="$argument"; done
case "$1" in
list) {list} ;;
download) {download} ;;
reset) {reset} ;;
*) echo "unrecognized subcommand $1" >&2; exit 2 ;;
esac
"#
    )
}

/// An ELF file that holds a label as a board's firmware does.
pub fn firmware(label: &Label) -> Vec<u8> {
    const FLASH: u32 = 0x0800_0000;
    const HEADER: u32 = 52;
    const PROGRAM_HEADER: u32 = 32;
    const SECTION_HEADER: u32 = 40;
    let names = format!("\0{SYMBOL}\0");
    let at_label = HEADER + PROGRAM_HEADER;
    let at_symbols = at_label + Label::BYTES as u32;
    let at_names = at_symbols + 32;
    let at_sections = at_names + names.len() as u32;
    let mut file = b"\x7fELF\x01\x01\x01".to_vec();
    file.resize(16, 0);
    let half = |file: &mut Vec<u8>, values: &[u16]| {
        values.iter().for_each(|value| file.extend(value.to_le_bytes()));
    };
    let words = |file: &mut Vec<u8>, values: &[u32]| {
        values.iter().for_each(|value| file.extend(value.to_le_bytes()));
    };
    // An executable for ARM.
    half(&mut file, &[2, 40]);
    words(&mut file, &[1, FLASH, HEADER, at_sections, 0x0500_0000]);
    half(&mut file, &[52, 32, 1, 40, 3, 2]);
    let bytes = Label::BYTES as u32;
    // A segment that is loaded.
    words(&mut file, &[1, at_label, FLASH, FLASH, bytes, bytes, 4, 4]);
    file.extend(label.to_bytes());
    // The null symbol, and a global variable in a section whose number does not matter.
    words(&mut file, &[0; 4]);
    words(&mut file, &[1, FLASH, bytes]);
    file.extend([0x11, 0]);
    half(&mut file, &[1]);
    file.extend(names.as_bytes());
    words(&mut file, &[0; SECTION_HEADER as usize / 4]);
    // Symbols, whose names are in the next section.
    words(&mut file, &[0, 2, 0, 0, at_symbols, 32, 2, 1, 4, 16]);
    words(&mut file, &[0, 3, 0, 0, at_names, names.len() as u32, 0, 0, 1, 0]);
    file
}

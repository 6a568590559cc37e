//! Specification of a rig and its textual form.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// A rig to connect to.
///
/// | written | means |
/// |---|---|
/// | `sim` | in-process, paced at wall-clock speed |
/// | `sim-fast` | in-process, ticks only when released ([`crate::Client::run`]) |
/// | `emulated` | QEMU, for a person at the window |
/// | `emulated:counted` | QEMU counting instructions, running freely |
/// | `emulated:lockstep` | QEMU counting instructions, ticks only when released |
/// | `emulated…@PATH` | the same with the firmware image at `PATH` |
/// | anything else | a serial port by its name |
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum RigSpec {
    /// The board's own code in a thread of this program, with its simulated mechanism.
    Simulated {
        /// Whether ticks follow the wall clock; otherwise each waits to be released.
        realtime: bool,
    },
    /// The board's firmware in QEMU.
    Emulated {
        /// Clock mode.
        mode: EmulatedMode,
        /// Firmware ELF; `None`: the one `cargo xtask firmware mps2-an500` builds.
        firmware: Option<PathBuf>,
    },
    /// A board on a serial port.
    Serial {
        /// Name of the port in the operating system (`/dev/ttyACM0`, `COM3`).
        port: String,
    },
}

/// Clock mode of an emulated board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EmulatedMode {
    /// About wall-clock speed on an idle machine: for interactive use in the window.
    Interactive,
    /// One instruction takes 2 ns of virtual time (`-icount shift=1,sleep=off`): instruction counts and missed ticks do not depend on this
    /// machine's load. Virtual time runs ahead of the wall clock whenever the board idles, so a slow host that has armed the board reaches
    /// the host timeout too early: use lockstep for anything that arms.
    Counted,
    /// Counted, and a tick runs only when the host releases it: bit-identical in every run.
    Lockstep,
}

/// Reasons why a text specifies no rig.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SpecError {
    /// The text is empty.
    #[error("no rig was named: write `sim`, `emulated`, or a serial port such as /dev/ttyACM0 or COM3")]
    Empty,
    /// `emulated:` with an unknown mode.
    #[error(
        "`emulated:{0}` is not a mode of the emulated board: write `emulated`, `emulated:counted` or `emulated:lockstep`"
    )]
    Mode(String),
    /// `emulated@` without a path.
    #[error("`{0}` names no firmware file after `@`")]
    Firmware(String),
}

impl FromStr for RigSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let text = text.trim();
        match text {
            "" => return Err(SpecError::Empty),
            "sim" => return Ok(Self::Simulated { realtime: true }),
            "sim-fast" => return Ok(Self::Simulated { realtime: false }),
            _ => {}
        }
        let (head, firmware) = match text.split_once('@') {
            Some((head, path)) => (head, Some(path)),
            None => (text, None),
        };
        let mode = match head.strip_prefix("emulated") {
            Some("") => EmulatedMode::Interactive,
            Some(":counted") => EmulatedMode::Counted,
            Some(":lockstep") => EmulatedMode::Lockstep,
            Some(other) if other.starts_with(':') => return Err(SpecError::Mode(other[1..].to_owned())),
            _ => {
                return Ok(Self::Serial {
                    port: text.to_owned(),
                });
            }
        };
        match firmware {
            Some("") => Err(SpecError::Firmware(text.to_owned())),
            firmware => Ok(Self::Emulated {
                mode,
                firmware: firmware.map(PathBuf::from),
            }),
        }
    }
}

impl fmt::Display for RigSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Simulated { realtime: true } => f.write_str("sim"),
            Self::Simulated { realtime: false } => f.write_str("sim-fast"),
            Self::Emulated { mode, firmware } => {
                f.write_str(match mode {
                    EmulatedMode::Interactive => "emulated",
                    EmulatedMode::Counted => "emulated:counted",
                    EmulatedMode::Lockstep => "emulated:lockstep",
                })?;
                match firmware {
                    Some(path) => write!(f, "@{}", path.display()),
                    None => Ok(()),
                }
            }
            Self::Serial { port } => f.write_str(port),
        }
    }
}

impl RigSpec {
    /// The same rig with ticks released by the host where possible, as measurements require. A real port is unchanged.
    pub fn lockstep(&self) -> Self {
        match self {
            Self::Simulated { .. } => Self::Simulated { realtime: false },
            Self::Emulated { firmware, .. } => Self::Emulated {
                mode: EmulatedMode::Lockstep,
                firmware: firmware.clone(),
            },
            Self::Serial { .. } => self.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back() {
        for text in [
            "sim",
            "sim-fast",
            "emulated",
            "emulated:counted",
            "emulated:lockstep",
            "emulated:lockstep@some/dir/board.elf",
            "/dev/ttyACM0",
            "COM3",
        ] {
            assert_eq!(text.parse::<RigSpec>().expect(text).to_string(), text);
        }
    }

    #[test]
    fn what_names_no_rig_is_refused_in_words() {
        assert_eq!("  ".parse::<RigSpec>(), Err(SpecError::Empty));
        assert_eq!(
            "emulated:fast".parse::<RigSpec>(),
            Err(SpecError::Mode("fast".into()))
        );
        assert!("emulated@".parse::<RigSpec>().is_err());
    }
}

//! Why firmware was not written: what, where, what to do.

use std::path::PathBuf;

use mortise_protocol::message::Version;

use crate::probe::Probe;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub enum FlashError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {why}", .path.display())]
    Unreadable {
        /// File.
        path: PathBuf,
        /// Reason.
        why: std::io::Error,
    },
    /// The file is no firmware of Mortise.
    #[error(
        "{}: is no firmware for a board ({why}); `cargo xtask firmware` builds it and prints its path",
        .path.display()
    )]
    NotFirmware {
        /// File.
        path: PathBuf,
        /// Reason.
        why: &'static str,
    },
    /// The firmware speaks another version of the protocol.
    #[error(
        "{}: is firmware of release {} with another protocol than this program, release {}: they would not understand each other; \
         take the firmware of this program's release",
        .path.display(),
        words(.firmware),
        words(&Version::own())
    )]
    OtherVersion {
        /// File.
        path: PathBuf,
        /// Version of the firmware.
        firmware: Version,
    },
    /// `probe-rs` is not installed.
    #[error(
        "the program `probe-rs`, which writes firmware through a debug probe, is not found: install it as https://probe.rs says, and try again"
    )]
    NoProgram,
    /// The program cannot be run.
    #[error("{}: cannot be started: {why}", .program.display())]
    NotStarted {
        /// Program.
        program: PathBuf,
        /// Reason.
        why: std::io::Error,
    },
    /// No probe is there.
    #[error(
        "no debug probe is found: connect the USB socket of the board's programmer (on a Nucleo the one marked ST-LINK), and try again"
    )]
    NoProbe,
    /// The probe is there and may not be used.
    #[error(
        "the debug probe {probe} may not be used by you: on Linux install the udev rules of probe-rs (https://probe.rs/docs/getting-started/probe-setup), \
         then unplug the probe and plug it in again"
    )]
    Forbidden {
        /// Probe.
        probe: Probe,
    },
    /// Several probes are there.
    #[error(
        "several debug probes are connected: unplug all but that of the board, or name one with --probe: {}",
        names(.0)
    )]
    SeveralProbes(Vec<Probe>),
    /// A probe of that name is not there.
    #[error("there is no debug probe `{wanted}`; there is: {}", names(.found))]
    NoSuchProbe {
        /// Name asked for.
        wanted: String,
        /// Probes found.
        found: Vec<Probe>,
    },
    /// The probes cannot be listed; nothing was written.
    #[error(
        "the debug probes cannot be listed: {said}; unplug the probe, plug it in again, and try again: nothing was written"
    )]
    NotListed {
        /// What the program said.
        said: String,
    },
    /// The firmware is on the board, and the board does not run it.
    #[error(
        "the firmware is written and read back, but the board was not started again: {said}; press its reset button"
    )]
    NotReset {
        /// What the program said.
        said: String,
    },
    /// Writing failed.
    #[error(
        "the firmware was not written: {}; check the board's power and its cable, and try again: until then the board may not start, and its motors stay off",
        .said
    )]
    Failed {
        /// What the program said.
        said: String,
    },
    /// Nothing happened for too long.
    #[error(
        "writing the firmware was broken off, because `probe-rs` said nothing for {after_s:.0} s: unplug the board, plug it in again, and try again; \
         until then it may not start, and its motors stay off"
    )]
    Stalled {
        /// Time waited, s.
        after_s: f64,
    },
    /// The operator ended it.
    #[error(
        "writing the firmware was ended: the board may not start until firmware is written; its motors stay off"
    )]
    Cancelled,
}

/// A release in words.
pub fn words(version: &Version) -> String {
    let [major, minor, patch] = version.release;
    format!("{major}.{minor}.{patch}")
}

fn names(probes: &[Probe]) -> String {
    let names: Vec<String> = probes.iter().map(Probe::to_string).collect();
    match names.is_empty() {
        true => "none".to_owned(),
        false => names.join("; "),
    }
}

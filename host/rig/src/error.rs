//! Errors of a rig, in words: what, where, and what to do.

use std::path::PathBuf;

use mortise_protocol::message::{Refusal, Version};

use crate::words::Words;

/// Reason why a rig could not do what was requested.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The port could not be opened, for a reason other than those below.
    #[error("cannot open {port}: {source}; {hint}")]
    Open {
        /// Port.
        port: String,
        /// The operating system's error.
        source: std::io::Error,
        /// Remedy.
        hint: String,
    },
    /// There is no such port.
    #[error("there is no port `{port}`: {known}; a rig is `sim`, `emulated` or the name of a port")]
    NoSuchPort {
        /// Port.
        port: String,
        /// The available ports, or what to plug in.
        known: String,
    },
    /// Another program has the port.
    #[error(
        "{port} is in use by another program: close that program (another Mortise, a serial monitor, ModemManager) and try again"
    )]
    Busy {
        /// Port.
        port: String,
    },
    /// The user may not open the port.
    #[error("no permission to open {port}: {fix}")]
    Permission {
        /// Port.
        port: String,
        /// How to get the permission.
        fix: String,
    },
    /// No answer in this protocol.
    #[error("{rig} did not answer within {waited_s:.1} s: {hint}")]
    NoAnswer {
        /// Rig.
        rig: String,
        /// Waiting time, s.
        waited_s: f64,
        /// Remedy.
        hint: String,
    },
    /// Program and firmware are of different versions.
    #[error(
        "program and firmware do not match: this program is {}, the board's firmware is {}; flash the firmware of this release, or start the program of that one",
        version_words(.host),
        version_words(.device)
    )]
    VersionMismatch {
        /// Version of this program.
        host: Version,
        /// Version of the board's firmware.
        device: Version,
    },
    /// The board refused a request.
    #[error("{what} was refused: {}", .reason.words())]
    Refused {
        /// The request.
        what: String,
        /// The reason.
        reason: Refusal,
    },
    /// The board did not answer in time.
    #[error(
        "no answer to {what} within {after_ms} ms: the link or the board is stalled; try again, or reconnect"
    )]
    Timeout {
        /// The request.
        what: String,
        /// Waiting time, ms.
        after_ms: u64,
    },
    /// The link is gone.
    #[error(
        "the link to the board is lost: {why}; the board switches its motors off by itself; connect again"
    )]
    LinkLost {
        /// What was observed.
        why: String,
    },
    /// QEMU is missing or did not start.
    #[error("the emulated board cannot run: {what}; {hint}")]
    Qemu {
        /// What happened.
        what: String,
        /// Remedy.
        hint: String,
    },
    /// The firmware for the emulated board is missing.
    #[error("there is no firmware at {}: build it with `cargo xtask firmware mps2-an500`, or name another with MORTISE_FIRMWARE", .path.display())]
    NoFirmware {
        /// Path that was searched.
        path: PathBuf,
    },
    /// The message does not fit into a frame.
    #[error("{what} is larger than a frame can carry")]
    TooLarge {
        /// The message.
        what: String,
    },
    /// The bytes to be sent are no scene image.
    #[error("{what}: bake a STEP file to a scene image first")]
    NotAScene {
        /// What is wrong with them.
        what: String,
    },
    /// A thread could not be started.
    #[error("this computer could not start a thread for the link: {0}; close other programs")]
    Thread(std::io::Error),
}

impl RigError {
    /// The board's reason for a refusal.
    pub fn refusal(&self) -> Option<Refusal> {
        match self {
            Self::Refused { reason, .. } => Some(*reason),
            _ => None,
        }
    }

    /// Whether the link is lost, so that nothing more can be done over it.
    pub fn is_link_lost(&self) -> bool {
        matches!(self, Self::LinkLost { .. })
    }
}

/// `0.1.0 (protocol 0123456789abcdef)`.
pub fn version_words(version: &Version) -> String {
    let [major, minor, patch] = version.release;
    format!("{major}.{minor}.{patch} (protocol {:016x})", version.schema)
}

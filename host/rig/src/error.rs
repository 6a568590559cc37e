//! Everything that can go wrong with a rig, in words: what, where, what to do.

use std::path::PathBuf;

use mortise_protocol::message::{Refusal, Version};

use crate::words::Words;

/// Why a rig could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The port could not be opened for a reason other than those below.
    #[error("cannot open {port}: {source}; {hint}")]
    Open {
        /// Port.
        port: String,
        /// What the operating system said.
        source: std::io::Error,
        /// What to do.
        hint: String,
    },
    /// There is no such port.
    #[error("there is no port {port}; {known}")]
    NoSuchPort {
        /// Port.
        port: String,
        /// The ports there are, or what to plug in.
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
        /// How to get it.
        fix: String,
    },
    /// Nothing that speaks this protocol answered.
    #[error("{rig} did not answer within {waited_s:.1} s: {hint}")]
    NoAnswer {
        /// Rig.
        rig: String,
        /// s.
        waited_s: f64,
        /// What to do.
        hint: String,
    },
    /// Program and firmware are of different versions.
    #[error(
        "program and firmware do not match: this program is {}, the board's firmware is {}; flash the firmware of this release, or start the program of that one",
        version_words(.host),
        version_words(.device)
    )]
    VersionMismatch {
        /// This side.
        host: Version,
        /// The board.
        device: Version,
    },
    /// The board said no.
    #[error("{what} was refused: {}", .reason.words())]
    Refused {
        /// What was asked.
        what: String,
        /// Why not.
        reason: Refusal,
    },
    /// The board did not answer in time.
    #[error(
        "no answer to {what} within {after_ms} ms: the link or the board is stalled; try again, or connect anew"
    )]
    Timeout {
        /// What was asked.
        what: String,
        /// ms.
        after_ms: u64,
    },
    /// The link is gone.
    #[error(
        "the link to the board is lost: {why}; the board switches its motors off by itself; connect again"
    )]
    LinkLost {
        /// What was seen.
        why: String,
    },
    /// QEMU is missing or did not start.
    #[error("the emulated board cannot run: {what}; {hint}")]
    Qemu {
        /// What happened.
        what: String,
        /// What to do.
        hint: String,
    },
    /// The firmware for the emulated board is missing.
    #[error("there is no firmware at {}: build it with `cargo xtask firmware mps2-an500`, or name another with MORTISE_FIRMWARE", .path.display())]
    NoFirmware {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// The message does not fit into a frame.
    #[error("{what} is larger than a frame can carry")]
    TooLarge {
        /// What was asked.
        what: String,
    },
    /// The bytes handed over for sending are no scene image at all.
    #[error("{what}: bake a STEP file into a scene image first")]
    NotAScene {
        /// What is wrong with them.
        what: String,
    },
    /// A thread could not be started.
    #[error("this computer could not start a thread for the link: {0}; close other programs")]
    Thread(std::io::Error),
}

impl RigError {
    /// The board's reason when it refused.
    pub fn refusal(&self) -> Option<Refusal> {
        match self {
            Self::Refused { reason, .. } => Some(*reason),
            _ => None,
        }
    }

    /// Nothing more can be done over this link.
    pub fn is_link_lost(&self) -> bool {
        matches!(self, Self::LinkLost { .. })
    }
}

/// `0.1.0 (protocol 0123456789abcdef)`.
pub fn version_words(version: &Version) -> String {
    let [major, minor, patch] = version.release;
    format!("{major}.{minor}.{patch} (protocol {:016x})", version.schema)
}

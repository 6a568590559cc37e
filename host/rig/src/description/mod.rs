//! A rig's description as a file: read, checked and written, with the capabilities that follow from it.
//!
//! The file is TOML with millimetres and degrees (`docs/rigs.md`); the wire form has SI units. Errors name the key, its value, its range,
//! and the remedy. A file that passes here passes on the board too, because both run the same code.

mod abilities;
mod digits;
mod file;

use std::path::{Path, PathBuf};

use mortise_mechanism::kinematics::Model;
use mortise_protocol::rig::{Rig, RigFault, RigKey};

use crate::words::Words;
pub use abilities::{Abilities, abilities};
use digits::significant;

/// Examples of descriptions: name, and text of the file.
pub const EXAMPLES: [(&str, &str); 4] = [
    ("hapkit", include_str!("../../../../firmware/rigs/hapkit.toml")),
    (
        "haply_2diy",
        include_str!("../../../../firmware/rigs/haply_2diy.toml"),
    ),
    (
        "woodenhaptics",
        include_str!("../../../../firmware/rigs/woodenhaptics.toml"),
    ),
    ("polhem", include_str!("../../../../firmware/rigs/polhem.toml")),
];

/// Reasons why a file is no valid description of a rig.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// The file could not be read.
    #[error("{}: {source}; check the path", .path.display())]
    Unreadable {
        /// File.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The text is no description.
    #[error("{name}: {what}")]
    Written {
        /// File.
        name: String,
        /// Line and key, and what was expected there.
        what: String,
    },
    /// A number is out of its range, or the described mechanism cannot work.
    #[error("{name}: {}", .fault.words())]
    Fault {
        /// File.
        name: String,
        /// The fault.
        fault: RigFault,
    },
}

/// Reads a file.
///
/// # Errors
/// See [`DescriptionError`].
pub fn load_rig(path: &Path) -> Result<Rig, DescriptionError> {
    let text = std::fs::read_to_string(path).map_err(|source| DescriptionError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    parse_rig(&text, &path.display().to_string())
}

/// Parses a description's text; `name` is used in messages.
///
/// # Errors
/// `Written`, `Fault`.
pub fn parse_rig(text: &str, name: &str) -> Result<Rig, DescriptionError> {
    let rig = file::read(text).map_err(|what| DescriptionError::Written {
        name: name.to_owned(),
        what,
    })?;
    Model::new(&rig).map_err(|fault| DescriptionError::Fault {
        name: name.to_owned(),
        fault,
    })?;
    Ok(rig)
}

/// The text of a description file, numbers with six digits.
pub fn write_rig(rig: &Rig) -> String {
    file::write(rig)
}

impl Words for RigFault {
    fn words(&self) -> String {
        let joint = |number: u8| format!("joint {} (the {} [[joint]])", number + 1, ordinal(number));
        match *self {
            Self::OutOfRange { key, joint, value } => {
                let row = key.row();
                let place = place(key, joint);
                let value = significant(value);
                let (min, max, unit) = (row.min, row.max, row.unit);
                format!("{place} is {value}, but must be a number from {min} to {max} {unit}: {}", meaning(row.description))
            }
            Self::Joints { needed } => format!(
                "this kind of kinematics has {needed} joints with motors: write as many [[joint]] tables, in the order of docs/rigs.md"
            ),
            Self::Range { joint: number } => {
                format!("{}: the end of range_deg is below its start: write the smaller angle first", joint(number))
            }
            Self::Home { joint: number } => {
                format!("{}: home_deg lies outside range_deg: correct one of them", joint(number))
            }
            Self::Counts { joint: number } => format!(
                "{}: at rate_limit_deg_per_s its encoder moves more counts in a millisecond than a 16-bit counter can resolve: lower the limit or the counts",
                joint(number)
            ),
            Self::WristAxes => {
                "wrist.axes: each must be a unit vector, and neighbours at least 26 degrees apart: correct the directions".into()
            }
            Self::Linkage => {
                "in the home pose the links do not reach each other: check the lengths in [kinematics] and each home_deg".into()
            }
            Self::Singular => {
                "the home pose is nearly singular: in some direction the motors can hardly push the handle; choose each home_deg nearer to the middle of the workspace".into()
            }
            Self::Workspace => {
                "in the home pose the handle is outside ceilings.workspace_mm: check mount.origin_mm, or allow more".into()
            }
        }
    }
}

/// The key with the table it belongs to.
fn place(key: RigKey, number: u8) -> String {
    let name = key.row().key;
    match name.split_once('.') {
        Some(("joint", rest)) => format!(
            "{rest} of joint {} (the {} [[joint]])",
            number + 1,
            ordinal(number)
        ),
        _ => match key {
            RigKey::PantographProximal
            | RigKey::PantographDistal
            | RigKey::Origin
            | RigKey::Turn
            | RigKey::WristCounts
            | RigKey::WristHome
            | RigKey::WristAxis => format!("{name}[{number}]"),
            _ => name.to_owned(),
        },
    }
}

fn ordinal(number: u8) -> &'static str {
    ["first", "second", "third"]
        .get(usize::from(number))
        .copied()
        .unwrap_or("last")
}

/// The first clause of a table's description, for use within a sentence.
fn meaning(description: &str) -> String {
    let text = description.trim().trim_end_matches('.');
    let mut letters = text.chars();
    let first = letters
        .next()
        .map(|letter| letter.to_lowercase().to_string())
        .unwrap_or_default();
    first + letters.as_str()
}

#[cfg(test)]
mod tests;

//! Errors of experiments.

use std::path::PathBuf;

use mortise_brep::BrepError;
use mortise_rig::RigError;
use mortise_scenario::ScenarioError;

/// Why an experiment could not be run. A bound that does not hold is not an error but a verdict.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// A file of the experiment could not be read.
    #[error("{}: {source}; check the path", .path.display())]
    Unreadable {
        /// File.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A file could not be written.
    #[error("{}: {source}; check the path and its permissions", .path.display())]
    Unwritable {
        /// File or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A table or chart cannot be written.
    #[error(transparent)]
    Output(#[from] mortise_output::OutputError),
    /// An input of an experiment cannot be used.
    #[error("{name}: {what}")]
    Input {
        /// File, with the line where there is one.
        name: String,
        /// What is wrong, and what to do.
        what: String,
    },
    /// A scenario could not be played, or a scene not read, baked or probed.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// There are no figures of this name.
    #[error("there are no figures named `{name}`; there are: {known}")]
    NoSuchFigures {
        /// The requested name.
        name: String,
        /// The known names.
        known: String,
    },
    /// A program of the experiment could not be run.
    #[error("{program} could not be run: {source}")]
    Program {
        /// Program.
        program: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
}

impl From<BrepError> for LabError {
    fn from(error: BrepError) -> Self {
        Self::Scenario(error.into())
    }
}

impl From<RigError> for LabError {
    fn from(error: RigError) -> Self {
        Self::Scenario(error.into())
    }
}

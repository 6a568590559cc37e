//! Errors of playing a scenario or probing a scene.

use std::path::PathBuf;

/// Why a scenario could not be played, or a scene not probed. A bound that does not hold is not an error but a verdict.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// A file could not be read.
    #[error("{}: {source}; check the path", .path.display())]
    Unreadable {
        /// File.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A scenario file is malformed.
    #[error("{name}: {what}")]
    Scenario {
        /// File or name of the scenario.
        name: String,
        /// What is wrong, where.
        what: String,
    },
    /// A scene or a file of poses cannot be used.
    #[error("{name}: {what}")]
    Input {
        /// File, with the line where there is one.
        name: String,
        /// What is wrong, and what to do.
        what: String,
    },
    /// The STEP file could not be read.
    #[error(transparent)]
    Brep(#[from] mortise_brep::BrepError),
    /// The model could not be baked.
    #[error("{step}: {source}")]
    Bake {
        /// STEP file.
        step: String,
        /// Reason.
        source: mortise_bake::BakeError,
    },
    /// The scene has no part of this name.
    #[error("{step} has no part `{part}`; it has {known}")]
    NoSuchPart {
        /// STEP file.
        step: String,
        /// The requested name.
        part: String,
        /// Names of the scene's parts.
        known: String,
    },
    /// The rig could not be used.
    #[error(transparent)]
    Rig(#[from] mortise_rig::RigError),
    /// The scenario moves the handle, which this rig cannot do by itself.
    #[error(
        "{rig} has a real mechanism: the scenario `{scenario}` needs a simulated hand; run it on `sim` or `emulated`"
    )]
    NeedsSimulatedHand {
        /// Rig.
        rig: String,
        /// Scenario.
        scenario: String,
    },
    /// The board reported a fault while the scenario ran.
    #[error("the board reported a fault at tick {tick}: {what}")]
    Fault {
        /// Tick.
        tick: u32,
        /// Description of the fault.
        what: String,
    },
}

//! Why a scenario could not be played, or a scene not probed.

use std::path::PathBuf;

/// Why a scenario could not be played, or a scene not probed. A bound that does not hold is no error but a verdict.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// A file could not be read.
    #[error("{}: {source}; check the path", .path.display())]
    Unreadable {
        /// File.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A scenario is not written as it should be.
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
        /// Why.
        source: mortise_bake::BakeError,
    },
    /// The scene has no part of this name.
    #[error("{step} has no part `{part}`; it has {known}")]
    NoSuchPart {
        /// STEP file.
        step: String,
        /// Asked for.
        part: String,
        /// Names there are.
        known: String,
    },
    /// The rig could not be used.
    #[error(transparent)]
    Rig(#[from] mortise_rig::RigError),
    /// The scenario moves the handle, and nobody does on this rig.
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
        /// Words for it.
        what: String,
    },
}

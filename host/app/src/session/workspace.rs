//! The workspaces: what the middle of the window is for.

/// What the window shows in its middle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Workspace {
    /// The parts.
    #[default]
    Assemble,
    /// The description of the rig and its commissioning.
    Rig,
    /// Recorded runs beside each other.
    Analyse,
}

impl Workspace {
    /// All of them, in the order of the buttons.
    pub const ALL: [Self; 3] = [Self::Assemble, Self::Rig, Self::Analyse];

    /// Name on its button.
    pub fn name(self) -> &'static str {
        match self {
            Self::Assemble => "Assemble",
            Self::Rig => "Set up rig",
            Self::Analyse => "Analyse",
        }
    }

    /// What it is for.
    pub fn hint(self) -> &'static str {
        match self {
            Self::Assemble => "Show the parts",
            Self::Rig => "Describe the rig, and try its encoders, stop button and motors one by one",
            Self::Analyse => "Show recorded runs beside each other, and compute them again",
        }
    }
}

//! The steps of commissioning and their results.

/// One thing that is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The encoder of a joint (from 0) counts, in the sense of the description. The operator turns the joint forward.
    Encoder(u8),
    /// The corrected description is sent to the board, which restarts.
    Send,
    /// The handle is in its reference pose.
    Reference,
    /// The stop input opens when its button is pressed, and closes again.
    StopInput,
    /// The motor of a joint (from 0) pushes, in the sense of the description.
    Motor(u8),
    /// The joints reach the ends of their ranges. The operator moves the handle along its limits.
    Workspace,
}

/// Result of a step.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Not tried yet.
    Open,
    /// As described.
    Passed(String),
    /// Otherwise than described; the description is corrected.
    Corrected(String),
    /// Not as it must be: what was seen, and what to do.
    Failed(String),
}

impl Outcome {
    /// Its words.
    pub fn words(&self) -> &str {
        match self {
            Self::Open => "",
            Self::Passed(words) | Self::Corrected(words) | Self::Failed(words) => words,
        }
    }

    /// What it is, in a word.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Passed(_) => "passed",
            Self::Corrected(_) => "corrected",
            Self::Failed(_) => "failed",
        }
    }

    /// Whether the next step may follow.
    pub fn is_done(&self) -> bool {
        matches!(self, Self::Passed(_) | Self::Corrected(_))
    }
}

impl Step {
    /// Its name in a list.
    pub fn name(self) -> String {
        match self {
            Self::Encoder(joint) => format!("Encoder {}", joint + 1),
            Self::Send => "Send corrections".into(),
            Self::Reference => "Reference".into(),
            Self::StopInput => "Stop button".into(),
            Self::Motor(joint) => format!("Motor {}", joint + 1),
            Self::Workspace => "Workspace".into(),
        }
    }
}

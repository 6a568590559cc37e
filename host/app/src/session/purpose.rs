//! What the window asks a path for.

/// What a path is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A STEP file to open.
    OpenModel,
    /// The file for a table of traces.
    SaveTraces,
}

impl Purpose {
    /// Title of the question.
    pub fn title(self) -> &'static str {
        match self {
            Self::OpenModel => "Open STEP file",
            Self::SaveTraces => "Export traces as CSV",
        }
    }

    /// Whether the file is written.
    pub fn is_saved(self) -> bool {
        matches!(self, Self::SaveTraces)
    }

    /// An example of a path.
    pub fn example(self) -> &'static str {
        match self {
            Self::OpenModel => "/folder/assembly.step",
            Self::SaveTraces => "/folder/traces.csv",
        }
    }

    /// Suggested name of a new file.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::OpenModel => "",
            Self::SaveTraces => "traces.csv",
        }
    }

    /// Name and endings of the files.
    pub fn filter(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::OpenModel => ("STEP", &["step", "stp", "STEP", "STP", "p21"]),
            Self::SaveTraces => ("CSV", &["csv"]),
        }
    }
}

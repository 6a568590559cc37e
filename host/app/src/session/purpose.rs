//! What the window asks a path for.

/// What a path is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A STEP file or a project to open.
    OpenModel,
    /// The file for a table of traces.
    SaveTraces,
    /// The file for a project.
    SaveProject,
    /// The file for a report of the steps of an assembly.
    SaveSteps,
    /// A recorded run to show.
    OpenRun,
    /// A recorded run to compare with.
    CompareRun,
    /// The file for a report of recorded runs.
    SaveRunReport,
    /// The file for a table of the figures of recorded runs.
    SaveRunTable,
    /// Firmware for a board to open.
    OpenFirmware,
    /// The description of a rig to open.
    OpenRig,
    /// The file for the description of a rig.
    SaveRig,
    /// The file for a report of commissioning.
    SaveRigReport,
}

impl Purpose {
    /// Title of the question.
    pub fn title(self) -> &'static str {
        match self {
            Self::OpenModel => "Open STEP file or project",
            Self::SaveProject => "Save project as",
            Self::SaveTraces => "Export traces as CSV or SVG",
            Self::SaveSteps => "Save report of the steps as",
            Self::OpenRun => "Open recorded run",
            Self::CompareRun => "Compare with recorded run",
            Self::SaveRunReport => "Save report of the runs as",
            Self::SaveRunTable => "Save figures of the runs as CSV",
            Self::OpenFirmware => "Choose firmware for the board",
            Self::OpenRig => "Open description of a rig",
            Self::SaveRig => "Save description of the rig as",
            Self::SaveRigReport => "Save report of commissioning as",
        }
    }

    /// Whether the file is written.
    pub fn is_saved(self) -> bool {
        !matches!(
            self,
            Self::OpenModel | Self::OpenFirmware | Self::OpenRig | Self::OpenRun | Self::CompareRun
        )
    }

    /// An example of a path.
    pub fn example(self) -> &'static str {
        match self {
            Self::OpenModel => "/folder/assembly.step",
            Self::SaveTraces => "/folder/traces.csv",
            Self::SaveProject => "/folder/assembly.mortise",
            Self::SaveRunReport => "/folder/run-1.html",
            Self::SaveRunTable => "/folder/runs.csv",
            Self::SaveSteps => "/folder/assembly.html",
            Self::OpenFirmware => "/folder/nucleo-h743zi",
            Self::OpenRig | Self::SaveRig => "/folder/rig.toml",
            Self::SaveRigReport => "/folder/commissioning.md",
            Self::OpenRun | Self::CompareRun => "/folder/run-1.mcap",
        }
    }

    /// Suggested name of a new file.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::OpenModel | Self::OpenFirmware | Self::OpenRig | Self::OpenRun | Self::CompareRun => "",
            Self::SaveRunReport => "run.html",
            Self::SaveRunTable => "runs.csv",
            Self::SaveSteps => "assembly.html",
            Self::SaveRig => "rig.toml",
            Self::SaveRigReport => "commissioning.md",
            Self::SaveTraces => "traces.csv",
            Self::SaveProject => "assembly.mortise",
        }
    }

    /// Name and endings of the files.
    pub fn filter(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::OpenModel => (
                "STEP files and projects",
                &["step", "stp", "STEP", "STP", "p21", "mortise"],
            ),
            Self::SaveTraces => ("CSV or SVG", &["csv", "svg"]),
            Self::SaveRunTable => ("CSV", &["csv"]),
            Self::SaveProject => ("Mortise projects", &["mortise"]),
            Self::SaveRunReport | Self::SaveSteps => ("Pages", &["html"]),
            // What the linker makes has no ending.
            Self::OpenFirmware => ("Firmware", &["*"]),
            Self::OpenRig | Self::SaveRig => ("Descriptions of rigs", &["toml"]),
            Self::SaveRigReport => ("Markdown", &["md"]),
            Self::OpenRun | Self::CompareRun => ("Recordings", &["mcap"]),
        }
    }
}

//! Arguments of the window, and how it opens. A build without the feature `window` accepts the same arguments and refuses in one line.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use mortise_rig::RigSpec;

use super::reading::Reading;
use super::units;

/// Contents of the window at the start.
#[derive(Debug, Args)]
pub struct Open {
    /// STEP file to open
    file: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    picture: Picture,
}

impl Open {
    /// The STEP file, if one is named.
    pub fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }
}

/// Options for automation.
#[derive(Debug, Default, Args)]
pub struct Picture {
    /// Write a PNG of the window, then exit
    #[arg(long, hide = true, value_name = "PNG")]
    screenshot: Option<PathBuf>,
    /// Replace an existing PNG
    #[arg(long, hide = true, requires = "screenshot")]
    force: bool,
    /// Seconds from the start to the screenshot
    #[arg(long, hide = true, default_value = "3", value_name = "SECONDS", value_parser = units::delay, allow_negative_numbers = true)]
    after: Duration,
    /// Draw fixed parts as glass
    #[arg(long, hide = true)]
    see_through: bool,
    /// Connect to a rig at once
    #[arg(long, hide = true, value_name = "RIG", value_parser = units::rig)]
    connect: Option<RigSpec>,
}

/// Opens the window.
pub fn open(open: Open) -> anyhow::Result<ExitCode> {
    open.reading.apply();
    shown::open(open.file, open.picture)
}

/// Opens the window with an insertion: of the sample, or of `file`.
pub fn demo(file: Option<PathBuf>, rig: Option<RigSpec>, picture: Picture) -> anyhow::Result<ExitCode> {
    shown::demo(file, rig, picture)
}

#[cfg(feature = "window")]
mod shown {
    use std::path::{Path, PathBuf};
    use std::process::ExitCode;

    use mortise_output::{Existing, Output};
    use mortise_rig::RigSpec;

    use super::Picture;
    use crate::session::Intent;
    use crate::ui::app::{self, Options, Screenshot};

    pub fn open(file: Option<PathBuf>, picture: Picture) -> anyhow::Result<ExitCode> {
        let options = options(picture, file.as_deref(), Vec::new())?;
        app::run(options)?;
        Ok(ExitCode::SUCCESS)
    }

    pub fn demo(file: Option<PathBuf>, rig: Option<RigSpec>, picture: Picture) -> anyhow::Result<ExitCode> {
        let mut options = options(picture, file.as_deref(), vec![Intent::Demo(rig)])?;
        // Transparent walls show the insertion inside the hole.
        options.see_through = true;
        app::run(options)?;
        Ok(ExitCode::SUCCESS)
    }

    /// Options that open `file`, then handle `next`.
    fn options(picture: Picture, file: Option<&Path>, next: Vec<Intent>) -> anyhow::Result<Options> {
        let inputs: Vec<&Path> = file.into_iter().collect();
        let mut first: Vec<Intent> = (inputs.iter())
            .map(|file| Intent::Open(file.to_path_buf()))
            .collect();
        first.extend(next);
        if let Some(rig) = picture.connect {
            first.extend([Intent::ChooseRig(rig), Intent::Connect]);
        }
        let existing = Existing::from_force(picture.force);
        let check = |png| Output::new(png, existing, &inputs);
        let png = picture.screenshot.map(check).transpose()?;
        Ok(Options {
            first,
            screenshot: png.map(|file| Screenshot {
                file,
                after: picture.after,
            }),
            see_through: picture.see_through,
        })
    }
}

#[cfg(not(feature = "window"))]
mod shown {
    use std::path::PathBuf;
    use std::process::ExitCode;

    use mortise_rig::RigSpec;

    use super::Picture;

    const NONE: &str = "this build of mortise has no window; build it with `cargo build --release`";

    pub fn open(_: Option<PathBuf>, _: Picture) -> anyhow::Result<ExitCode> {
        anyhow::bail!("{NONE}; `mortise --help` lists what there is without one")
    }

    pub fn demo(_: Option<PathBuf>, _: Option<RigSpec>, _: Picture) -> anyhow::Result<ExitCode> {
        anyhow::bail!("{NONE}; without one: `mortise demo --headless`")
    }
}

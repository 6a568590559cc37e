//! `mortise demo`: the sample insertion, in the window.

use std::path::PathBuf;
use std::process::ExitCode;

use mortise_rig::RigSpec;

use super::Picture;
use crate::session::Intent;
use crate::ui::app;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file with a peg before a hole [default: the sample that comes with the program]
    file: Option<PathBuf>,
    /// sim, emulated, or a serial port [default: emulated if it is there, else sim]
    #[arg(long, value_parser = super::rig)]
    rig: Option<RigSpec>,
    #[command(flatten)]
    picture: Picture,
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let mut first = Vec::new();
    first.extend(args.file.map(Intent::Open));
    first.push(Intent::Demo(args.rig));
    app::run(args.picture.options(first))?;
    Ok(ExitCode::SUCCESS)
}

//! Commands that do the window's work without a window. Each has `--json`.
//!
//! Exit code 0: done; 1: the insertion was not completed; 2: not possible, with one line on standard error that
//! gives the reason.

mod bake;
mod contacts;
mod demo;
mod inspect;
mod lab;
mod mistyped;
mod ports;
mod probe;
mod reading;
mod rig;
mod units;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Args, CommandFactory as _, Parser, Subcommand};
use mortise_output::{Existing, Output, program};
use mortise_rig::RigSpec;

use crate::session::Intent;
use crate::ui::app::{self, Options, Screenshot};
use reading::Reading;

/// Name of the program.
const NAME: &str = "mortise";

/// Feel whether CAD parts go together, before anything is made.
///
/// Without a command the window opens.
#[derive(Debug, Parser)]
#[command(name = NAME, version, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    open: Open,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// List the contents of a STEP file: parts, faces, volumes, and import losses
    Inspect(inspect::Args),
    /// Find which faces of which parts touch, and the kinds of contact
    Contacts(contacts::Args),
    /// Convert a STEP file to a scene image (collision model) for the board
    Bake(bake::Args),
    /// Insert a peg into its hole with a simulated hand, in the window or without one
    Demo(demo::Args),
    /// Experiments and figures: the program `mortise-lab`
    #[command(hide = true)]
    Lab(lab::Args),
    /// Measure gap, depth and contact forces at given poses of one part
    Probe(probe::Args),
    /// List the rigs: simulated ones and serial ports
    Ports(ports::Args),
    /// Check, send or show the description of a rig
    Rig(rig::Args),
    /// Open the window
    Open(Open),
}

/// Contents of the window at the start.
#[derive(Debug, Args)]
struct Open {
    /// STEP file to open
    file: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    picture: Picture,
}

/// Options for automation.
#[derive(Debug, Default, Args)]
struct Picture {
    /// Write a PNG of the window, then exit
    #[arg(long, hide = true, value_name = "PNG")]
    screenshot: Option<PathBuf>,
    /// Replace an existing PNG
    #[arg(long, hide = true, requires = "screenshot")]
    force: bool,
    /// Seconds from the start to the screenshot
    #[arg(long, hide = true, default_value_t = 3.0, value_name = "SECONDS")]
    after: f64,
    /// Draw fixed parts as glass
    #[arg(long, hide = true)]
    see_through: bool,
    /// Connect to a rig at once
    #[arg(long, hide = true, value_name = "RIG", value_parser = rig)]
    connect: Option<RigSpec>,
}

impl Picture {
    fn options(self, mut first: Vec<Intent>) -> anyhow::Result<Options> {
        if let Some(rig) = self.connect {
            first.extend([Intent::ChooseRig(rig), Intent::Connect]);
        }
        let existing = Existing::from_force(self.force);
        let check = |file| Output::new(file, existing, &[""; 0]);
        let file = self.screenshot.map(check).transpose()?;
        let after = Duration::try_from_secs_f64(self.after).unwrap_or_default();
        Ok(Options {
            first,
            screenshot: file.map(|file| Screenshot { file, after }),
            see_through: self.see_through,
        })
    }
}

/// Runs the program.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return program::usage(NAME, &error, Cli::command()),
    };
    let result = match cli {
        Cli { command: None, open } => {
            let checked = open.file.as_deref().map_or(Ok(()), mistyped::check_lone);
            checked.and_then(|()| window(open))
        }
        Cli {
            command: Some(command),
            ..
        } => match command {
            Command::Open(open) => {
                let checked = open.file.as_deref().map_or(Ok(()), mistyped::check_file);
                checked.and_then(|()| window(open))
            }
            Command::Inspect(args) => inspect::run(&args),
            Command::Contacts(args) => contacts::run(&args),
            Command::Bake(args) => bake::run(&args),
            Command::Demo(args) => demo::run(args),
            Command::Lab(args) => lab::run(&args),
            Command::Probe(args) => probe::run(&args),
            Command::Ports(args) => ports::run(&args),
            Command::Rig(args) => rig::run(&args),
        },
    };
    program::end(NAME, result)
}

fn window(open: Open) -> anyhow::Result<ExitCode> {
    open.reading.apply();
    let first = open.file.map(Intent::Open).into_iter().collect();
    app::run(open.picture.options(first)?)?;
    Ok(ExitCode::SUCCESS)
}

/// Parses a rig from the command line.
fn rig(text: &str) -> Result<RigSpec, String> {
    text.parse()
        .map_err(|error: mortise_rig::SpecError| error.to_string())
}

//! Commands that do the window's work without a window. Each has `--json`.
//!
//! Exit code 0: done; 1: the insertion was not completed, an instruction not carried out, parts do not go together, nothing fits, or a
//! replay differs; 2: not possible, with
//! one line on standard error that gives the reason.

mod assembly;
mod bake;
mod clearance;
mod contacts;
mod demo;
mod energies;
mod fit;
mod inspect;
mod lab;
mod manual;
mod mistyped;
mod played;
mod ports;
mod probe;
mod reading;
mod replay;
mod rig;
mod section;
mod task;
mod text_file;
mod units;
mod window;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};
use mortise_output::program;

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
    open: window::Open,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// List the contents of a STEP file: parts, faces, volumes, and import losses
    Inspect(inspect::Args),
    /// Find which faces of which parts touch, and the kinds of contact
    Contacts(contacts::Args),
    /// Measure the areas in which a plane cuts the parts
    Section(section::Args),
    /// Measure gaps and overlaps between the parts as placed in the file
    Clearance(clearance::Args),
    /// Find the directions and axes along which each part of an assembly can move, and how far
    Mobility(assembly::MobilityArgs),
    /// Find ports of the parts of an assembly (shafts, bores, planes, balls) and what connects them
    Features(assembly::FeaturesArgs),
    /// Find an order and collision-free ways in which an assembly goes together; exit code 1 when it does not
    Assemble(assembly::AssembleArgs),
    /// Find collision-free ways out: of one part, or of all in order; exit code 1 when something stays in
    Disassemble(assembly::DisassembleArgs),
    /// Find the poses at which two parts fit, and the way in
    Fit(fit::Args),
    /// Convert a STEP file to a scene image (collision model) for the board
    Bake(bake::Args),
    /// Insert a peg into its hole with a simulated hand, in the window or without one
    Demo(demo::Args),
    /// Experiments and figures: the program `mortise-lab`
    #[command(hide = true)]
    Lab(lab::Args),
    /// Measure gap, depth and contact forces at given poses of one part
    Probe(probe::Args),
    /// Read a recording, and compute it again: exit code 1 when a tick's result differs
    Replay(replay::Args),
    /// List the rigs: simulated ones and serial ports
    Ports(ports::Args),
    /// Check, send or show the description of a rig
    Rig(rig::Args),
    /// Take an assembly apart and together by instructions in plain words
    Task(task::Args),
    /// Write manual pages, and completions for bash, fish and zsh, to a folder
    Manual(manual::Args),
    /// Open the window
    Open(window::Open),
}

/// Runs the program.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            return match mistyped::check_first(&error, &Cli::command()) {
                Ok(()) => program::usage(NAME, &error, Cli::command()),
                Err(said) => program::end(NAME, Err(said)),
            };
        }
    };
    let result = match cli {
        Cli { command: None, open } => {
            let checked = open
                .file()
                .map_or(Ok(()), |file| mistyped::check_lone(file, &Cli::command()));
            checked.and_then(|()| window::open(open))
        }
        Cli {
            command: Some(command),
            ..
        } => match command {
            Command::Open(open) => {
                let checked = open.file().map_or(Ok(()), mistyped::check_file);
                checked.and_then(|()| window::open(open))
            }
            Command::Inspect(args) => inspect::run(&args),
            Command::Contacts(args) => contacts::run(&args),
            Command::Section(args) => section::run(&args),
            Command::Clearance(args) => clearance::run(&args),
            Command::Mobility(args) => assembly::mobility(&args),
            Command::Features(args) => assembly::features(&args),
            Command::Assemble(args) => assembly::assemble(&args),
            Command::Disassemble(args) => assembly::disassemble(&args),
            Command::Fit(args) => fit::run(&args),
            Command::Bake(args) => bake::run(&args),
            Command::Demo(args) => demo::run(args),
            Command::Lab(args) => lab::run(&args),
            Command::Probe(args) => probe::run(&args),
            Command::Replay(args) => replay::run(&args),
            Command::Ports(args) => ports::run(&args),
            Command::Rig(args) => rig::run(&args),
            Command::Task(args) => task::run(&args),
            Command::Manual(args) => manual::run(&args, &Cli::command()),
        },
    };
    program::end(NAME, result)
}

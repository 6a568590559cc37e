//! `cargo xtask …`: set-up, demo, tests, figures, firmware, packages, the book of the pages and the tidy check.
//!
//! Needs nothing but cargo. Every command starts from the repository's root, whatever the current
//! directory, and speaks on standard error, so that standard output carries only what a program
//! started by it (`mortise demo --json`) prints.

mod arguments;
mod book;
mod demo;
mod elf;
mod figures;
mod firmware;
mod fuzz;
mod memory_map;
mod modules;
mod package;
mod peers;
mod program;
mod rust_source;
mod setup;
mod shell;
mod test;
mod tidy;

use std::process::ExitCode;

use anyhow::Result;
use clap::Parser as _;

use arguments::{Arguments, Command};

fn main() -> ExitCode {
    match run(&Arguments::parse().command) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: &Command) -> Result<ExitCode> {
    match command {
        Command::Setup(arguments) => setup::command(*arguments),
        Command::Demo(arguments) => demo::command(arguments),
        Command::Test(arguments) => test::command(arguments),
        Command::Figures(arguments) => figures::command(arguments),
        Command::Peers(arguments) => peers::command(arguments),
        Command::Fuzz(arguments) => fuzz::command(arguments),
        Command::Firmware(arguments) => firmware::command(arguments),
        Command::Package(arguments) => package::command(arguments),
        Command::Book(arguments) => book::command(arguments),
        Command::Tidy => tidy::command(),
    }
}

//! `cargo xtask …`: set-up, demo, tests, figures, firmware and the tidy check.
//!
//! Needs nothing but cargo. Every command starts from the repository's root, whatever the current
//! directory, and speaks on standard error, so that standard output carries only what a program
//! started by it (`mortise demo --json`) prints.

mod demo;
mod elf;
mod figures;
mod firmware;
mod fuzz;
mod memory_map;
mod program;
mod rust_source;
mod setup;
mod shell;
mod test;
mod tidy;
mod usage;

use std::process::ExitCode;

use anyhow::Result;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[String]) -> Result<ExitCode> {
    let (command, rest) = match arguments.split_first() {
        None => {
            eprint!("{}", usage::overview());
            return Ok(ExitCode::from(2));
        }
        Some((first, _)) if matches!(first.as_str(), "help" | "--help" | "-h") => {
            print!("{}", usage::overview());
            return Ok(ExitCode::SUCCESS);
        }
        Some((first, rest)) => (first.as_str(), rest),
    };
    // `demo` hands unknown arguments on to the program, but `--help` before any of them is ours.
    if rest
        .first()
        .is_some_and(|argument| argument == "--help" || argument == "-h")
        && let Some(text) = usage::of(command)
    {
        print!("{text}");
        return Ok(ExitCode::SUCCESS);
    }
    match command {
        "setup" => setup::command(rest),
        "demo" => demo::command(rest),
        "test" => test::command(rest),
        "figures" => figures::command(rest),
        "fuzz" => fuzz::command(rest),
        "firmware" => firmware::command(rest),
        "tidy" => tidy::command(rest),
        unknown => {
            eprintln!("error: there is no command `{unknown}`\n\n{}", usage::overview());
            Ok(ExitCode::from(2))
        }
    }
}

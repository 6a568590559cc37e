//! The program `mortise-lab`: experiments and figures.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    // First, because STEP files are read in a child process that is this same program.
    mortise_brep::child::init();
    cli::main()
}

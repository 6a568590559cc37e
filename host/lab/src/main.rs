//! The program `mortise-lab`: experiments and figures.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    // First: this program is also the process that reads STEP files for itself.
    mortise_brep::child::init();
    cli::main()
}

//! Time limit for reading a STEP file, for every command that reads one.

use super::units;

/// Options of every command that reads a STEP file.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct Reading {
    /// Limit on the processor time for reading a STEP file, in seconds [default: 60]
    #[arg(long, value_name = "SECONDS", value_parser = units::seconds, allow_negative_numbers = true)]
    timeout: Option<u64>,
}

impl Reading {
    /// Sets the limit for every file that this program reads from now on.
    pub fn apply(&self) {
        if let Some(seconds) = self.timeout {
            mortise_brep::set_time_limit_s(seconds);
        }
    }
}

//! What the steps share.

use std::path::PathBuf;

use anyhow::Result;

use super::report::Counts;
use crate::program::{self, Programs};
use crate::shell;

/// What steps share.
pub struct Bench {
    /// Root of the repository.
    pub root: PathBuf,
    /// The programs, once the step `build` made them.
    pub programs: Option<Programs>,
    /// Tests counted in the step that runs.
    pub counts: Counts,
}

impl Bench {
    /// Builds all targets of all packages at once, so that the tests that follow find the same features and compile nothing again.
    ///
    /// # Errors
    /// When something does not compile.
    pub fn build(&mut self) -> Result<Programs> {
        let mut command = shell::cargo(&self.root);
        command.args(["build", "--release", "--workspace", "--all-targets"]);
        let programs = Programs::pick(&program::build(&mut command)?)?;
        self.programs = Some(programs.clone());
        Ok(programs)
    }

    /// The programs: from the step `build`, or built now when that step was not asked for.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn programs(&mut self) -> Result<Programs> {
        match &self.programs {
            Some(programs) => Ok(programs.clone()),
            None => self.build(),
        }
    }
}

//! Fuzzing of externally supplied bytes: the results of millions of inputs.

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};

use super::{Plan, Row};
use crate::LabError;

/// Minutes for each target in the full and in the shorter form.
const MINUTES: &str = "10";
const QUICK_MINUTES: &str = "0.25";
/// The command, run from the repository's root alone: it builds the targets with counters and sanitizer.
const COMMAND: [&str; 4] = ["xtask", "fuzz", "--json", "--minutes"];
const TARGETS: &str = "hil-tests/fuzz/Cargo.toml";

/// Every fuzz target, as `cargo xtask fuzz` reports it.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let what = "fuzzing what reads frames, scenes, rig descriptions and STEP files";
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        out(Row::skipped(what, "it is set up for Linux on x86-64 alone"));
        return Ok(());
    }
    if !Path::new(TARGETS).is_file() {
        out(Row::skipped(what, "start from the repository's root"));
        return Ok(());
    }
    let minutes = if plan.quick { QUICK_MINUTES } else { MINUTES };
    let refused = |what: String| LabError::Input {
        name: format!("cargo {} {minutes}", COMMAND.join(" ")),
        what,
    };
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"));
    let run = Command::new(cargo)
        .args(COMMAND)
        .arg(minutes)
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| refused(format!("{error}; cargo must be on the path")))?;
    let said = String::from_utf8_lossy(&run.stdout);
    let rows = said
        .lines()
        .map(|line| serde_json::from_str::<Row>(line).map_err(|error| refused(format!("{error}: {line}"))))
        .collect::<Result<Vec<_>, _>>()?;
    if rows.is_empty() {
        return Err(refused(format!(
            "printed no row ({}); run it by hand",
            run.status
        )));
    }
    rows.into_iter().for_each(out);
    Ok(())
}

//! Promises on the program itself, tested by running it: its answer to a mistyped command.

use std::process::{Command, Stdio};

use crate::LabError;
use crate::figures::{Plan, Row};

/// Arguments, and the text that the one line of the answer must contain.
const MISTYPED: [(&str, &str); 4] = [
    ("opne", "did you mean `open`?"),
    ("insepct", "did you mean `inspect`?"),
    ("bakee", "did you mean `bake`?"),
    ("no-such-file.step", "there is no file no-such-file.step"),
];

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let mut wrong = 0;
    for (argument, expected) in MISTYPED {
        // Without a display, a program that opened a window would fail with another message instead of waiting to be closed.
        let run = Command::new(plan.program)
            .arg(argument)
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .stdin(Stdio::null())
            .output()
            .map_err(|source| LabError::Program {
                program: plan.program.display().to_string(),
                source,
            })?;
        let said = String::from_utf8_lossy(&run.stderr);
        let right = run.status.code() == Some(2) && said.lines().count() == 1 && said.contains(expected);
        wrong += u32::from(!right);
    }
    out(Row::exactly(
        "mistyped commands and files that are not there: not answered by one line that says what was meant",
        f64::from(wrong),
        "arguments",
        0.0,
    ));
    Ok(())
}

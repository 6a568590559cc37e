//! Writing of results to a pipe that may be closed early.

use std::io::{ErrorKind, Write as _};

use serde::Serialize;

/// One line of JSON on standard output.
///
/// # Errors
/// The line cannot be written.
pub fn json(value: &impl Serialize) -> anyhow::Result<()> {
    line(&serde_json::to_string(value)?)
}

/// Indented JSON on standard output.
///
/// # Errors
/// The text cannot be written.
pub fn json_pretty(value: &impl Serialize) -> anyhow::Result<()> {
    line(&serde_json::to_string_pretty(value)?)
}

/// One line of text on standard output.
///
/// # Errors
/// The line cannot be written.
pub fn line(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{text}")?;
    out.flush()?;
    Ok(())
}

/// Whether the reader closed the pipe (`mortise … | head`), which is no error.
pub fn is_closed(error: &anyhow::Error) -> bool {
    error
        .downcast_ref::<std::io::Error>()
        .is_some_and(|e| e.kind() == ErrorKind::BrokenPipe)
}

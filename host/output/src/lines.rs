//! Results on standard output, which may be a pipe that closes before everything is written.

use std::io::{self, ErrorKind, Write as _};

use serde::Serialize;

/// One line of JSON.
///
/// # Errors
/// When it cannot be written.
pub fn json(value: &impl Serialize) -> io::Result<()> {
    text(&serde_json::to_string(value)?)
}

/// Indented JSON.
///
/// # Errors
/// When it cannot be written.
pub fn json_pretty(value: &impl Serialize) -> io::Result<()> {
    text(&serde_json::to_string_pretty(value)?)
}

/// One line of text.
///
/// # Errors
/// When it cannot be written.
pub fn text(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{text}")?;
    out.flush()
}

/// True when the reader closed the pipe (`mortise … | head`), which is not an error.
pub fn is_closed(error: &anyhow::Error) -> bool {
    error
        .downcast_ref::<io::Error>()
        .is_some_and(|e| e.kind() == ErrorKind::BrokenPipe)
}

//! Rows of figures as text.

use std::process::ExitCode;

use mortise_lab::figures::{Count, Row, Value, Verdict};
use mortise_output::lines;

/// One row on standard output.
///
/// # Errors
/// When it cannot be written.
pub fn print(row: &Row) -> std::io::Result<()> {
    let mark = match row.verdict() {
        Verdict::Holds => "ok  ",
        Verdict::Fails => "FAIL",
        Verdict::Unbounded => "    ",
        Verdict::Skipped => "skip",
    };
    let value = match &row.value {
        Value::Number(number) => format!("{number}"),
        Value::Text(text) => text.clone(),
    };
    lines::text(&format!(
        "{mark} {}: {value} {} (bound: {}){}{}",
        row.what,
        row.unit,
        row.bound(),
        row.remark().map_or("", |_| "; "),
        row.remark().unwrap_or_default()
    ))
}

/// Exit code 1 when a row does not hold.
pub fn exit_code(count: &Count) -> ExitCode {
    if count.all_hold() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

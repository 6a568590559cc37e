//! `mortise ports`: list of the available rigs.

use std::process::ExitCode;

use mortise_output::lines;
use serde::Serialize;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// One JSON array instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Row<'a> {
    rig: String,
    label: &'a str,
    detail: &'a str,
    available: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    hint: Option<&'a str>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let rigs = mortise_rig::list();
    let rows: Vec<Row<'_>> = (rigs.iter())
        .map(|entry| Row {
            rig: entry.spec.to_string(),
            label: &entry.label,
            detail: &entry.detail,
            available: entry.available.is_ok(),
            hint: entry.available.as_ref().err().map(String::as_str),
        })
        .collect();
    if args.json {
        lines::json_pretty(&rows)?;
        return Ok(ExitCode::SUCCESS);
    }
    for row in &rows {
        lines::text(&format!("{:<20} {} ({})", row.rig, row.label, row.detail))?;
        if let Some(hint) = row.hint {
            lines::text(&format!("{:<20}   not available: {hint}", ""))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

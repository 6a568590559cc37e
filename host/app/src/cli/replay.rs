//! `mortise replay`: what a recording holds, whether it computes again to the same bits, and its telemetry as CSV.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use mortise_output::{Existing, Output, lines};
use mortise_protocol::message::Telemetry;
use mortise_protocol::parameter::{PARAMETERS, ParameterId};
use mortise_record::{Difference, EntryKind, Recording, Replayed, replay};
use serde::Serialize;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recording (.mcap)
    file: PathBuf,
    /// Compute every tick again from its recorded inputs and compare the results; exit code 1 and the first tick when one differs
    #[arg(long)]
    check: bool,
    /// As --check with another value of a parameter, as `ContactStiffness=100000`: the first tick that it changes; may be given several times
    #[arg(long, value_name = "NAME=VALUE", value_parser = change)]
    set: Vec<(ParameterId, f32)>,
    /// Write the telemetry to this file, one line a sample, SI units
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Replace an existing file (with --csv)
    #[arg(long, requires = "csv")]
    force: bool,
    /// One JSON object
    #[arg(long)]
    json: bool,
}

fn change(text: &str) -> Result<(ParameterId, f32), String> {
    let (name, value) = (text.split_once('=')).ok_or("write it as NAME=VALUE")?;
    let row = (PARAMETERS.iter().find(|row| row.name == name)).ok_or_else(|| {
        let names: Vec<_> = PARAMETERS.iter().map(|row| row.name).collect();
        format!("there is no parameter `{name}`; there are {}", names.join(", "))
    })?;
    let value: f32 = value.parse().map_err(|_| format!("`{value}` is not a number"))?;
    if (row.min..=row.max).contains(&value) {
        Ok((row.id, value))
    } else {
        Err(format!(
            "{name} must be between {} and {} {}",
            row.min, row.max, row.unit
        ))
    }
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    rig: &'a str,
    /// The recording was ended; else its program was killed, and the last half second may be missing.
    complete: bool,
    duration_s: f64,
    ticks: u64,
    telemetry: u64,
    messages: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    replayed: Option<ReplayReport>,
}

#[derive(Debug, Serialize)]
struct ReplayReport {
    compared: u64,
    same_bits: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    first_difference: Option<DifferenceReport>,
    left_out: Vec<String>,
}

#[derive(Debug, Serialize)]
struct DifferenceReport {
    tick: u32,
    /// Ticks since the scene was reset or loaded.
    since_reset: u64,
    /// The last message that took effect before it.
    after: String,
}

impl ReplayReport {
    fn of(replayed: Replayed) -> Self {
        let difference = |found: Difference| DifferenceReport {
            tick: found.tick,
            since_reset: found.since_reset,
            after: found.after,
        };
        let left_out = (replayed.left_out.iter()).map(|(tick, why)| format!("from tick {tick}: {why}"));
        Self {
            compared: replayed.compared,
            same_bits: replayed.difference.is_none(),
            left_out: left_out.collect(),
            first_difference: replayed.difference.map(difference),
        }
    }
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let existing = Existing::from_force(args.force);
    let csv = (args.csv.as_ref())
        .map(|path| Output::new(path, existing, &[&args.file]))
        .transpose()?;
    let recording = Recording::open(&args.file)?;
    let mut report = Report {
        rig: recording.rig(),
        complete: recording.complete(),
        duration_s: recording.duration_s(),
        ticks: 0,
        telemetry: 0,
        messages: 0,
        replayed: None,
    };
    let mut table = args.csv.is_some().then(|| HEADER.to_owned());
    for entry in recording.entries() {
        match entry.kind {
            EntryKind::Inputs(ticks) => report.ticks += ticks.inputs.len() as u64,
            EntryKind::Telemetry(sample) => {
                report.telemetry += 1;
                if let Some(table) = &mut table {
                    row(table, &sample);
                }
            }
            EntryKind::Sent(..) | EntryKind::Received(_) => report.messages += 1,
        }
    }
    if let (Some(csv), Some(table)) = (csv, table) {
        csv.write(table.as_bytes())?;
    }
    if args.check || !args.set.is_empty() {
        report.replayed = Some(ReplayReport::of(replay(&recording, &args.set)?));
    }
    if args.json {
        lines::json(&report)?;
    } else {
        lines::text(&words(&report))?;
    }
    let differs = report.replayed.is_some_and(|replayed| !replayed.same_bits);
    Ok(if differs {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}

fn words(report: &Report<'_>) -> String {
    let mut text = format!(
        "recorded on {} for {:.1} s: {} ticks, {} telemetry samples, {} messages",
        report.rig, report.duration_s, report.ticks, report.telemetry, report.messages
    );
    if !report.complete {
        text += "\nthe recording was not ended: at most its last half second is missing";
    }
    let Some(replayed) = &report.replayed else {
        return text;
    };
    // Writing to a string cannot fail.
    let _ = match &replayed.first_difference {
        None => write!(
            text,
            "\nreplayed: {} ticks, every bit the same",
            replayed.compared
        ),
        Some(found) => write!(
            text,
            "\nreplayed: tick {} is the first with another result, {} ticks after the scene was reset; the last message before it: {}",
            found.tick, found.since_reset, found.after
        ),
    };
    for left_out in &replayed.left_out {
        let _ = write!(
            text,
            "\nnot replayed {left_out}, up to the next reset of the scene"
        );
    }
    text
}

/// Columns of the CSV file. Positions m, orientations as quaternions x, y, z, w, forces N, torques N·m.
const HEADER: &str = "tick,part,handle_x,handle_y,handle_z,handle_qx,handle_qy,handle_qz,handle_qw,\
    object_x,object_y,object_z,object_qx,object_qy,object_qz,object_qw,\
    force_x,force_y,force_z,torque_x,torque_y,torque_z,\
    contact_force_x,contact_force_y,contact_force_z,contact_torque_x,contact_torque_y,contact_torque_z,\
    cost,points,flags,missed,dropped,pairs\n";

fn row(table: &mut String, sample: &Telemetry) {
    let mut cells = vec![sample.tick.to_string()];
    let (part, object) = sample.object.map_or((String::new(), None), |(part, pose)| {
        (part.to_string(), Some(pose))
    });
    cells.push(part);
    let mut numbers = |values: &[f32]| cells.extend(values.iter().map(f32::to_string));
    numbers(&sample.handle.position);
    numbers(&sample.handle.orientation);
    match object {
        Some(pose) => {
            numbers(&pose.position);
            numbers(&pose.orientation);
        }
        None => cells.extend(vec![String::new(); 7]),
    }
    let mut numbers = |values: &[f32]| cells.extend(values.iter().map(f32::to_string));
    for wrench in [&sample.wrench, &sample.contact] {
        numbers(&wrench.force);
        numbers(&wrench.torque);
    }
    let counts = [
        sample.cost,
        sample.points.into(),
        sample.flags.into(),
        sample.missed,
        sample.dropped,
    ];
    cells.extend(counts.map(|count| count.to_string()));
    cells.push(sample.pairs.len().to_string());
    table.push_str(&cells.join(","));
    table.push('\n');
}

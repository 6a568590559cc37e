//! `mortise task`: instructions in plain words, carried out on an assembly one after another.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use mortise_brep::LoadOptions;
use mortise_output::{Existing, Output, lines};
use mortise_words::{Outcome, Session, Turn, Verb};

use super::reading::Reading;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// STEP file
    file: PathBuf,
    /// Instructions, one turn each, such as "remove the cover"
    #[arg(value_name = "INSTRUCTION", required_unless_present = "script")]
    instructions: Vec<String>,
    /// Text file with one instruction a line, after those above; empty lines and lines that begin with # are skipped
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// STEP file to write, with the parts where they then are
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Replace an existing OUT
    #[arg(long, requires = "output")]
    force: bool,
    #[command(flatten)]
    reading: Reading,
    /// One JSON object a turn
    #[arg(long)]
    json: bool,
}

/// Runs the command. Exit code 1 when a turn is a question or refused; the turns after it are carried out all the same.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    args.reading.apply();
    let mut instructions = args.instructions.clone();
    if let Some(script) = &args.script {
        instructions.extend(read_script(script)?);
    }
    if instructions.is_empty() {
        bail!("no instruction given; write one, such as \"remove the cover\"");
    }
    let inputs: Vec<&Path> = [Some(args.file.as_path()), args.script.as_deref()]
        .into_iter()
        .flatten()
        .collect();
    let mut output = match &args.output {
        Some(path) => Some(Output::new(path, Existing::from_force(args.force), &inputs)?),
        None => None,
    };
    let options = LoadOptions::default();
    let model = mortise_brep::load_step_with(&args.file, &options)?;
    if let Some(output) = &mut output {
        output.add_inputs(&model.files)?;
    }
    let mut session = Session::new(model).with_context(|| args.file.display().to_string())?;
    let mut all_done = true;
    for instruction in &instructions {
        let turn = session.say(instruction);
        all_done &= turn.outcome == Outcome::Done;
        if args.json {
            lines::json(&turn)?;
        } else {
            lines::text(&shown(&turn))?;
        }
    }
    if let Some(output) = &output {
        let text = mortise_brep::write::step_text(&args.file, &options, session.parts())?;
        output.write(&text)?;
    }
    Ok(if all_done {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(1)
    })
}

fn read_script(path: &Path) -> anyhow::Result<Vec<String>> {
    let text = super::text_file::read(path, "one instruction a line")?;
    let lines = text.trim_start_matches('\u{feff}').lines().map(str::trim);
    Ok(lines
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(str::to_owned)
        .collect())
}

/// A turn in one line.
fn shown(turn: &Turn) -> String {
    match turn.outcome {
        Outcome::Ask => format!("ask: {}", turn.question.as_deref().unwrap_or("which one?")),
        Outcome::Refuse => {
            let reason = turn.reason.as_ref();
            format!("refuse: {}", reason.map_or("no reason", |r| r.words.as_str()))
        }
        Outcome::Done => {
            let acts: Vec<String> = turn
                .acts
                .iter()
                .map(|act| {
                    let unit = if act.verb == Verb::Turn { "°" } else { " mm" };
                    let to = act.b.as_ref().map_or(String::new(), |b| format!(" – {b}"));
                    let by = act
                        .amount
                        .map_or(String::new(), |amount| format!(", {amount:.3}{unit}"));
                    format!("{} {}{to}{by}", act.verb.word(), act.a)
                })
                .collect();
            let what = if acts.is_empty() {
                "nothing to connect or move".to_owned()
            } else {
                acts.join("; ")
            };
            match (acts.is_empty(), turn.moved.len()) {
                (true, 1..) => format!("done: {} parts moved back", turn.moved.len()),
                _ => format!("done: {what}"),
            }
        }
    }
}

//! Exit of a program: its exit code, and one line on standard error if it failed.

use std::process::ExitCode;

use clap::Command;

use crate::lines;

/// Exit code of the program `name`: that of its result, or 2 with the reason in one line on standard error.
pub fn end(name: &str, result: anyhow::Result<ExitCode>) -> ExitCode {
    match result {
        Ok(code) => code,
        Err(error) if lines::is_closed(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{name}: {}", one_line(&error));
            ExitCode::from(2)
        }
    }
}

/// An error with its causes in one line; a cause that the previous message already states is omitted.
fn one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain() {
        let text = cause.to_string().replace('\n', " ");
        if line.is_empty() {
            line = text;
        } else if !line.contains(&text) {
            line = format!("{line}: {text}");
        }
    }
    line
}

/// Exit code for a command line that clap rejects. Prints help where it is requested; otherwise the error, its place and a remedy in one line.
pub fn usage(name: &str, error: &clap::Error, command: Command) -> ExitCode {
    if !error.use_stderr() {
        // The reader may have closed the pipe, as with `mortise --help | head`.
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    let arguments: Vec<String> = std::env::args_os()
        .skip(1)
        .map(|argument| argument.to_string_lossy().into_owned())
        .collect();
    let named = named(name, &arguments, command);
    eprintln!("{}", refusal(name, &error.to_string(), &named));
    ExitCode::from(2)
}

/// A `message` of several lines in one; the usage, which help repeats, is omitted.
fn refusal(name: &str, message: &str, command: &str) -> String {
    let message = message.strip_prefix("error: ").unwrap_or(message);
    let end = ["\n\nUsage:", "\n\nFor more information"]
        .iter()
        .filter_map(|mark| message.find(mark))
        .min();
    let said = &message[..end.unwrap_or(message.len())];
    let said = said.replace("\n\n  tip: ", "; ");
    let words: Vec<&str> = said.split_whitespace().collect();
    format!("{name}: {}; see `{command} --help`", words.join(" "))
}

/// The command that `arguments` name, including subcommands.
fn named(name: &str, arguments: &[String], command: Command) -> String {
    let (mut name, mut at) = (name.to_owned(), command);
    for argument in arguments {
        if let Some(below) = at.find_subcommand(argument).cloned() {
            name = format!("{name} {argument}");
            at = below;
        }
    }
    name
}

#[cfg(test)]
mod tests {
    use clap::Arg;

    use super::*;

    fn command() -> Command {
        let cell = Arg::new("cell").long("cell").value_name("MM");
        let name = Arg::new("name").value_parser(["contact", "stability"]);
        Command::new("mortise")
            .subcommand(
                Command::new("bake")
                    .arg(cell.value_parser(clap::value_parser!(f64)))
                    .arg(Arg::new("json").long("json").action(clap::ArgAction::SetTrue)),
            )
            .subcommand(Command::new("lab").subcommand(Command::new("figures").arg(name)))
    }

    fn said(arguments: &[&str]) -> String {
        let all = std::iter::once(&"mortise").chain(arguments);
        let error = command().try_get_matches_from(all).expect_err("not understood");
        let owned: Vec<String> = arguments.iter().map(|&word| word.to_owned()).collect();
        refusal(
            "mortise",
            &error.to_string(),
            &named("mortise", &owned, command()),
        )
    }

    #[test]
    fn one_line_says_what_where_and_what_to_do() {
        assert_eq!(
            said(&["bake", "--cell", "abc"]),
            "mortise: invalid value 'abc' for '--cell <MM>': invalid float literal; see `mortise bake --help`"
        );
        let line = said(&["lab", "figures", "no-such"]);
        assert!(
            line.contains("[possible values:") && line.ends_with("see `mortise lab figures --help`"),
            "{line}"
        );
        let line = said(&["bake", "--jsn"]);
        assert!(line.contains("a similar argument exists: '--json'"), "{line}");
        assert!(!line.contains('\n') && !line.contains("Usage"), "{line}");
    }

    #[test]
    fn an_error_is_one_line_that_states_each_cause_once() {
        let cause = anyhow::anyhow!("no room\non the disk");
        let error = cause.context("cannot write x: no room on the disk");
        assert_eq!(one_line(&error), "cannot write x: no room on the disk");
        assert_eq!(
            one_line(&error.context("baking")),
            "baking: cannot write x: no room on the disk"
        );
    }
}

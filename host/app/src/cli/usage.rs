//! Report of invalid command lines: one line on standard error.

use std::process::ExitCode;

use clap::CommandFactory as _;

/// Prints help when requested; otherwise the error, its place and its remedy, in one line.
pub fn tell(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        // The reader may have closed the pipe, as with `mortise --help | head`.
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    let arguments: Vec<String> = std::env::args_os()
        .skip(1)
        .map(|argument| argument.to_string_lossy().into_owned())
        .collect();
    eprintln!("{}", line(&error.to_string(), &command(&arguments)));
    ExitCode::from(2)
}

/// Joins `message`, of several lines, to one line without the usage, which help repeats.
fn line(message: &str, command: &str) -> String {
    let message = message.strip_prefix("error: ").unwrap_or(message);
    let end = ["\n\nUsage:", "\n\nFor more information"]
        .iter()
        .filter_map(|mark| message.find(mark))
        .min();
    let said = &message[..end.unwrap_or(message.len())];
    let said = said.replace("\n\n  tip: ", "; ");
    let words: Vec<&str> = said.split_whitespace().collect();
    format!("mortise: {}; see `{command} --help`", words.join(" "))
}

/// The command and subcommands in `arguments`.
fn command(arguments: &[String]) -> String {
    let (mut name, mut at) = ("mortise".to_owned(), super::Cli::command());
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
    use super::*;

    fn told(arguments: &[&str]) -> String {
        use clap::Parser as _;
        let all = std::iter::once(&"mortise").chain(arguments);
        let error = super::super::Cli::try_parse_from(all).expect_err("not understood");
        let owned: Vec<String> = arguments.iter().map(|&word| word.to_owned()).collect();
        line(&error.to_string(), &command(&owned))
    }

    #[test]
    fn one_line_says_what_where_and_what_to_do() {
        let line = told(&["bake", "x.step", "-o", "y", "--cell", "abc"]);
        assert_eq!(
            line,
            "mortise: invalid value 'abc' for '--cell <MM>': invalid float literal; see `mortise bake --help`"
        );
        let line = told(&["lab", "figures", "no-such"]);
        assert!(
            line.contains("[possible values:") && line.ends_with("see `mortise lab figures --help`"),
            "{line}"
        );
        let line = told(&["inspect", "x.step", "--jsn"]);
        assert!(line.contains("a similar argument exists: '--json'"), "{line}");
        assert!(!line.contains('\n') && !line.contains("Usage"), "{line}");
    }
}

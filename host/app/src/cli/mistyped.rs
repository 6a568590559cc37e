//! Check of a lone argument that is neither a command nor a file: an error with a suggestion instead of an empty window.

use std::path::Path;

use strsim::osa_distance;

/// Largest number of edits (one character added, omitted, replaced, or two adjacent ones swapped) at which a word counts as a mistyped command.
const MAX_EDITS: usize = 2;

/// Checks a lone argument of `command` before a window opens for it.
///
/// # Errors
/// One line: the file does not exist, with the probable command when the argument could be one.
pub(super) fn check_lone(argument: &Path, command: &clap::Command) -> anyhow::Result<()> {
    let typed = argument.as_os_str().to_string_lossy();
    if argument.exists() || !could_be_a_command(&typed) {
        return check_file(argument);
    }
    let names: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
    match nearest(&typed, &names) {
        Some(name) => anyhow::bail!("`{typed}` is neither a command nor a file; did you mean `{name}`?"),
        None => anyhow::bail!(
            "`{typed}` is neither a command nor a file; commands: {}",
            names.join(", ")
        ),
    }
}

/// Checks the first argument when the arguments were refused for `error`: with a mistyped command, the rest is refused for reasons that mean nothing.
///
/// # Errors
/// As [`check_lone`].
pub(super) fn check_first(error: &clap::Error, command: &clap::Command) -> anyhow::Result<()> {
    let Some(first) = std::env::args_os().nth(1).filter(|_| error.use_stderr()) else {
        return Ok(());
    };
    let is_option = first.to_string_lossy().starts_with('-');
    if is_option || command.find_subcommand(&first).is_some() {
        return Ok(());
    }
    check_lone(Path::new(&first), command)
}

/// Checks that the file to open exists, before a window opens.
///
/// # Errors
/// One line: the file does not exist, or is a folder.
pub(super) fn check_file(file: &Path) -> anyhow::Result<()> {
    if file.is_dir() {
        anyhow::bail!("{} is a folder: name one STEP file", file.display());
    }
    if !file.exists() {
        anyhow::bail!("there is no file {}", file.display());
    }
    Ok(())
}

/// Whether the argument is a single word: no folder and no extension.
fn could_be_a_command(typed: &str) -> bool {
    !typed.contains(['/', '\\', '.'])
}

/// The name with the fewest edits; the first of equals.
fn nearest<'a>(typed: &str, names: &[&'a str]) -> Option<&'a str> {
    let typed = typed.to_lowercase();
    (names.iter())
        .map(|name| (osa_distance(&typed, name), *name))
        // With half of its letters changed, a short word is a different word.
        .filter(|(edits, name)| *edits <= MAX_EDITS && 2 * edits < name.len().max(typed.len()))
        .min_by_key(|(edits, _)| *edits)
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_words_are_suggested_and_far_ones_are_not() {
        let names = ["inspect", "bake", "lab", "open", "probe"];
        assert_eq!(nearest("opne", &names), Some("open"));
        assert_eq!(nearest("Insepct", &names), Some("inspect"));
        assert_eq!(nearest("lb", &names), Some("lab"));
        for far in ["gear", "ab.step", "x", ""] {
            assert_eq!(nearest(far, &names), None, "{far}");
        }
    }
}

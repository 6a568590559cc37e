//! Where the repository is, and how programs are started from here.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};

use anyhow::{Context, Result, bail};

/// Root of the repository this crate belongs to.
///
/// # Errors
/// When the place cargo names holds no `Cargo.toml` (the checkout was moved under a built binary).
pub fn root() -> Result<PathBuf> {
    // Cargo sets it anew on each run; the compiled-in value serves a binary started by hand.
    let here = std::env::var_os("CARGO_MANIFEST_DIR")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    let root = here.ancestors().nth(2).unwrap_or(&here).to_path_buf();
    if !root.join("Cargo.toml").is_file() {
        bail!(
            "{} is not the root of the repository: start this with `cargo xtask`",
            root.display()
        );
    }
    Ok(root)
}

/// Cargo, the one that started us, working in `directory`.
pub fn cargo(directory: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(directory);
    // Cargo reads a relative target directory from its own current directory, which is not the caller's.
    if let Some(target) = std::env::var_os("CARGO_TARGET_DIR")
        && let Ok(absolute) = std::path::absolute(&target)
    {
        command.env("CARGO_TARGET_DIR", absolute);
    }
    command
}

/// True if the user, or CI by `CI=true`, asked not to be asked.
pub fn is_ci() -> bool {
    std::env::var("CI").is_ok_and(|value| matches!(value.as_str(), "true" | "1"))
}

/// The command as a person would type it.
pub fn line_of(command: &Command) -> String {
    let name = Path::new(command.get_program()).file_stem().unwrap_or_default();
    std::iter::once(name)
        .chain(command.get_args())
        .map(OsStr::to_string_lossy)
        .map(|word| {
            if word.contains(' ') {
                format!("'{word}'")
            } else {
                word.into_owned()
            }
        })
        .collect::<Vec<_>>()
        .join(" ")
}

/// Runs a command with its output going through.
///
/// # Errors
/// When it cannot be started or ends with another status than success; the message holds its line.
pub fn run(command: &mut Command) -> Result<()> {
    let line = line_of(command);
    eprintln!("$ {line}");
    let status = command
        .status()
        .with_context(|| format!("`{line}` cannot be started"))?;
    succeeded(&line, status)
}

/// Runs a command, hands each line of its standard output to `on_line`; standard error goes through.
///
/// # Errors
/// As [`run`], after all lines were handed over.
pub fn run_lines(command: &mut Command, mut on_line: impl FnMut(&str)) -> Result<()> {
    let line = line_of(command);
    eprintln!("$ {line}");
    let mut child = command
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("`{line}` cannot be started"))?;
    let output = child.stdout.take().context("standard output was not piped")?;
    let mut reader = BufReader::new(output);
    let mut bytes = Vec::new();
    // By bytes, because a test may print what is not UTF-8.
    while reader.read_until(b'\n', &mut bytes)? > 0 {
        on_line(String::from_utf8_lossy(&bytes).trim_end_matches(['\r', '\n']));
        bytes.clear();
    }
    succeeded(&line, child.wait()?)
}

/// Standard output of a command that is expected to be short; standard error goes through.
///
/// # Errors
/// As [`run`].
pub fn read(command: &mut Command) -> Result<String> {
    let line = line_of(command);
    let mut child = command
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("`{line}` cannot be started"))?;
    let mut bytes = Vec::new();
    if let Some(mut output) = child.stdout.take() {
        output.read_to_end(&mut bytes)?;
    }
    succeeded(&line, child.wait()?)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Full path of a program, looked for in `PATH` as the system would.
pub fn find_program(name: &str) -> Option<PathBuf> {
    let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
    std::env::split_paths(&std::env::var_os("PATH")?)
        .map(|place| place.join(&file))
        .find(|path| path.is_file())
}

fn succeeded(line: &str, status: ExitStatus) -> Result<()> {
    if status.success() {
        Ok(())
    } else {
        bail!("`{line}` failed ({status})")
    }
}

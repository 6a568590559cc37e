//! Builds boards' firmware and measures what it takes of flash and RAM.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};

use crate::arguments::Firmware;
use crate::memory_map::{self, Region};
use crate::setup::{self, BOARD_TARGET, Group};
use crate::{elf, program, shell};

/// The board that QEMU emulates.
pub const EMULATED: &str = "mps2-an500";

/// RAM that must stay free beside the statics, for the stack. A budget, not a measurement: an
/// exception frame with FPU registers takes 104 bytes, so this leaves room for nested interrupts
/// above call chains of some kilobytes.
const STACK_BYTES: u64 = 16 * 1024;

/// Name of the variable that states what a file of firmware is for; `SYMBOL` of `protocol/src/label.rs`.
const LABEL: &str = "MORTISE_FIRMWARE";

/// Names of the boards there are, sorted: crates with a linker script.
pub fn boards(root: &Path) -> Result<Vec<String>> {
    let names = with_file(root, "memory.x")?;
    if names.is_empty() {
        bail!("there is no board in firmware/boards");
    }
    Ok(names)
}

/// Names of the boards and of what they share, sorted.
pub fn crates(root: &Path) -> Result<Vec<String>> {
    with_file(root, "Cargo.toml")
}

fn with_file(root: &Path, file: &str) -> Result<Vec<String>> {
    let directory = root.join("firmware/boards");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&directory).with_context(|| format!("reading {}", directory.display()))? {
        let entry = entry?;
        if entry.path().join(file).is_file() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    names.sort();
    Ok(names)
}

/// Cargo in a board's directory, where the board's target and linker options hold.
///
/// Boards share one target directory, apart from the host's: the desktop program looks for the
/// emulated board's firmware there.
pub fn cargo(root: &Path, board: &str) -> std::process::Command {
    let mut command = shell::cargo(&root.join("firmware/boards").join(board));
    command.env("CARGO_TARGET_DIR", root.join("firmware/boards/target"));
    command
}

/// Builds one board in the release profile, prints its memory use and returns the firmware's path.
///
/// # Errors
/// When it does not build, or leaves too little RAM for the stack.
pub fn build(root: &Path, board: &str) -> Result<PathBuf> {
    let directory = root.join("firmware/boards").join(board);
    if !directory.join("Cargo.toml").is_file() {
        bail!(
            "there is no board `{board}` in firmware/boards; there are: {}",
            boards(root)?.join(", ")
        );
    }
    let mut command = cargo(root, board);
    command.args(["build", "--release", "--target", BOARD_TARGET]);
    let made =
        program::build(&mut command).with_context(|| format!("the firmware of {board} does not build"))?;
    let Some((_, path)) = made.into_iter().next() else {
        bail!("the build of {board} made no program");
    };
    let script = directory.join("memory.x");
    let text = std::fs::read_to_string(&script).with_context(|| format!("reading {}", script.display()))?;
    let regions = memory_map::parse(&text).with_context(|| format!("reading {}", script.display()))?;
    let file = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
    let segments = elf::segments(&file).with_context(|| format!("reading {}", path.display()))?;
    eprintln!("{board}: memory use");
    for region in &regions {
        eprintln!("  {}", use_line(region, region.used(&segments)));
    }
    check_stack(board, &regions, &segments)?;
    // The emulator takes the file as it is; a board's firmware states which board it is for.
    if board != EMULATED && !elf::has_symbol(&file, LABEL)? {
        bail!("the firmware of {board} has no `{LABEL}`: protocol/src/label.rs says what it is");
    }
    Ok(path)
}

/// `cargo xtask firmware [BOARD]`.
pub fn command(arguments: &Firmware) -> Result<ExitCode> {
    let root = shell::root()?;
    let chosen = if arguments.boards.is_empty() {
        boards(&root)?
    } else {
        arguments.boards.clone()
    };
    if !setup::ensure(&[Group::Board], arguments.installing.into())? {
        return Ok(ExitCode::FAILURE);
    }
    for board in &chosen {
        let path = build(&root, board)?;
        eprintln!("  {}", path.strip_prefix(&root).unwrap_or(&path).display());
    }
    Ok(ExitCode::SUCCESS)
}

fn use_line(region: &Region, used: u64) -> String {
    let share = if region.length == 0 {
        0.0
    } else {
        used as f64 / region.length as f64 * 100.0
    };
    format!(
        "{:<12} {used:>9} of {:>9} bytes {share:>6.1} %",
        region.name, region.length
    )
}

/// The stack lies in a region of its own called `STACK`, or else in `RAM` beside the statics.
fn check_stack(board: &str, regions: &[Region], segments: &[elf::Segment]) -> Result<()> {
    let region = |name: &str| regions.iter().find(|region| region.name == name);
    let stack = region("STACK")
        .or_else(|| region("RAM"))
        .context("the linker script names neither STACK nor RAM")?;
    let left = stack.length.saturating_sub(stack.used(segments));
    if left < STACK_BYTES {
        bail!("{board} leaves {left} bytes for the stack; at least {STACK_BYTES} are asked for");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ram_without_room_for_the_stack_is_refused() {
        let ram = Region {
            name: "RAM".into(),
            origin: 0x2000_0000,
            length: 128 * 1024,
        };
        let filled = |bytes| elf::Segment {
            address: 0x2000_0000,
            stored_at: 0x2000_0000,
            stored_bytes: 0,
            bytes,
        };
        let regions = [ram];
        assert!(check_stack("board", &regions, &[filled(112 * 1024)]).is_ok());
        let error = check_stack("board", &regions, &[filled(112 * 1024 + 1)])
            .unwrap_err()
            .to_string();
        assert!(error.contains("16383 bytes"), "{error}");
        assert!(check_stack("board", &[], &[]).is_err());

        // A stack of its own does not mind a full RAM.
        let stack = Region {
            name: "STACK".into(),
            origin: 0x1000_0000,
            length: STACK_BYTES,
        };
        let both = [regions[0].clone(), stack];
        assert!(check_stack("board", &both, &[filled(128 * 1024)]).is_ok());
    }
}

//! The steps, one function each. `window` has its own file.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail};

use super::bench::Bench;
use super::binaries::{self, Job};
use crate::{figures, firmware as boards, fuzz, package, setup, shell, tidy};

const HIL_TESTS: &str = "mortise-hil-tests";
const HIL_BENCH: &str = "bench";
const FUZZ_EACH: Duration = Duration::from_secs(15);
/// Seed of the property tests' cases, unless the environment sets another: a commit passes or fails the same everywhere. Plain `cargo test` draws new
/// cases each time.
const PROPERTY_SEED: (&str, &str) = ("PROPTEST_RNG_SEED", "20261122");
/// Test programs that take longest, longest first: they are begun first, so that none of them runs alone at the end.
const LONGEST: [&str; 8] = [
    "host/app window",
    "host/bake all",
    "host/bake signs",
    "host/lab mortise_lab",
    "host/task all",
    "host/inspect all",
    "host/record sessions",
    "firmware/orders depth",
];
const BOARD_SIDE: [&str; 5] = [
    "mortise-protocol",
    "mortise-haptics",
    "mortise-mechanism",
    "mortise-firmware",
    "mortise-simulation",
];

pub fn format(bench: &mut Bench) -> Result<String> {
    shell::run(shell::cargo(&bench.root).args(["fmt", "--all", "--check"]))?;
    for board in boards::crates(&bench.root)? {
        shell::run(boards::cargo(&bench.root, &board).args(["fmt", "--check"]))?;
    }
    Ok(String::new())
}

pub fn tidy(bench: &mut Bench) -> Result<String> {
    tidy::report(&tidy::check(&bench.root)?)?;
    Ok(String::new())
}

/// `cargo deny` over both shipped workspaces. The list of advisories comes from the network; if that is unreachable, the step reports so.
pub fn dependencies(bench: &mut Bench) -> Result<String> {
    let deny = |manifest: &str, checks: &[&str]| {
        let mut command = shell::cargo(&bench.root);
        command
            .args([
                "deny",
                "--manifest-path",
                manifest,
                "check",
                "--hide-inclusion-graph",
            ])
            // One list serves both dependency trees: an exception used only by the other tree is not a finding.
            .args([
                "--allow",
                "unmatched-skip",
                "--allow",
                "license-exception-not-encountered",
            ])
            .args(checks);
        command
    };
    let manifests = ["Cargo.toml", "firmware/boards/Cargo.toml"];
    for manifest in manifests {
        shell::run(&mut deny(manifest, &["licenses", "bans", "sources"]))?;
    }
    let mut fetch = shell::cargo(&bench.root);
    fetch.args(["deny", "fetch", "db"]);
    if shell::run(&mut fetch).is_err() {
        return Ok("advisories not checked: their list cannot be fetched here".to_owned());
    }
    for manifest in manifests {
        shell::run(&mut deny(manifest, &["advisories"]))?;
    }
    Ok("advisories checked".to_owned())
}

pub fn lint(bench: &mut Bench) -> Result<String> {
    let mut command = shell::cargo(&bench.root);
    shell::run(command.args([
        "clippy",
        "--release",
        "--workspace",
        "--all-targets",
        "--",
        "-D",
        "warnings",
    ]))?;
    Ok(String::new())
}

/// Compiles without the standard library. Tests run with it, so a crate that needs it would otherwise go unnoticed.
pub fn no_std(bench: &mut Bench) -> Result<String> {
    let mut command = shell::cargo(&bench.root);
    command.args(["check", "--release", "--target", setup::BOARD_TARGET]);
    for package in BOARD_SIDE {
        command.args(["--package", package]);
    }
    shell::run(&mut command)?;
    Ok(String::new())
}

pub fn lint_boards(bench: &mut Bench) -> Result<String> {
    for board in boards::boards(&bench.root)? {
        let mut command = boards::cargo(&bench.root, &board);
        command.args(["clippy", "--release", "--target", setup::BOARD_TARGET]);
        shell::run(command.args(["--", "-D", "warnings"]))?;
    }
    Ok(String::new())
}

pub fn firmware(bench: &mut Bench) -> Result<String> {
    let names = boards::boards(&bench.root)?;
    for board in &names {
        boards::build(&bench.root, board)?;
    }
    Ok(format!("{} boards", names.len()))
}

/// See [`Bench::build`].
pub fn build(bench: &mut Bench) -> Result<String> {
    bench.build()?;
    Ok(String::new())
}

/// All tests but those on a rig: programs side by side, see [`binaries`], and beside the first of them examples in documentation, one crate's after the
/// other's.
pub fn unit(bench: &mut Bench) -> Result<String> {
    let mut build = shell::cargo(&bench.root);
    build.args([
        "test",
        "--release",
        "--workspace",
        "--exclude",
        HIL_TESTS,
        "--no-run",
    ]);
    let mut examples = shell::cargo(&bench.root);
    examples.args(["test", "--release", "--workspace", "--doc", "--no-fail-fast"]);
    let examples = Job {
        title: "examples in documentation".to_owned(),
        command: examples,
    };
    let counts = &mut bench.counts;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    binaries::run(&bench.root, &mut build, examples, &LONGEST, cores, seed, |line| {
        println!("{line}");
        counts.add_line(line);
    })?;
    some_ran(bench)
}

/// Parts of boards that need no chip are libraries, tested here on the PC.
pub fn unit_boards(bench: &mut Bench) -> Result<String> {
    let host = host_triple(&bench.root)?;
    let boards = bench.root.join("firmware/boards");
    for board in boards::crates(&bench.root)? {
        if !boards.join(&board).join("src/lib.rs").is_file() {
            continue;
        }
        let mut command = boards::cargo(&bench.root, &board);
        command.args(["test", "--lib", "--target", &host]);
        counted(bench, &mut command)?;
    }
    Ok(String::new())
}

pub fn hil(bench: &mut Bench) -> Result<String> {
    boards::build(&bench.root, boards::EMULATED)?;
    let mut command = shell::cargo(&bench.root);
    // The whole workspace, so that dependencies keep the features they were built with.
    command.args([
        "test",
        "--release",
        "--workspace",
        "--test",
        HIL_BENCH,
        "--no-fail-fast",
    ]);
    counted(bench, &mut command)
}

/// The loom model checker: every interleaving of the two planes' threads, weak memory included. It is a separate workspace, because its atomics are
/// loom's.
pub fn interleavings(bench: &mut Bench) -> Result<String> {
    let mut command = shell::cargo(&bench.root);
    command
        .current_dir(bench.root.join("hil-tests/loom"))
        .env("RUST_BACKTRACE", "0")
        .args(["test", "--release", "--tests", "--target-dir"])
        .arg(tidy::target_directory(&bench.root)?.join("loom"));
    counted(bench, &mut command)
}

/// The shorter form: long enough to find errors that a change causes near the stored corpora. `cargo xtask fuzz --minutes 10` searches longer.
pub fn fuzz(bench: &mut Bench) -> Result<String> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return Ok("not run: set up for Linux on x86-64 alone".to_owned());
    }
    let (mut words, mut crashed) = (Vec::new(), false);
    fuzz::run(&bench.root, FUZZ_EACH, None, |fuzzed| {
        words.push(fuzzed.to_string());
        crashed |= fuzzed.crashed();
    })?;
    let words = words.join("; ");
    if crashed { bail!("{words}") } else { Ok(words) }
}

pub fn docs(bench: &mut Bench) -> Result<String> {
    let mut command = shell::cargo(&bench.root);
    command
        .env("RUSTDOCFLAGS", "-D warnings")
        .args(["doc", "--release", "--workspace", "--no-deps"]);
    shell::run(&mut command)?;
    let programs = bench.programs()?;
    tidy::report(&tidy::check_commands(&bench.root, &programs)?)?;
    Ok(String::new())
}

pub fn figures(bench: &mut Bench) -> Result<String> {
    let lab = bench.programs()?.lab;
    figures::step(&bench.root, &lab)
}

pub fn package(bench: &mut Bench) -> Result<String> {
    let program = bench.programs()?.mortise;
    package::step(&bench.root, &program)
}

/// The system tests run on. Asked for, because a board's own configuration may name another.
fn host_triple(root: &Path) -> Result<String> {
    let text = shell::read(Command::new("rustc").arg("-vV").current_dir(root))?;
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("`rustc -vV` names no host")?.to_owned())
}

/// Sets [`PROPERTY_SEED`].
fn seed(command: &mut Command) {
    let (name, seed) = PROPERTY_SEED;
    if std::env::var_os(name).is_none() {
        command.env(name, seed);
    }
}

/// Runs tests and counts them, including failed ones.
fn counted(bench: &mut Bench, command: &mut Command) -> Result<String> {
    seed(command);
    shell::run_lines(command, |line| {
        println!("{line}");
        bench.counts.add_line(line);
    })?;
    some_ran(bench)
}

/// A run without tests is a failure, because it shows nothing.
fn some_ran(bench: &Bench) -> Result<String> {
    if bench.counts.passed == 0 {
        bail!("no test was run");
    }
    Ok(String::new())
}

//! `cargo xtask fuzz`: random bytes, guided by coverage, for everything that reads what others wrote.
//!
//! The targets in `hil-tests/fuzz` have the layout of cargo-fuzz, which runs them too. Here they are built with the repository's own toolchain, so
//! that nothing has to be installed: the counters are LLVM's, and the address sanitizer, which sees reads beyond an end in `unsafe` code, is asked
//! for by the name under which a stable compiler knows it. Linux on x86-64 only.

use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, bail};

use crate::{program, shell};

/// What is fuzzed, and files there are that serve as a start.
const TARGETS: [Target; 4] = [
    Target {
        name: "frame",
        seeds: None,
        longest: 1600,
    },
    Target {
        name: "rig",
        seeds: Some("firmware/rigs"),
        longest: 4096,
    },
    Target {
        name: "scene",
        seeds: Some("protocol/tests/golden"),
        longest: 16_384,
    },
    Target {
        name: "step",
        seeds: Some("host/app/samples"),
        longest: 65_536,
    },
];

/// A run is a hang after so many seconds on one input; none takes a hundredth of it.
const HANG_S: u32 = 10;

/// What cargo-fuzz passes, with the sanitizer: <https://github.com/rust-fuzz/cargo-fuzz>, `src/project.rs`.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares -Zsanitizer=address -Ccodegen-units=1 --cfg fuzzing";

struct Target {
    name: &'static str,
    seeds: Option<&'static str>,
    /// Bytes.
    longest: u32,
}

/// What a target came to.
pub struct Fuzzed {
    name: &'static str,
    runs: u64,
    /// Edges of the program that were taken, and how many there are.
    edges: (u64, u64),
}

impl std::fmt::Display for Fuzzed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (taken, all) = self.edges;
        write!(
            f,
            "{}: {} inputs, {taken} of {all} edges, no crash",
            self.name, self.runs
        )
    }
}

/// `cargo xtask fuzz [--minutes N] [TARGET]`.
pub fn command(arguments: &[String]) -> Result<ExitCode> {
    let (mut minutes, mut only) = (1.0f64, None);
    let mut words = arguments.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--minutes" => {
                let value = words.next().context("`--minutes` needs a number")?;
                minutes = value
                    .parse()
                    .ok()
                    .filter(|m| (0.0..=1e4).contains(m))
                    .with_context(|| format!("`{value}` is no number of minutes"))?;
            }
            name if TARGETS.iter().any(|target| target.name == name) => only = Some(name.to_owned()),
            unknown => {
                let names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
                bail!("there is no target `{unknown}`; there are: {}", names.join(" "));
            }
        }
    }
    let each = Duration::from_secs_f64(60.0 * minutes);
    for fuzzed in run(&shell::root()?, each, only.as_deref())? {
        println!("{fuzzed}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs each target for so long, or the one named.
///
/// # Errors
/// A crash, a hang, a failed assertion or a read beyond an end; the input that made it is kept and named.
pub fn run(root: &Path, each: Duration, only: Option<&str>) -> Result<Vec<Fuzzed>> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        bail!("fuzzing is set up for Linux on x86-64 alone");
    }
    let crate_of = root.join("hil-tests/fuzz");
    let place = crate_of.join("target");
    let mut build = shell::cargo(&crate_of);
    build
        .args([
            "build",
            "--release",
            "--bins",
            "--target",
            "x86_64-unknown-linux-gnu",
        ])
        .env("CARGO_TARGET_DIR", &place)
        // A stable compiler refuses `-Z` without.
        .env("RUSTC_BOOTSTRAP", "1")
        .env("RUSTFLAGS", FLAGS);
    let made = program::build(&mut build)?;
    let mut all = Vec::new();
    for target in TARGETS
        .iter()
        .filter(|target| only.is_none_or(|name| name == target.name))
    {
        let path = made
            .iter()
            .find(|(name, _)| name == target.name)
            .map(|(_, path)| path.clone())
            .with_context(|| format!("the build made no `{}`", target.name))?;
        all.push(fuzz(root, &place, target, &path, each)?);
    }
    Ok(all)
}

fn fuzz(root: &Path, place: &Path, target: &Target, program: &Path, each: Duration) -> Result<Fuzzed> {
    // New finds go beside the build; what is kept in the repository is only read.
    let found = place.join("corpus").join(target.name);
    let crashes = place.join("crashes").join(target.name);
    std::fs::create_dir_all(&found)?;
    std::fs::create_dir_all(&crashes)?;
    let kept = root.join("hil-tests/fuzz/corpus").join(target.name);
    let seeds = target.seeds.map(|seeds| root.join(seeds));
    let log = place.join(format!("{}.log", target.name));
    let mut command = Command::new(program);
    command
        .arg(&found)
        .args(
            [Some(kept), seeds]
                .into_iter()
                .flatten()
                .filter(|folder| folder.is_dir()),
        )
        .arg(format!("-max_total_time={}", each.as_secs().max(1)))
        .arg(format!("-max_len={}", target.longest))
        .arg(format!("-timeout={HANG_S}"))
        .arg(format!("-artifact_prefix={}/", crashes.display()))
        .arg("-print_final_stats=1")
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&log)?);
    eprintln!("$ {}", shell::line_of(&command));
    let status = command
        .status()
        .with_context(|| format!("{} cannot be started", program.display()))?;
    let said = std::fs::read_to_string(&log).unwrap_or_default();
    if !status.success() {
        let tail: Vec<&str> = said.lines().rev().take(40).collect();
        let tail: Vec<&str> = tail.into_iter().rev().collect();
        bail!(
            "{} failed ({status}); the input is in {}\n{}",
            target.name,
            crashes.display(),
            tail.join("\n")
        );
    }
    let fuzzed = read_log(target.name, &said)
        .with_context(|| format!("{} does not say what was done", log.display()))?;
    if fuzzed.runs == 0 || fuzzed.edges.0 == 0 {
        bail!("{}: nothing was run", target.name);
    }
    Ok(fuzzed)
}

/// From libFuzzer's log: `… (12345 inline 8-bit counters)…`, `#99 … cov: 432 ft: …`, `stat::number_of_executed_units: 99`.
fn read_log(name: &'static str, said: &str) -> Option<Fuzzed> {
    let number = |text: &str| text.split_whitespace().next()?.parse().ok();
    let all = said
        .split(" inline 8-bit counters")
        .next()?
        .rsplit('(')
        .next()
        .and_then(number)?;
    let taken = said.rsplit("cov: ").next().and_then(number)?;
    let runs = said
        .split("stat::number_of_executed_units:")
        .nth(1)
        .and_then(number)?;
    Some(Fuzzed {
        name,
        runs,
        edges: (taken, all),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_is_read() {
        let said = "INFO: Loaded 1 modules   (5310 inline 8-bit counters): 5310 [0x55, 0x56),\n#2 INITED cov: 12 ft: 12 corp: 1/1b\n\
            #99 DONE   cov: 431 ft: 702 corp: 50/2Kb\nstat::number_of_executed_units: 990\n";
        let fuzzed = read_log("frame", said).expect("all is there");
        assert_eq!((fuzzed.runs, fuzzed.edges), (990, (431, 5310)));
        assert!(read_log("frame", "ERROR: no such file").is_none());
    }
}

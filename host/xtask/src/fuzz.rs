//! `cargo xtask fuzz`: random bytes, guided by coverage, for everything that reads what others wrote.
//!
//! The targets in `hil-tests/fuzz` have the layout of cargo-fuzz, which runs them too. Here they are built with the repository's own toolchain, so
//! that nothing has to be installed: the counters are LLVM's, and the address sanitizer, which sees reads beyond an end in `unsafe` code, is asked
//! for by the name under which a stable compiler knows it. Linux on x86-64 only.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use tinyjson::JsonValue;

use crate::arguments::Fuzz;
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
/// Processes that try one target at once and share what they find.
const WORKERS: usize = 2;

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
    /// A crash, a hang, a failed assertion or a read beyond an end: what was said of it, and where the input is that made it.
    crash: Option<String>,
}

impl std::fmt::Display for Fuzzed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (taken, all) = self.edges;
        write!(f, "{}: {} inputs, {taken} of {all} edges, ", self.name, self.runs)?;
        f.write_str(self.crash.as_deref().unwrap_or("no crash"))
    }
}

impl Fuzzed {
    /// True if some input made it crash, hang, fail an assertion or read beyond an end.
    pub fn crashed(&self) -> bool {
        self.crash.is_some()
    }

    /// As rows of figures, one JSON object a line.
    fn rows(&self, each: Duration) -> String {
        let what = format!(
            "fuzzing {}, {} s in {WORKERS} processes",
            self.name,
            each.as_secs()
        );
        let crashes = u64::from(self.crashed());
        let (taken, all) = self.edges;
        let row = |what: String, value: u64, bound: &str, holds: Option<bool>| {
            let text = |text: String| JsonValue::from(text).stringify().expect("a string has a form");
            let (what, bound) = (text(what), text(bound.to_owned()));
            let holds = holds.map_or("null".to_owned(), |holds| holds.to_string());
            format!(r#"{{"what":{what},"value":{value},"unit":"","bound":{bound},"holds":{holds}}}"#)
        };
        [
            row(
                format!("{what}: crashes, hangs and reads beyond an end"),
                crashes,
                "= 0",
                Some(crashes == 0),
            ),
            // How many there are depends on the machine and on chance: a run without any is refused, nothing else bounds them.
            row(format!("{what}: inputs"), self.runs, "none", None),
            row(
                format!("{what}: edges of the program taken, of {all}"),
                taken,
                "none",
                None,
            ),
        ]
        .join("\n")
    }
}

/// `cargo xtask fuzz [--minutes N] [--json] [TARGET]`.
pub fn command(arguments: &Fuzz) -> Result<ExitCode> {
    let (minutes, json, only) = (arguments.minutes, arguments.json, &arguments.target);
    if !(0.0..=1e4).contains(&minutes) {
        bail!("`{minutes}` is no number of minutes: 0 to 10,000");
    }
    if let Some(unknown) = only
        .as_ref()
        .filter(|name| !TARGETS.iter().any(|target| target.name == **name))
    {
        let names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
        bail!("there is no target `{unknown}`; there are: {}", names.join(" "));
    }
    let each = Duration::from_secs_f64((60.0 * minutes).max(1.0));
    let mut code = ExitCode::SUCCESS;
    run(&shell::root()?, each, only.as_deref(), |fuzzed| {
        if json {
            println!("{}", fuzzed.rows(each));
            if let Some(crash) = &fuzzed.crash {
                eprintln!("{crash}");
            }
        } else {
            println!("{fuzzed}");
        }
        if fuzzed.crashed() {
            code = ExitCode::FAILURE;
        }
    })?;
    Ok(code)
}

/// Runs each target for so long, or the one named, and tells what each came to.
///
/// # Errors
/// When targets cannot be built or started, or do not say what they did. A crash is no error.
pub fn run(root: &Path, each: Duration, only: Option<&str>, mut tell: impl FnMut(Fuzzed)) -> Result<()> {
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
    for target in TARGETS
        .iter()
        .filter(|target| only.is_none_or(|name| name == target.name))
    {
        let path = made
            .iter()
            .find(|(name, _)| name == target.name)
            .map(|(_, path)| path.clone())
            .with_context(|| format!("the build made no `{}`", target.name))?;
        tell(fuzz(root, &place, target, &path, each)?);
    }
    Ok(())
}

/// One process that tries a target.
struct Worker {
    process: Child,
    log: PathBuf,
}

impl Worker {
    fn start(
        root: &Path,
        place: &Path,
        target: &Target,
        program: &Path,
        each: Duration,
        number: usize,
    ) -> Result<Self> {
        // New finds go beside the build; what is kept in the repository is only read.
        let found = place.join("corpus").join(target.name);
        let crashes = place.join("crashes").join(target.name);
        std::fs::create_dir_all(&found)?;
        std::fs::create_dir_all(&crashes)?;
        let kept = root.join("hil-tests/fuzz/corpus").join(target.name);
        let seeds = target.seeds.map(|seeds| root.join(seeds));
        let log = place.join(format!("{}-{number}.log", target.name));
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
        let process = command
            .spawn()
            .with_context(|| format!("{} cannot be started", program.display()))?;
        Ok(Self { process, log })
    }

    fn end(mut self, name: &'static str) -> Result<Fuzzed> {
        let status = self.process.wait()?;
        let said = std::fs::read_to_string(&self.log).unwrap_or_default();
        let crash = (!status.success()).then(|| {
            // From the first word of it on: the panic, or what the sanitizer saw.
            let lines: Vec<&str> = said.lines().collect();
            let from = lines
                .iter()
                .position(|line| line.contains("panicked at") || line.contains("ERROR: "))
                .unwrap_or(lines.len().saturating_sub(40));
            format!("failed ({status}):\n{}", lines[from..].join("\n"))
        });
        let (runs, edges) = match read_log(&said) {
            Some(read) => read,
            // It may have died before it could count.
            None if crash.is_some() => (0, (0, 0)),
            None => bail!("{} does not say what was done", self.log.display()),
        };
        if crash.is_none() && (runs == 0 || edges.0 == 0) {
            bail!("{name}: nothing was run");
        }
        Ok(Fuzzed {
            name,
            runs,
            edges,
            crash,
        })
    }
}

fn fuzz(root: &Path, place: &Path, target: &Target, program: &Path, each: Duration) -> Result<Fuzzed> {
    let workers = (0..WORKERS)
        .map(|number| Worker::start(root, place, target, program, each, number))
        .collect::<Result<Vec<_>>>()?;
    let ends = workers
        .into_iter()
        .map(|worker| worker.end(target.name))
        .collect::<Result<Vec<_>>>()?;
    Ok((ends.into_iter())
        .reduce(|a, b| Fuzzed {
            name: a.name,
            runs: a.runs + b.runs,
            // They share what they find, so that their edges are largely the same ones.
            edges: a.edges.max(b.edges),
            crash: a.crash.or(b.crash),
        })
        .expect("there are workers"))
}

/// Inputs tried, edges taken and edges there are, from libFuzzer's log: `… (12345 inline 8-bit counters)…`, `#99 … cov: 432 ft: …`,
/// `stat::number_of_executed_units: 99`.
fn read_log(said: &str) -> Option<(u64, (u64, u64))> {
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
    Some((runs, (taken, all)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_is_read() {
        let said = "INFO: Loaded 1 modules   (5310 inline 8-bit counters): 5310 [0x55, 0x56),\n#2 INITED cov: 12 ft: 12 corp: 1/1b\n\
            #99 DONE   cov: 431 ft: 702 corp: 50/2Kb\nstat::number_of_executed_units: 990\n";
        assert_eq!(read_log(said), Some((990, (431, 5310))));
        assert_eq!(read_log("ERROR: no such file"), None);
    }

    #[test]
    fn a_crash_is_a_row_that_does_not_hold() {
        let mut fuzzed = Fuzzed {
            name: "frame",
            runs: 99,
            edges: (12, 53),
            crash: None,
        };
        let rows = fuzzed.rows(Duration::from_secs(600));
        assert!(
            rows.contains("fuzzing frame, 600 s in 2 processes: edges of the program taken, of 53"),
            "{rows}"
        );
        // The numbers of inputs and edges are not bounded, and count as nothing that holds.
        let unbounded = |row: &&str| row.contains(r#""bound":"none","holds":null"#);
        assert_eq!(rows.lines().filter(unbounded).count(), 2, "{rows}");
        assert_eq!(rows.matches(r#""bound":"= 0","holds":true"#).count(), 1, "{rows}");
        fuzzed.crash = Some("SUMMARY: heap-buffer-overflow".into());
        assert!(fuzzed.rows(Duration::from_secs(600)).contains(r#""holds":false"#));
    }
}

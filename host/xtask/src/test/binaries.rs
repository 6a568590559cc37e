//! Test programs, run as many at a time as the machine has cores.
//!
//! `cargo test` runs them one after the other, and most end with one long test beside which the other cores have nothing to do. Here each runs one
//! test at a time and several run at once: no core waits, and no more tests run side by side than under `cargo test`.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, PipeReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::{program, shell};

/// After so long without the end of any program, it is said what runs.
const SILENCE: Duration = Duration::from_secs(60);

/// A test program that cargo made.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Binary {
    /// Cargo's name of it; several packages may have one of the same name.
    name: String,
    /// Of its package: the working directory in which tests are run.
    folder: PathBuf,
    program: PathBuf,
}

impl Binary {
    /// The package's folder from the repository's root on, and the name.
    fn title(&self, root: &Path) -> String {
        let folder = self.folder.strip_prefix(root).unwrap_or(&self.folder);
        format!("{} {}", folder.display(), self.name)
    }

    /// With what `cargo test` sets for a test that runs.
    fn job(&self, root: &Path) -> Job {
        let mut command = Command::new(&self.program);
        // Those of xtask itself, which cargo started.
        for (name, _) in std::env::vars_os() {
            if name.to_string_lossy().starts_with("CARGO_PKG_") {
                command.env_remove(name);
            }
        }
        command
            .arg("--test-threads=1")
            .current_dir(&self.folder)
            .env("CARGO_MANIFEST_DIR", &self.folder)
            .env("CARGO_MANIFEST_PATH", self.folder.join("Cargo.toml"));
        Job {
            title: self.title(root),
            command,
        }
    }
}

/// A command that runs tests.
pub struct Job {
    /// Its name in what is printed.
    pub title: String,
    /// Its output is what `cargo test` prints.
    pub command: Command,
}

/// What the threads that run programs say.
enum Said {
    Started(usize),
    Line(usize, String),
    Ended(usize, Result<ExitStatus>),
}

/// A program that runs, and what it printed so far.
struct Running {
    index: usize,
    since: Instant,
    lines: Vec<String>,
}

/// Builds what `build` (a `cargo test --no-run …`) asks for and runs it, `at_once` programs at a time, `beside` and those in `first` (by title) before
/// all others; `prepare` is called with each command. All run, also after a failure; the output of each is handed to `on_line` when it ended.
///
/// # Errors
/// When something does not compile, cannot be run or fails: the message names the programs; when one in `first` is not among them.
pub fn run(
    root: &Path,
    build: &mut Command,
    beside: Job,
    first: &[&str],
    at_once: usize,
    prepare: impl Fn(&mut Command),
    on_line: impl FnMut(&str),
) -> Result<()> {
    let mut binaries = Vec::new();
    build.arg("--message-format=json-render-diagnostics");
    shell::run_lines(build, |line| binaries.extend(binary_of(line)))?;
    order(&mut binaries, root, first)?;
    let mut jobs = vec![beside];
    jobs.extend(binaries.iter().map(|binary| binary.job(root)));
    jobs.iter_mut().for_each(|job| prepare(&mut job.command));
    let failed = run_all(jobs, at_once, on_line);
    if !failed.is_empty() {
        bail!("{} failed", failed.join(", "));
    }
    Ok(())
}

/// Runs them, and returns those that failed, in words.
fn run_all(jobs: Vec<Job>, at_once: usize, mut on_line: impl FnMut(&str)) -> Vec<String> {
    let (titles, commands): (Vec<String>, Vec<Command>) =
        (jobs.into_iter()).map(|job| (job.title, job.command)).unzip();
    let queue: Mutex<VecDeque<(usize, Command)>> = Mutex::new(commands.into_iter().enumerate().collect());
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
    let (tell, news) = mpsc::channel();
    let mut failed = Vec::new();
    std::thread::scope(|scope| {
        for _ in 0..at_once.clamp(1, titles.len().max(1)) {
            let (tell, next) = (tell.clone(), &next);
            scope.spawn(move || {
                while let Some((index, mut command)) = next() {
                    // The receiver lives as long as this scope.
                    let _ = tell.send(Said::Started(index));
                    let ended = run_one(&mut command, |line| {
                        let _ = tell.send(Said::Line(index, line));
                    });
                    let _ = tell.send(Said::Ended(index, ended));
                }
            });
        }
        drop(tell);
        let mut running: Vec<Running> = Vec::new();
        let mut heard = Instant::now();
        loop {
            match news.recv_timeout(SILENCE.saturating_sub(heard.elapsed())) {
                Ok(Said::Started(index)) => running.push(Running {
                    index,
                    since: Instant::now(),
                    lines: Vec::new(),
                }),
                Ok(Said::Line(index, line)) => {
                    if let Some(run) = running.iter_mut().find(|run| run.index == index) {
                        run.lines.push(line);
                    }
                }
                Ok(Said::Ended(index, ended)) => {
                    heard = Instant::now();
                    let Some(place) = running.iter().position(|run| run.index == index) else {
                        continue;
                    };
                    let run = running.swap_remove(place);
                    let title = &titles[index];
                    println!(
                        "\n     Running {title}, {:.1} s",
                        run.since.elapsed().as_secs_f64()
                    );
                    run.lines.iter().for_each(|line| on_line(line));
                    match ended {
                        Ok(status) if status.success() => {}
                        Ok(status) => failed.push(format!("{title} ({status})")),
                        Err(error) => failed.push(format!("{title} ({error:#})")),
                    }
                    let _ = std::io::stdout().flush();
                }
                Err(RecvTimeoutError::Timeout) => {
                    heard = Instant::now();
                    for run in &running {
                        eprintln!("{}", still(run, &titles[run.index]));
                    }
                }
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
    });
    failed
}

/// For a program that runs long, or hangs: how long, and the last that it said, which names the test.
fn still(run: &Running, title: &str) -> String {
    let last = run.lines.iter().rev().find(|line| !line.is_empty());
    format!(
        "     Running {title} still, after {} s; it last said: {}",
        run.since.elapsed().as_secs(),
        last.map_or("nothing", String::as_str)
    )
}

/// Runs a command with standard output and error in the order in which they are written.
fn run_one(command: &mut Command, on_line: impl FnMut(String)) -> Result<ExitStatus> {
    let (output, into) = std::io::pipe()?;
    let mut child = command
        .stdout(into.try_clone()?)
        .stderr(into)
        .spawn()
        .with_context(|| format!("{} cannot be started", command.get_program().display()))?;
    // The command keeps its ends of the pipe open, and with them the pipe.
    command
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null());
    lines(output, on_line)?;
    Ok(child.wait()?)
}

fn lines(output: PipeReader, mut on_line: impl FnMut(String)) -> Result<()> {
    let mut output = BufReader::new(output);
    let mut bytes = Vec::new();
    // By bytes, because a test may print what is not UTF-8.
    while output.read_until(b'\n', &mut bytes)? > 0 {
        on_line(
            String::from_utf8_lossy(&bytes)
                .trim_end_matches(['\r', '\n'])
                .to_owned(),
        );
        bytes.clear();
    }
    Ok(())
}

/// Puts those in `first`, by title, before the others, in its order.
fn order(binaries: &mut [Binary], root: &Path, first: &[&str]) -> Result<()> {
    if let Some(missing) = first
        .iter()
        .find(|name| !binaries.iter().any(|binary| binary.title(root) == **name))
    {
        bail!("there is no test program `{missing}` to be run first");
    }
    binaries.sort_by_key(|binary| {
        let title = binary.title(root);
        first
            .iter()
            .position(|name| *name == title)
            .unwrap_or(first.len())
    });
    Ok(())
}

/// Reads one line of cargo's JSON messages; `None` unless it names a test program.
fn binary_of(line: &str) -> Option<Binary> {
    let artifact = program::Artifact::read(line)?;
    if !artifact.is_test {
        return None;
    }
    Some(Binary {
        name: artifact.name,
        folder: artifact.manifest.parent()?.to_path_buf(),
        program: artifact.executable,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary(folder: &str, name: &str) -> Binary {
        Binary {
            name: name.to_owned(),
            folder: Path::new("/r").join(folder),
            program: std::env::current_exe().unwrap(),
        }
    }

    #[test]
    fn test_programs_are_read_from_cargo_messages() {
        let test = r#"{"reason":"compiler-artifact","manifest_path":"/r/host/bake/Cargo.toml","target":{"kind":["test"],"name":"scene"},"profile":{"test":true},"executable":"/t/scene-1"}"#;
        let read = binary_of(test).unwrap();
        assert_eq!(read.title(Path::new("/r")), "host/bake scene");
        assert_eq!(read.program, Path::new("/t/scene-1"));
        assert_eq!(binary_of(&test.replace("\"test\":true", "\"test\":false")), None);
        assert_eq!(binary_of("not JSON"), None);
    }

    #[test]
    fn the_named_ones_come_first_and_must_be_there() {
        let root = Path::new("/r");
        let mut binaries = ["a", "b", "c"].map(|name| binary("p", name));
        order(&mut binaries, root, &["p c", "p b"]).unwrap();
        assert_eq!(binaries.map(|binary| binary.name), ["c", "b", "a"]);
        let missing = order(&mut [binary("q", "c")], root, &["p c"]).unwrap_err();
        assert!(missing.to_string().contains("`p c`"), "{missing}");
    }

    /// This very program stands for two that succeed, one that fails and one that cannot be started.
    #[test]
    fn all_run_to_their_ends_and_the_failed_are_named() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let of = |name: &str| Binary {
            folder: here.to_path_buf(),
            ..binary("", name)
        };
        let lost = Binary {
            program: here.join("no such program"),
            ..of("lost")
        };
        let binaries = [of("good"), of("bad"), lost, of("fine")];
        let mut jobs = binaries.map(|binary| binary.job(here));
        for job in &mut jobs {
            job.command.arg("counts_come_from_result_lines_alone");
        }
        // The second is asked for what it does not know.
        jobs[1].command.arg("--no-such-option");
        let mut counts = crate::test::report::Counts::default();
        let failed = run_all(jobs.into(), 1, |line| counts.add_line(line));
        assert_eq!(failed.len(), 2, "{failed:?}");
        assert!(failed[0].starts_with(" bad (exit status"), "{failed:?}");
        assert!(failed[1].starts_with(" lost ("), "{failed:?}");
        assert_eq!(counts.passed, 2);
    }

    #[test]
    fn a_program_that_runs_long_is_named_with_what_it_said_last() {
        let run = Running {
            index: 0,
            since: Instant::now(),
            lines: vec!["test a ... ok".to_owned(), String::new()],
        };
        let said = still(&run, "host/bake scene");
        assert!(said.contains("host/bake scene still, after 0 s"), "{said}");
        assert!(said.ends_with("it last said: test a ... ok"), "{said}");
    }
}

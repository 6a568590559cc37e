//! Reading in a separate process.
//!
//! The program starts itself again with a request in its environment; the copy detects it in [`init`], reads the file, writes a framed [`postcard`]
//! result to standard output and exits. A frame is eight bytes of magic, the payload's length (64 bits, little-endian) and the payload: any output of
//! the kernel around it is skipped. A query about a shape comes on standard input, preceded by its length. That pipe then stays open for as long as
//! the parent lives: when it closes the copy ends, however the parent ended. On Linux the system also kills the copy when the thread that started it
//! ends; that thread waits here until the copy is gone.
//!
//! Ahead of the answer come reports of the progress: eight other bytes of magic and the parts per million that are done (32 bits, little-endian). A
//! larger number is ignored; of the others the largest is kept.
//!
//! Limits: processor time ([`LoadOptions::time_limit_s`]) and address space, enforced by the system; `PATIENCE` times the processor time, by the
//! parent's clock; and the length of the output.

use crate::assemble::assemble;
use crate::progress::Progress;
use crate::question::{Answer, Question, answer};
use crate::{BrepError, CadModel, LoadOptions, kernel};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::io::{BufReader, Read, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

const PATH_VARIABLE: &str = "MORTISE_BREP_CHILD_PATH";
const REQUEST_VARIABLE: &str = "MORTISE_BREP_CHILD_REQUEST";
const MAGIC: &[u8; 8] = b"\x93MTBREP1";
/// Begins a report of the progress.
const PROGRESS_MAGIC: &[u8; 8] = b"\x93MTBPRG1";
/// What a report states when all is done.
const MILLION: u32 = 1_000_000;
/// Length of the end of the child's standard error that is kept for the message.
const STDERR_TAIL: usize = 4096;
/// Interval at which the parent checks whether the child has ended.
const POLL: Duration = Duration::from_millis(2);

/// Allowed ratio of elapsed time to processor time: other programs need their share of the machine too.
const PATIENCE: u32 = 4;

/// The request in the environment.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Request {
    options: LoadOptions,
    /// Process that sends the request.
    parent: u32,
    /// Whether a [`Question`] is to be read from standard input; else the request is for the model.
    question: bool,
}

static READY: AtomicBool = AtomicBool::new(false);

/// Must be called first in `main` of every program that reads STEP files.
///
/// In the reading process this reads the file and exits; in any other it records that the program can be started again as a reading process.
pub fn init() {
    match (
        std::env::var_os(PATH_VARIABLE),
        std::env::var_os(REQUEST_VARIABLE),
    ) {
        (Some(path), Some(request)) => serve(Path::new(&path), &request),
        _ => READY.store(true, Ordering::Release),
    }
}

/// Whether [`init`] was called, so that reading uses a child process.
pub fn is_ready() -> bool {
    READY.load(Ordering::Acquire)
}

/// The reading process: never returns.
fn serve(path: &Path, request: &OsStr) -> ! {
    let damaged = || process_error(path, "the request is damaged");
    let request = request
        .to_str()
        .and_then(from_hex)
        .and_then(|b| postcard::from_bytes::<Request>(&b).ok());
    let written = match request {
        Some(Request {
            options,
            parent,
            question,
        }) => {
            kernel::end_with_parent(parent);
            kernel::limit_process(options.memory_limit_bytes, options.time_limit_s);
            let question = question.then(|| read_question(std::io::stdin().lock()));
            // Without the thread the system still ends this process when its processor time is used up.
            let _ = thread::Builder::new().spawn(|| end_with_pipe(std::io::stdin().lock()));
            match question {
                None => respond(&assemble(path, &options, &Progress::new(&report))),
                Some(None) => respond(&Err::<(), _>(damaged())),
                Some(Some(question)) => respond(&answer(path, &options, &question)),
            }
        }
        None => respond(&Err::<(), _>(damaged())),
    };
    std::process::exit(if written { 0 } else { 3 })
}

/// Ends this process when the other end of `pipe` is closed, even while the kernel is busy.
fn end_with_pipe(mut pipe: impl Read) {
    // Nothing more is sent, so this returns when the parent is gone.
    let _ = pipe.read(&mut [0]);
    kernel::end_now();
}

fn read_question(mut pipe: impl Read) -> Option<Question> {
    postcard::from_bytes(&payload(&mut pipe)?).ok()
}

/// A payload preceded by its length; `None` when it is incomplete.
fn payload(pipe: &mut impl Read) -> Option<Vec<u8>> {
    let mut length = [0; 8];
    pipe.read_exact(&mut length).ok()?;
    let length = u64::from_le_bytes(length);
    let mut payload = Vec::new();
    (pipe.take(length).read_to_end(&mut payload).ok()? as u64 == length).then_some(payload)
}

/// Writes a report of the progress, 0 to 1.
fn report(fraction: f64) {
    let millionths = (fraction * f64::from(MILLION)) as u32;
    let mut out = std::io::stdout().lock();
    // A broken pipe shows when the answer is written.
    let _ = out
        .write_all(PROGRESS_MAGIC)
        .and_then(|()| out.write_all(&millionths.to_le_bytes()))
        .and_then(|()| out.flush());
}

/// Writes the result as a frame; returns whether that succeeded.
fn respond<T: Serialize>(result: &Result<T, BrepError>) -> bool {
    kernel::flush_output();
    postcard::to_allocvec(result).is_ok_and(|payload| {
        let mut out = std::io::stdout().lock();
        out.write_all(MAGIC)
            .and_then(|()| out.write_all(&(payload.len() as u64).to_le_bytes()))
            .and_then(|()| out.write_all(&payload))
            .and_then(|()| out.flush())
            .is_ok()
    })
}

/// Reads `path` in a child process, which ends when `progress` does.
pub(crate) fn load(
    path: &Path,
    options: &LoadOptions,
    progress: &dyn Fn(f64) -> ControlFlow<()>,
) -> Result<CadModel, BrepError> {
    run(path, options, None, progress)
}

/// Queries a shape of `path` in a child process.
pub(crate) fn ask(path: &Path, options: &LoadOptions, question: &Question) -> Result<Answer, BrepError> {
    let question = postcard::to_allocvec(question).map_err(|e| process_error(path, &e.to_string()))?;
    run(path, options, Some(question), &|_| ControlFlow::Continue(()))
}

fn run<T: DeserializeOwned>(
    path: &Path,
    options: &LoadOptions,
    question: Option<Vec<u8>>,
    progress: &dyn Fn(f64) -> ControlFlow<()>,
) -> Result<T, BrepError> {
    let child = spawn(path, options, question.is_some()).map_err(|e| process_error(path, &e.to_string()))?;
    let mut child = Reader(child);
    // Held until the end: closing it ends the child.
    let _line = child.0.stdin.take().map(|mut pipe| {
        thread::spawn(move || {
            if let Some(question) = question {
                // A child that dies early breaks the pipe; how it ended is reported below.
                let _ = pipe.write_all(&(question.len() as u64).to_le_bytes());
                let _ = pipe.write_all(&question);
            }
            pipe
        })
    });
    let seen = Arc::new(Seen::default());
    let answer_limit = options.answer_limit_bytes;
    let output = child.0.stdout.take().map(|pipe| {
        let seen = Arc::clone(&seen);
        thread::spawn(move || read_answer(pipe, answer_limit, &seen))
    });
    let errors = child
        .0
        .stderr
        .take()
        .map(|pipe| thread::spawn(move || read_tail(pipe)));
    let limit = Duration::from_secs(options.time_limit_s).saturating_mul(PATIENCE);
    let timed_out = || BrepError::TimedOut {
        path: path.display().to_string(),
        seconds: options.time_limit_s,
    };
    let too_long = || BrepError::AnswerTooLong {
        path: path.display().to_string(),
        megabytes: answer_limit >> 20,
    };
    let flooded = || seen.flooded.load(Ordering::Acquire);
    let mut cancelled = false;
    let status = match wait(&mut child.0, limit, || {
        let done = f64::from(seen.millionths.load(Ordering::Relaxed)) / f64::from(MILLION);
        cancelled = progress(done).is_break();
        cancelled || flooded()
    }) {
        Ok(Some(status)) => status,
        Ok(None) if cancelled => {
            return Err(BrepError::Cancelled {
                path: path.display().to_string(),
            });
        }
        Ok(None) if flooded() => return Err(too_long()),
        Ok(None) => return Err(timed_out()),
        Err(e) => return Err(process_error(path, &e.to_string())),
    };
    if used_up_its_time(status) {
        return Err(timed_out());
    }
    let output = output.and_then(|t| t.join().ok()).flatten();
    // The child may end before its answer, still in the pipe, is found to be too long.
    if flooded() {
        return Err(too_long());
    }
    let errors = errors.and_then(|t| t.join().ok()).unwrap_or_default();
    match output {
        Some(payload) => postcard::from_bytes(&payload)
            .unwrap_or_else(|e| Err(process_error(path, &format!("its answer is damaged: {e}")))),
        None => Err(BrepError::Crashed {
            path: path.display().to_string(),
            how: ending(status, &errors),
        }),
    }
}

/// Ends the reading process when dropped.
struct Reader(Child);

impl Drop for Reader {
    fn drop(&mut self) {
        // Both calls fail only when the child is already gone.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn spawn(path: &Path, options: &LoadOptions, question: bool) -> std::io::Result<Child> {
    let request = Request {
        options: options.clone(),
        parent: std::process::id(),
        question,
    };
    let request = postcard::to_allocvec(&request).map_err(std::io::Error::other)?;
    Command::new(program()?)
        .env(PATH_VARIABLE, path)
        .env(REQUEST_VARIABLE, to_hex(&request))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
}

/// This program. On Linux by the link that leads to it even after its file was replaced, as a new build does.
fn program() -> std::io::Result<PathBuf> {
    let link = Path::new("/proc/self/exe");
    if cfg!(target_os = "linux") && link.exists() {
        return Ok(link.to_owned());
    }
    std::env::current_exe()
}

/// `None` when the child is still running after `limit`, or when `ends` says so.
fn wait(
    child: &mut Child,
    limit: Duration,
    mut ends: impl FnMut() -> bool,
) -> std::io::Result<Option<ExitStatus>> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if start.elapsed() >= limit || ends() {
            return Ok(None);
        }
        thread::sleep(POLL);
    }
}

/// What the child's output has shown so far.
#[derive(Default)]
struct Seen {
    /// It is longer than allowed.
    flooded: AtomicBool,
    /// Progress, parts per million.
    millionths: AtomicU32,
}

/// The answer in at most `limit` bytes of output; `None` when it is incomplete, or when there are more bytes.
fn read_answer(pipe: impl Read, limit: u64, seen: &Seen) -> Option<Vec<u8>> {
    let mut pipe = BufReader::new(pipe.take(limit.saturating_add(1)));
    let answer = find_answer(&mut pipe, &seen.millionths);
    // What follows counts as well.
    let _ = std::io::copy(&mut pipe, &mut std::io::sink());
    let flooded = pipe.get_ref().limit() == 0;
    seen.flooded.store(flooded, Ordering::Release);
    answer.filter(|_| !flooded)
}

fn find_answer(pipe: &mut impl Read, millionths: &AtomicU32) -> Option<Vec<u8>> {
    let mut last = [0; MAGIC.len()];
    loop {
        last.rotate_left(1);
        pipe.read_exact(&mut last[MAGIC.len() - 1..]).ok()?;
        if last == *PROGRESS_MAGIC {
            let mut done = [0; 4];
            pipe.read_exact(&mut done).ok()?;
            let done = u32::from_le_bytes(done);
            if done <= MILLION {
                millionths.fetch_max(done, Ordering::Relaxed);
            }
        } else if last == *MAGIC {
            return payload(pipe);
        }
    }
}

fn read_tail(mut pipe: impl Read) -> Vec<u8> {
    let mut tail = Vec::new();
    let mut chunk = [0; STDERR_TAIL];
    while let Ok(n @ 1..) = pipe.read(&mut chunk) {
        tail.extend_from_slice(&chunk[..n]);
        let surplus = tail.len().saturating_sub(STDERR_TAIL);
        tail.drain(..surplus);
    }
    tail
}

/// How the child ended, with the last line it wrote.
fn ending(status: ExitStatus, errors: &[u8]) -> String {
    let how = how(status);
    let errors = String::from_utf8_lossy(errors);
    match errors.lines().rev().map(str::trim).find(|line| !line.is_empty()) {
        Some(line) => format!("{how}: {line}"),
        None => how,
    }
}

/// Whether the system ended the process because its processor time was used up.
fn used_up_its_time(status: ExitStatus) -> bool {
    #[cfg(unix)]
    {
        // SIGXCPU on Linux and macOS.
        std::os::unix::process::ExitStatusExt::signal(&status) == Some(24)
    }
    #[cfg(not(unix))]
    {
        let _ = status;
        false
    }
}

#[cfg(unix)]
fn how(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt;
    match status.signal() {
        Some(4) => "illegal instruction".into(),
        Some(6) => "aborted".into(),
        Some(8) => "arithmetic fault".into(),
        Some(9) => "killed, perhaps because memory ran out".into(),
        Some(7 | 11) => "memory access fault".into(),
        Some(signal) => format!("signal {signal}"),
        None => status.to_string(),
    }
}

#[cfg(not(unix))]
fn how(status: ExitStatus) -> String {
    status.to_string()
}

fn process_error(path: &Path, reason: &str) -> BrepError {
    BrepError::Process {
        path: path.display().to_string(),
        reason: reason.into(),
    }
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn from_hex(text: &str) -> Option<Vec<u8>> {
    let digits = text.as_bytes().chunks(2);
    digits
        .map(|d| u8::from_str_radix(std::str::from_utf8(d).ok()?, 16).ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(output: &[u8], limit: u64) -> (Option<Vec<u8>>, Seen) {
        let seen = Seen::default();
        (read_answer(output, limit, &seen), seen)
    }

    #[test]
    fn a_frame_is_found_amid_what_the_kernel_prints() {
        let answer = |output: &[u8]| read(output, 1000).0;
        let mut output = b"*** ERR ***\n".to_vec();
        output.extend_from_slice(MAGIC);
        output.extend_from_slice(&3u64.to_le_bytes());
        output.extend_from_slice(b"abc");
        assert_eq!(answer(&output).as_deref(), Some(&b"abc"[..]));
        output.extend_from_slice(b"bye\n");
        assert_eq!(answer(&output).as_deref(), Some(&b"abc"[..]));
        assert_eq!(answer(&output[..output.len() - 5]), None);
        assert_eq!(answer(b"nothing"), None);
    }

    /// Noise, a report cut off by the end and an impossible one change nothing; what looks like a report within the answer is part of it.
    #[test]
    fn the_largest_report_ahead_of_the_answer_is_kept() {
        let report = |done: u32| [&PROGRESS_MAGIC[..], &done.to_le_bytes()].concat();
        let answer = [report(900_000), b"abc".to_vec()].concat();
        let length = (answer.len() as u64).to_le_bytes();
        let reports = [
            report(250_000),
            b"*** ERR".to_vec(),
            report(200_000),
            report(MILLION + 1),
        ]
        .concat();
        let output = [&reports, &MAGIC[..], &length, &answer].concat();
        let (found, seen) = read(&output, 1000);
        assert_eq!(found, Some(answer));
        assert_eq!(seen.millionths.into_inner(), 250_000);
        let (found, seen) = read(&[report(3), report(7)[..11].to_vec()].concat(), 1000);
        assert_eq!((found, seen.millionths.into_inner()), (None, 3));
    }

    #[test]
    fn a_request_survives_the_environment() {
        let request = Request {
            options: LoadOptions {
                linear_deflection_mm: Some(0.125),
                max_parts: 7,
                ..LoadOptions::default()
            },
            parent: 1,
            question: true,
        };
        let bytes = from_hex(&to_hex(&postcard::to_allocvec(&request).unwrap())).unwrap();
        assert_eq!(postcard::from_bytes::<Request>(&bytes).unwrap(), request);
    }

    #[test]
    fn an_answer_that_is_too_long_is_cut_off() {
        let output = [&MAGIC[..], &4u64.to_le_bytes(), b"abcd"].concat();
        for (limit, cut_off) in [(20, false), (19, true), (9, true)] {
            let (answer, seen) = read(&output, limit);
            assert_eq!((answer.is_none(), seen.flooded.into_inner()), (cut_off, cut_off));
        }
        // Noise without end.
        let seen = Seen::default();
        assert_eq!(read_answer(std::io::repeat(7), 100, &seen), None);
        assert!(seen.flooded.into_inner());
    }

    #[test]
    fn only_the_end_of_a_flood_is_kept() {
        let flood = [vec![b'x'; 100_000], b"last".to_vec()].concat();
        let tail = read_tail(&flood[..]);
        assert_eq!(tail.len(), STDERR_TAIL);
        assert!(tail.ends_with(b"last"));
    }
}

//! Reading in a separate process.
//!
//! The program starts itself again with a request in its environment; the copy detects it in [`init`], reads the file, writes a framed [`postcard`]
//! result to standard output and exits. A frame is eight bytes of magic, the payload's length (64 bits, little-endian) and the payload: any output of
//! the kernel around it is skipped. A query about a shape comes on standard input, preceded by its length. That pipe then stays open for as long as
//! the parent lives: when it closes the copy ends, however the parent ended. On Linux the system also kills the copy when the thread that started it
//! ends; that thread waits here until the copy is gone.
//!
//! Limits: processor time ([`LoadOptions::time_limit_s`]) and address space, enforced by the system; `PATIENCE` times the processor time, by the
//! parent's clock; and the length of the answer.

use crate::assemble::assemble;
use crate::question::{Answer, Question, answer};
use crate::{BrepError, CadModel, LoadOptions, kernel};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

const PATH_VARIABLE: &str = "MORTISE_BREP_CHILD_PATH";
const REQUEST_VARIABLE: &str = "MORTISE_BREP_CHILD_REQUEST";
const MAGIC: &[u8; 8] = b"\x93MTBREP1";
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
                None => respond(&assemble(path, &options)),
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
    let mut length = [0; 8];
    pipe.read_exact(&mut length).ok()?;
    let mut question = Vec::new();
    let length = u64::from_le_bytes(length);
    (pipe.take(length).read_to_end(&mut question).ok()? as u64 == length)
        .then(|| postcard::from_bytes(&question).ok())
        .flatten()
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

/// Reads `path` in a child process, which ends when `cancel` is set.
pub(crate) fn load(path: &Path, options: &LoadOptions, cancel: &AtomicBool) -> Result<CadModel, BrepError> {
    run(path, options, None, cancel)
}

/// Queries a shape of `path` in a child process.
pub(crate) fn ask(path: &Path, options: &LoadOptions, question: &Question) -> Result<Answer, BrepError> {
    let question = postcard::to_allocvec(question).map_err(|e| process_error(path, &e.to_string()))?;
    run(path, options, Some(question), &AtomicBool::new(false))
}

fn run<T: DeserializeOwned>(
    path: &Path,
    options: &LoadOptions,
    question: Option<Vec<u8>>,
    cancel: &AtomicBool,
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
    let flooded = Arc::new(AtomicBool::new(false));
    let answer_limit = options.answer_limit_bytes;
    let output = child.0.stdout.take().map(|pipe| {
        let flooded = Arc::clone(&flooded);
        thread::spawn(move || read_answer(pipe, answer_limit, &flooded))
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
    let status = match wait(&mut child.0, limit, &[&flooded, cancel]) {
        Ok(Some(status)) => status,
        Ok(None) if cancel.load(Ordering::Acquire) => {
            return Err(BrepError::Cancelled {
                path: path.display().to_string(),
            });
        }
        Ok(None) if flooded.load(Ordering::Acquire) => return Err(too_long()),
        Ok(None) => return Err(timed_out()),
        Err(e) => return Err(process_error(path, &e.to_string())),
    };
    if used_up_its_time(status) {
        return Err(timed_out());
    }
    let output = output.and_then(|t| t.join().ok()).unwrap_or_default();
    // The child may end before its answer, still in the pipe, is found to be too long.
    if flooded.load(Ordering::Acquire) {
        return Err(too_long());
    }
    let errors = errors.and_then(|t| t.join().ok()).unwrap_or_default();
    match payload(&output) {
        Some(payload) => postcard::from_bytes(payload)
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
    Command::new(std::env::current_exe()?)
        .env(PATH_VARIABLE, path)
        .env(REQUEST_VARIABLE, to_hex(&request))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
}

/// `None` when the child is still running after `limit`, or when one of `ends` is set.
fn wait(child: &mut Child, limit: Duration, ends: &[&AtomicBool]) -> std::io::Result<Option<ExitStatus>> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if start.elapsed() >= limit || ends.iter().any(|end| end.load(Ordering::Acquire)) {
            return Ok(None);
        }
        thread::sleep(POLL);
    }
}

/// At most `limit` bytes; sets `flooded` when there are more.
fn read_answer(pipe: impl Read, limit: u64, flooded: &AtomicBool) -> Vec<u8> {
    let mut bytes = Vec::new();
    // A broken pipe gives an incomplete frame, which is rejected later.
    let _ = pipe.take(limit.saturating_add(1)).read_to_end(&mut bytes);
    if bytes.len() as u64 > limit {
        flooded.store(true, Ordering::Release);
        bytes.clear();
    }
    bytes
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

fn payload(output: &[u8]) -> Option<&[u8]> {
    let start = output.windows(MAGIC.len()).position(|w| w == MAGIC)? + MAGIC.len();
    let length = output.get(start..start + 8)?;
    let length = usize::try_from(u64::from_le_bytes(length.try_into().ok()?)).ok()?;
    output.get(start + 8..)?.get(..length)
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

    #[test]
    fn a_frame_is_found_amid_what_the_kernel_prints() {
        let mut output = b"*** ERR ***\n".to_vec();
        output.extend_from_slice(MAGIC);
        output.extend_from_slice(&3u64.to_le_bytes());
        output.extend_from_slice(b"abc");
        assert_eq!(payload(&output), Some(&b"abc"[..]));
        output.extend_from_slice(b"bye\n");
        assert_eq!(payload(&output), Some(&b"abc"[..]));
        assert_eq!(payload(&output[..output.len() - 5]), None);
        assert_eq!(payload(b"nothing"), None);
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
        let flooded = AtomicBool::new(false);
        assert_eq!(read_answer(&[7; 100][..], 100, &flooded), [7; 100]);
        assert!(!flooded.load(Ordering::Acquire));
        assert!(read_answer(std::io::repeat(7), 100, &flooded).is_empty());
        assert!(flooded.load(Ordering::Acquire));
    }

    #[test]
    fn only_the_end_of_a_flood_is_kept() {
        let flood = [vec![b'x'; 100_000], b"last".to_vec()].concat();
        let tail = read_tail(&flood[..]);
        assert_eq!(tail.len(), STDERR_TAIL);
        assert!(tail.ends_with(b"last"));
    }
}

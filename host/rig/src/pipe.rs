//! An in-memory byte pipe that behaves like a serial port: bounded, blocking with a timeout, closed when an end is dropped.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::transport::READ_WAIT;

/// Capacity of a pipe in bytes; a writer waits when it is full.
pub const PIPE_CAPACITY: usize = 64 * 1024;

#[derive(Debug, Default)]
struct Bytes {
    waiting: VecDeque<u8>,
    closed: bool,
}

type Shared = Arc<(Mutex<Bytes>, Condvar)>;

/// Reading end.
#[derive(Debug)]
pub struct PipeReader(Shared);

/// Writing end.
#[derive(Debug)]
pub struct PipeWriter(Shared);

/// Creates a pipe.
pub fn pipe() -> (PipeWriter, PipeReader) {
    let shared = Shared::default();
    (PipeWriter(shared.clone()), PipeReader(shared))
}

fn lock(shared: &Shared) -> MutexGuard<'_, Bytes> {
    shared.0.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Waits until `ready` or `timeout`.
fn wait<'s>(
    shared: &'s Shared,
    timeout: Duration,
    blocked: impl FnMut(&mut Bytes) -> bool,
) -> MutexGuard<'s, Bytes> {
    shared
        .1
        .wait_timeout_while(lock(shared), timeout, blocked)
        .map(|(bytes, _)| bytes)
        .unwrap_or_else(|poisoned| poisoned.into_inner().0)
}

fn close(shared: &Shared) {
    lock(shared).closed = true;
    shared.1.notify_all();
}

impl PipeReader {
    /// Takes the available bytes, waiting for them at most `timeout`. `Ok(0)`: the writer is gone and nothing is left.
    pub fn read_within(&mut self, out: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut bytes = wait(&self.0, timeout, |bytes| {
            bytes.waiting.is_empty() && !bytes.closed
        });
        if bytes.waiting.is_empty() {
            return if bytes.closed {
                Ok(0)
            } else {
                Err(io::ErrorKind::TimedOut.into())
            };
        }
        let count = out.len().min(bytes.waiting.len());
        for (place, byte) in out.iter_mut().zip(bytes.waiting.drain(..count)) {
            *place = byte;
        }
        drop(bytes);
        self.0.1.notify_all();
        Ok(count)
    }
}

impl Read for PipeReader {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.read_within(out, READ_WAIT)
    }
}

impl PipeWriter {
    /// Writes as many bytes as there is space for, waiting for space at most `timeout`; `TimedOut` when there is none.
    pub fn write_within(&mut self, data: &[u8], timeout: Duration) -> io::Result<usize> {
        let mut bytes = wait(&self.0, timeout, |bytes| {
            bytes.waiting.len() >= PIPE_CAPACITY && !bytes.closed
        });
        if bytes.closed {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let count = data.len().min(PIPE_CAPACITY.saturating_sub(bytes.waiting.len()));
        if count == 0 && !data.is_empty() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        bytes.waiting.extend(&data[..count]);
        drop(bytes);
        self.0.1.notify_all();
        Ok(count)
    }
}

impl Write for PipeWriter {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        self.write_within(data, READ_WAIT)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for PipeReader {
    fn drop(&mut self) {
        close(&self.0);
    }
}

impl Drop for PipeWriter {
    fn drop(&mut self) {
        close(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_out_as_they_went_in_then_the_end() {
        let (mut writer, mut reader) = pipe();
        assert_eq!(writer.write(b"abc").expect("room"), 3);
        drop(writer);
        let mut out = [0; 8];
        assert_eq!(reader.read(&mut out).expect("bytes"), 3);
        assert_eq!(&out[..3], b"abc");
        assert_eq!(reader.read(&mut out).expect("end"), 0);
    }

    #[test]
    fn a_full_pipe_takes_no_more() {
        let (mut writer, reader) = pipe();
        let much = vec![1u8; 2 * PIPE_CAPACITY];
        assert_eq!(writer.write(&much).expect("room"), PIPE_CAPACITY);
        assert_eq!(
            writer.write(&much).map_err(|e| e.kind()),
            Err(io::ErrorKind::TimedOut)
        );
        drop(reader);
        assert_eq!(
            writer.write(&much).map_err(|e| e.kind()),
            Err(io::ErrorKind::BrokenPipe)
        );
    }
}

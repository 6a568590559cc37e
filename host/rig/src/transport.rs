//! The byte stream under the protocol: two ends, and the objects that must live as long as they do.

use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

/// Longest time that `read` blocks before it returns [`io::ErrorKind::TimedOut`]: bounds the reader's reaction to a request to end.
pub const READ_WAIT: Duration = Duration::from_millis(50);

/// Longest time without progress of a write before the link counts as stalled.
const WRITE_WAIT: Duration = Duration::from_secs(2);

/// A byte stream to a board.
///
/// `reader.read` returns within about [`READ_WAIT`], with `TimedOut` or `WouldBlock` when no bytes came; `Ok(0)` or another error means
/// that the other end is gone. `keep` is dropped after both: a child process, a thread.
pub struct Transport {
    /// Bytes from the board.
    pub reader: Box<dyn Read + Send>,
    /// Bytes to the board.
    pub writer: Box<dyn Write + Send>,
    /// Dropped after reader and writer.
    pub keep: Option<Box<dyn Send + Sync>>,
}

/// Whether the error only means that no bytes came; the stream is intact.
pub(crate) fn is_quiet(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
    )
}

/// Writes all of `bytes`, with as many writes as necessary: a port's own timeout must not cut a frame in two while the board still takes
/// bytes.
pub(crate) fn write_whole(writer: &mut dyn Write, mut bytes: &[u8]) -> io::Result<()> {
    let mut progress = Instant::now();
    while !bytes.is_empty() {
        match writer.write(bytes) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(written) => {
                bytes = &bytes[written..];
                progress = Instant::now();
            }
            Err(error) if is_quiet(&error) => {
                if progress.elapsed() > WRITE_WAIT {
                    return Err(io::Error::new(
                        io::ErrorKind::TimedOut,
                        "the board no longer takes bytes",
                    ));
                }
            }
            Err(error) => return Err(error),
        }
    }
    // No flush: on a serial port it waits until the board has taken every byte, which never ends if the board stalls.
    Ok(())
}

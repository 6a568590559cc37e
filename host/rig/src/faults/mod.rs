//! A link with deliberate faults: frames lost, damaged, repeated, reordered or late; pauses, cuts and floods. It sits between client and
//! any board.
//!
//! A [`FaultLine`] sits in the byte stream and works on whole frames, with one thread per direction. It does nothing until
//! [`FaultLine::begin`], so that a scene can be uploaded first, and nothing after [`FaultLine::end`].
//!
//! **Time** is the wall clock's. For a board in lockstep it is the number of released ticks, so that equal seeds give equal runs. In that
//! case the messages that make up the clock (`Lockstep`, `Run`, `Ran`) pass unharmed, and a waiting frame is delivered with the next of
//! them: late by up to one batch of ticks. By the wall clock, a waiting frame from the board may be up to [`crate::READ_WAIT`] later still,
//! if no other frame comes.
//!
//! Messages of the board are **overheard** before they are harmed: a measurement sees every sample, whatever the client receives.

mod inputs;
mod pump;
mod settings;
mod shared;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, PoisonError};
use std::thread::JoinHandle;

use mortise_protocol::message::FromDevice;

use crate::error::RigError;
use crate::pipe::pipe;
use crate::transport::Transport;
pub use inputs::{InputFault, InputFaultName};
use pump::{Pump, from_board, to_board};
pub use settings::{Faults, Window};
use shared::Shared;

/// Number of frames affected, both directions together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCounts {
    /// Frames that were subject to faults.
    pub frames: u64,
    /// Frames lost, at random or in a cut.
    pub lost: u64,
    /// Frames damaged.
    pub corrupted: u64,
    /// Sent twice.
    pub repeated: u64,
    /// Frames overtaken by another.
    pub reordered: u64,
    /// Frames delivered late.
    pub late: u64,
    /// Spurious frames.
    pub flooded: u64,
}

impl FaultCounts {
    /// Difference to the earlier counts `before`.
    pub fn since(&self, before: &Self) -> Self {
        Self {
            frames: self.frames - before.frames,
            lost: self.lost - before.lost,
            corrupted: self.corrupted - before.corrupted,
            repeated: self.repeated - before.repeated,
            reordered: self.reordered - before.reordered,
            late: self.late - before.late,
            flooded: self.flooded - before.flooded,
        }
    }
}

/// Handle of the faults in a link. Clones refer to the same line.
#[derive(Clone, Debug, Default)]
pub struct FaultLine(Arc<Shared>);

impl FaultLine {
    /// Inserts the line into a byte stream. A line serves one stream.
    ///
    /// # Errors
    /// `Thread`.
    pub fn into_stream(&self, stream: Transport) -> Result<Transport, RigError> {
        let Transport { reader, writer, keep } = stream;
        let (to_line, from_client) = pipe();
        let (to_client, from_line) = pipe();
        let spawn = |name: &str, run: Box<dyn FnOnce() + Send>| {
            (std::thread::Builder::new().name(name.into()).spawn(run)).map_err(RigError::Thread)
        };
        let pump = Pump::new(self.0.clone(), writer, to_board, 0);
        let to = spawn(
            "mortise-faults-to",
            Box::new(move || {
                let mut from_client = from_client;
                pump.run(&mut |out, wait| from_client.read_within(out, wait));
            }),
        )?;
        let pump = Pump::new(self.0.clone(), Box::new(to_client), from_board, 1);
        let from = spawn(
            "mortise-faults-from",
            Box::new(move || {
                let mut reader = reader;
                // The board's stream has its own wait.
                pump.run(&mut |out, _| reader.read(out));
            }),
        )?;
        Ok(Transport {
            reader: Box::new(from_line),
            writer: Box::new(to_line),
            keep: Some(Box::new(Running {
                shared: self.0.clone(),
                threads: vec![to, from],
                _keep: keep,
            })),
        })
    }

    /// Activates `faults` from the next frame on in each direction; their time begins.
    pub fn begin(&self, faults: &Faults) {
        self.end();
        *self.0.faults.lock().unwrap_or_else(PoisonError::into_inner) = faults.clone();
        self.0.epoch.fetch_add(1, Ordering::SeqCst);
    }

    /// Deactivates all faults from the next frame on. Held-back frames are delivered first.
    pub fn end(&self) {
        let epoch = self.0.epoch.load(Ordering::SeqCst);
        self.0.epoch.store(epoch.next_multiple_of(2), Ordering::SeqCst);
    }

    /// Counts since the line was made.
    pub fn counts(&self) -> FaultCounts {
        let of = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let line = &*self.0;
        FaultCounts {
            frames: of(&line.frames),
            lost: of(&line.lost),
            corrupted: of(&line.corrupted),
            repeated: of(&line.repeated),
            reordered: of(&line.reordered),
            late: of(&line.late),
            flooded: of(&line.flooded),
        }
    }

    /// Telemetry and faults that the board reported since [`FaultLine::begin`] or the last call, harmed or not.
    pub fn overheard(&self) -> Vec<FromDevice> {
        std::mem::take(&mut self.0.overheard.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Ends the threads, then drops what the stream kept alive.
struct Running {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    _keep: Option<Box<dyn Send + Sync>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // A panic there has been reported as a lost link.
            let _ = thread.join();
        }
    }
}

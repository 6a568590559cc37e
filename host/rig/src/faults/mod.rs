//! A link that fails on purpose: frames lost, damaged, repeated, out of order or late; pauses, cuts and floods. Between client and board,
//! whichever rig it is.
//!
//! A [`FaultLine`] sits in the byte stream and works on whole frames, each direction on a thread of its own. It does nothing until
//! [`FaultLine::begin`], so that a scene gets onto the board first, and nothing any more after [`FaultLine::end`].
//!
//! **Time** is the wall clock's; of a board in lockstep it is the ticks that were released, so that equal seeds give equal runs there. Then the
//! messages that are the clock (`Lockstep`, `Run`, `Ran`) pass unharmed, and a frame that waits is handed on with the next of them: late to the
//! end of a batch of ticks. By the wall clock, a frame from the board that waits may be [`crate::READ_WAIT`] later still, if nothing else comes.
//!
//! What the board says is **overheard** before it is harmed: who measures sees every sample, whatever the client gets.

mod inputs;
mod pump;

use std::io;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use mortise_protocol::message::{FromDevice, ToDevice};
use serde::Deserialize;

use crate::error::RigError;
use crate::pipe::pipe;
use crate::transport::Transport;
pub use inputs::{InputFault, InputFaultName};
use pump::{Pump, from_board, to_board};

/// What goes wrong. The default is nothing. Shares are of frames, 0 to 1, and hold in both directions.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Faults {
    /// Equal seeds, equal faults.
    pub seed: u64,
    /// Share that is lost.
    pub drop: f64,
    /// Share in which up to three bits are flipped.
    pub corrupt: f64,
    /// Share that comes twice.
    pub repeat: f64,
    /// Share that comes after the next one (50 ms later when none comes).
    pub reorder: f64,
    /// Every frame is late by as much, drawn evenly between both, ms.
    pub delay_ms: [u32; 2],
    /// Pauses: what is under way comes when they end, all at once.
    pub stall: Vec<Window>,
    /// Cuts: what is under way is lost.
    pub disconnect: Vec<Window>,
    /// Frames in a second that nobody sent: to the board noise or heartbeats, from it noise.
    pub flood_per_s: u32,
    /// What goes wrong at the board's inputs, where they are simulated.
    pub inputs: Vec<InputFault>,
}

/// A time, counted from [`FaultLine::begin`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// When it begins, ms.
    pub at_ms: u64,
    /// How long it lasts, ms.
    pub for_ms: u64,
}

impl Window {
    fn holds(&self, now_ms: u64) -> bool {
        now_ms >= self.at_ms && now_ms - self.at_ms < self.for_ms
    }
}

impl Faults {
    /// What is wrong with the numbers, in words.
    ///
    /// # Errors
    /// A share that is none, or a delay that ends before it begins.
    pub fn check(&self) -> Result<(), String> {
        for (name, share) in [
            ("drop", self.drop),
            ("corrupt", self.corrupt),
            ("repeat", self.repeat),
            ("reorder", self.reorder),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return Err(format!("{name} = {share} is no share: 0 to 1"));
            }
        }
        let [from, to] = self.delay_ms;
        if from > to {
            return Err(format!(
                "delay_ms: from {from} to {to} is none; the smaller comes first"
            ));
        }
        inputs::message(&self.inputs).map(|_| ())
    }

    /// The message that lets the simulated board's inputs fail; sent when their time is to begin. The line does not send it.
    ///
    /// # Errors
    /// As [`Faults::check`].
    pub fn input_message(&self) -> Result<ToDevice, String> {
        inputs::message(&self.inputs)
    }

    fn stalled(&self, now_ms: u64) -> bool {
        self.stall.iter().any(|window| window.holds(now_ms))
    }

    fn is_cut(&self, now_ms: u64) -> bool {
        self.disconnect.iter().any(|window| window.holds(now_ms))
    }
}

/// What was done to the frames, both directions together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCounts {
    /// Frames that could be harmed.
    pub frames: u64,
    /// Lost, by chance or in a cut.
    pub lost: u64,
    /// Damaged.
    pub corrupted: u64,
    /// Sent twice.
    pub repeated: u64,
    /// Let pass by another.
    pub reordered: u64,
    /// Handed on later than they came.
    pub late: u64,
    /// Made up.
    pub flooded: u64,
}

impl FaultCounts {
    /// What came after `before`.
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

/// Handle of the faults in a link. Clones are the same line.
#[derive(Clone, Debug, Default)]
pub struct FaultLine(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    faults: Mutex<Faults>,
    /// Odd while faults act.
    epoch: AtomicU32,
    lockstep: AtomicBool,
    /// Ticks released so far.
    released: AtomicU64,
    closing: AtomicBool,
    overheard: Mutex<Vec<FromDevice>>,
    frames: AtomicU64,
    lost: AtomicU64,
    corrupted: AtomicU64,
    repeated: AtomicU64,
    reordered: AtomicU64,
    late: AtomicU64,
    flooded: AtomicU64,
}

impl FaultLine {
    /// Puts the line into a byte stream. A line is for one stream.
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
                // A board's stream has a wait of its own.
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

    /// From the next frame on, in each direction, `faults` act; their time begins.
    pub fn begin(&self, faults: &Faults) {
        self.end();
        *self.0.faults.lock().unwrap_or_else(PoisonError::into_inner) = faults.clone();
        self.0.epoch.fetch_add(1, Ordering::SeqCst);
    }

    /// From the next frame on none do. What was held back is handed on first.
    pub fn end(&self) {
        let epoch = self.0.epoch.load(Ordering::SeqCst);
        self.0.epoch.store(epoch.next_multiple_of(2), Ordering::SeqCst);
    }

    /// What was done since the line was made.
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

    /// Telemetry and faults that the board told since [`FaultLine::begin`] or since asked last, harmed or not.
    pub fn overheard(&self) -> Vec<FromDevice> {
        std::mem::take(&mut self.0.overheard.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Ends the threads, then lets go of what the stream kept alive.
struct Running {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    _keep: Option<Box<dyn Send + Sync>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // A panic there has shown as a lost link.
            let _ = thread.join();
        }
    }
}

/// A read that brought nothing, or the end of the stream.
fn read_some(result: io::Result<usize>) -> Option<usize> {
    match result {
        Ok(0) => None,
        Ok(count) => Some(count),
        Err(error) if crate::transport::is_quiet(&error) => Some(0),
        Err(_) => None,
    }
}

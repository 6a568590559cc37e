//! The recorder: observes a link and writes on its own thread, so that neither the link nor the window waits for a disk.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use mortise_protocol::message::{FromDevice, Inputs, ToDevice};
use mortise_protocol::parameter::PARAMETERS;
use mortise_rig::{Client, Observer, RigError};

use crate::columns::Ticks;
use crate::error::RecordError;
use crate::file::RecordFile;

/// Time after which what was recorded is in the system's hands. With the time a message waits for the thread it bounds the loss of a killed program.
const FLUSH: Duration = Duration::from_millis(200);
/// Ticks after which a chunk ends, and most in a message: those of [`FLUSH`], also where a board in lockstep runs ahead of the clock.
const TICKS: usize = 200;
/// Most messages of the board in the queue: about two seconds of all that it sends.
const WAITING: usize = 4096;
/// Longest time that a message of the board waits for a place in the queue; then it is lost and counted. In lockstep the board sends faster than a disk
/// may take it, and waits; in real time the queue holds seconds.
const PATIENCE: Duration = Duration::from_millis(100);

enum Item {
    Sent(u64, u16, ToDevice),
    Received(u64, u16, FromDevice),
    Scene(Vec<u8>),
    End,
}

/// What a recording holds at its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The file.
    pub path: PathBuf,
    /// Ticks whose inputs it holds.
    pub ticks: u64,
    /// Ticks that the link lost.
    pub lost_ticks: u64,
    /// Messages lost because this computer was too slow.
    pub lost_messages: u64,
}

/// A recording in progress. Dropped, it ends like by [`Self::finish`].
pub struct Recorder {
    path: PathBuf,
    items: Sender<Item>,
    thread: Option<JoinHandle<Result<Written, RecordError>>>,
}

/// Counts of the queue between the link and the recording's thread.
#[derive(Default)]
struct Counts {
    /// Messages of the board in the queue.
    waiting: AtomicUsize,
    /// Messages of the board for which it had no place.
    lost: AtomicU64,
    /// The thread has ended and takes nothing more.
    ended: AtomicBool,
}

struct Tap {
    items: Sender<Item>,
    counts: Arc<Counts>,
}

impl Observer for Tap {
    /// Never waits, however slow the disk is: STOP passes here.
    fn sent(&self, sequence: u16, message: &ToDevice) {
        // Scenes are attached whole, and heartbeats say nothing.
        if !matches!(message, ToDevice::SceneChunk { .. } | ToDevice::Heartbeat) {
            // A thread that has ended with an error reports it in `finish`.
            let _ = self.items.send(Item::Sent(now_ns(), sequence, message.clone()));
        }
    }

    fn received(&self, sequence: u16, message: &FromDevice) {
        if matches!(message, FromDevice::Log(_)) {
            return;
        }
        let begun = Instant::now();
        while self.counts.waiting.load(Ordering::Acquire) >= WAITING {
            if self.counts.ended.load(Ordering::Acquire) || begun.elapsed() > PATIENCE {
                self.counts.lost.fetch_add(1, Ordering::Relaxed);
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.counts.waiting.fetch_add(1, Ordering::AcqRel);
        let _ = self
            .items
            .send(Item::Received(now_ns(), sequence, message.clone()));
    }
}

impl Recorder {
    /// Starts to record everything that crosses the link of `client`, to a new file. Begins with the board's capabilities, description and
    /// parameters, which a replay needs. Telemetry is recorded at the rate at which the program has the board send it.
    ///
    /// # Errors
    /// `Write` when the file cannot be made or exists; `Rig` when the board does not answer.
    pub fn start(client: &Client, path: &Path) -> Result<Self, RecordError> {
        let file = RecordFile::create(path, client.name())?;
        let (items, queue) = channel();
        let counts = Arc::new(Counts::default());
        let thread = std::thread::Builder::new()
            .name("mortise-record".into())
            .spawn({
                let counts = counts.clone();
                move || {
                    let written = write(file, &queue, &counts);
                    counts.ended.store(true, Ordering::Release);
                    written
                }
            })
            .map_err(|error| RecordError::Rig(RigError::Thread(error)))?;
        let recorder = Self {
            path: path.to_owned(),
            items: items.clone(),
            thread: Some(thread),
        };
        client.observe(Some(Arc::new(Tap { items, counts })));
        if let Err(error) = introduce(client) {
            client.observe(None);
            drop(recorder);
            // Nothing was recorded; the error says why.
            let _ = std::fs::remove_file(path);
            return Err(error.into());
        }
        Ok(recorder)
    }

    /// Attaches the image of a scene that the board uses: a replay needs it. Attached once, however often it is given.
    pub fn scene(&self, image: &[u8]) {
        let _ = self.items.send(Item::Scene(image.to_owned()));
    }

    /// Ends the recording; `client` is the one it was started with, where it is still there.
    ///
    /// # Errors
    /// `Write` when not everything could be written; the file then holds what was written before.
    pub fn finish(mut self, client: Option<&Client>) -> Result<Written, RecordError> {
        if let Some(client) = client {
            // A lost link has stopped them already.
            let _ = client.request(ToDevice::RecordInputs(false));
            client.observe(None);
        }
        self.end()
    }

    fn end(&mut self) -> Result<Written, RecordError> {
        let _ = self.items.send(Item::End);
        let failed = || RecordError::Write {
            path: self.path.clone(),
            why: "its thread has failed".into(),
        };
        let thread = self.thread.take().ok_or_else(failed)?;
        thread.join().map_err(|_| failed())?
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if self.thread.is_some() {
            // Nobody is left to report an error to.
            let _ = self.end();
        }
    }
}

/// Has the board say what a replay must know; the observer records the answers.
fn introduce(client: &Client) -> Result<(), RigError> {
    client.refresh_capabilities()?;
    client.rig()?;
    for row in PARAMETERS {
        client.parameter(row.id)?;
    }
    client.request(ToDevice::RecordInputs(true))
}

/// Nanoseconds since 1970, as in the file.
fn now_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

/// Writes items until the end, or until all senders are gone.
fn write(mut file: RecordFile, queue: &Receiver<Item>, counts: &Counts) -> Result<Written, RecordError> {
    let mut pending = Pending::default();
    let mut flushed = Instant::now();
    loop {
        let item = queue.recv_timeout(FLUSH.saturating_sub(flushed.elapsed()));
        if matches!(item, Ok(Item::Received(..))) {
            counts.waiting.fetch_sub(1, Ordering::AcqRel);
        }
        match item {
            Ok(Item::Sent(at, sequence, message)) => file.sent(at, sequence, &message)?,
            Ok(Item::Received(at, _, FromDevice::Inputs(inputs))) => pending.add(at, &inputs, &mut file)?,
            Ok(Item::Received(at, sequence, message)) => file.received(at, sequence, &message)?,
            Ok(Item::Scene(image)) => file.scene(now_ns(), &image)?,
            Ok(Item::End) | Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {}
        }
        if flushed.elapsed() >= FLUSH || pending.full() {
            pending.write(&mut file)?;
            file.flush()?;
            flushed = Instant::now();
        }
    }
    pending.write(&mut file)?;
    let lost_messages = counts.lost.load(Ordering::Relaxed);
    let path = file.finish(lost_messages)?;
    Ok(Written {
        path,
        ticks: pending.written,
        lost_ticks: pending.lost,
        lost_messages,
    })
}

/// Ticks collected for the next message.
#[derive(Default)]
struct Pending {
    at_ns: u64,
    ticks: Option<Ticks>,
    written: u64,
    lost: u64,
}

impl Pending {
    fn add(&mut self, at_ns: u64, inputs: &Inputs, file: &mut RecordFile) -> Result<(), RecordError> {
        self.lost = self.lost.max(inputs.lost.into());
        let follows = self.ticks.as_ref().is_none_or(|ticks| {
            ticks.inputs.len() + inputs.ticks.len() <= TICKS
                && ticks.first_tick.wrapping_add(ticks.inputs.len() as u32) == inputs.first_tick
                && (ticks.count, ticks.lost) == (inputs.count, inputs.lost)
        });
        if !follows {
            self.write(file)?;
        }
        let ticks = self.ticks.get_or_insert_with(|| {
            self.at_ns = at_ns;
            Ticks {
                first_tick: inputs.first_tick,
                count: inputs.count,
                lost: inputs.lost,
                inputs: Vec::with_capacity(TICKS),
            }
        });
        ticks.inputs.extend_from_slice(&inputs.ticks);
        Ok(())
    }

    fn full(&self) -> bool {
        (self.ticks.as_ref()).is_some_and(|ticks| ticks.inputs.len() >= TICKS)
    }

    fn write(&mut self, file: &mut RecordFile) -> Result<(), RecordError> {
        if let Some(ticks) = self.ticks.take() {
            self.written += ticks.inputs.len() as u64;
            file.inputs(self.at_ns, &ticks)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk that takes nothing must not delay a stop.
    #[test]
    fn a_message_to_the_board_never_waits_for_a_place() {
        let (items, queue) = channel();
        let counts = Arc::new(Counts::default());
        counts.waiting.store(WAITING, Ordering::Release);
        let tap = Tap {
            items,
            counts: counts.clone(),
        };
        let begun = Instant::now();
        tap.sent(1, &ToDevice::Stop);
        assert!(begun.elapsed() < PATIENCE);
        assert!(matches!(queue.try_recv(), Ok(Item::Sent(_, 1, ToDevice::Stop))));
        tap.received(1, &FromDevice::Ack { seq: 1 });
        assert!(begun.elapsed() >= PATIENCE && queue.try_recv().is_err());
        assert_eq!(counts.lost.load(Ordering::Relaxed), 1);
        // A thread that has failed delays nothing.
        counts.ended.store(true, Ordering::Release);
        let begun = Instant::now();
        tap.received(2, &FromDevice::Ack { seq: 2 });
        assert!(begun.elapsed() < PATIENCE);
    }
}

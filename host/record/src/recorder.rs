//! The recorder: observes a link and writes on its own thread, so that neither the link nor the window waits for a disk.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use mortise_protocol::message::{FromDevice, Inputs, ToDevice};
use mortise_protocol::parameter::PARAMETERS;
use mortise_rig::{Client, Observer, RigError};

use crate::columns::Ticks;
use crate::error::RecordError;
use crate::file::RecordFile;

/// Time after which what was recorded is in the system's hands. With the time a message waits for the thread it bounds the loss of a killed program.
const FLUSH: Duration = Duration::from_millis(300);
/// Most ticks in a message: more compress hardly better.
const TICKS: usize = 250;
/// Most messages that wait for the thread: about two seconds of all that a board sends.
const WAITING: usize = 4096;

/// Longest time that a message waits for a place in the queue; then it is lost and counted. A board in lockstep sends faster than a disk may take it,
/// and waits; one that does not wait has seconds of space before.
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
    items: SyncSender<Item>,
    thread: Option<JoinHandle<Result<Written, RecordError>>>,
}

struct Tap {
    items: SyncSender<Item>,
    lost: Arc<AtomicU64>,
}

impl Tap {
    fn offer(&self, mut item: Item) {
        let begun = Instant::now();
        while let Err(TrySendError::Full(back)) = self.items.try_send(item) {
            if begun.elapsed() > PATIENCE {
                self.lost.fetch_add(1, Ordering::Relaxed);
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
            item = back;
        }
    }
}

impl Observer for Tap {
    fn sent(&self, sequence: u16, message: &ToDevice) {
        // Scenes are attached whole, and heartbeats say nothing.
        if !matches!(message, ToDevice::SceneChunk { .. } | ToDevice::Heartbeat) {
            self.offer(Item::Sent(now_ns(), sequence, message.clone()));
        }
    }

    fn received(&self, sequence: u16, message: &FromDevice) {
        if !matches!(message, FromDevice::Log(_)) {
            self.offer(Item::Received(now_ns(), sequence, message.clone()));
        }
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
        let (items, waiting) = sync_channel(WAITING);
        let lost = Arc::new(AtomicU64::new(0));
        let thread = std::thread::Builder::new()
            .name("mortise-record".into())
            .spawn({
                let (path, lost) = (path.to_owned(), lost.clone());
                move || write(file, path, &waiting, &lost)
            })
            .map_err(|error| RecordError::Rig(RigError::Thread(error)))?;
        let recorder = Self {
            items: items.clone(),
            thread: Some(thread),
        };
        client.observe(Some(Arc::new(Tap { items, lost })));
        let introduced = introduce(client);
        if introduced.is_err() {
            client.observe(None);
        }
        introduced?;
        Ok(recorder)
    }

    /// Attaches the image of a scene that the board uses: a replay needs it. Attached once, however often it is given.
    pub fn scene(&self, image: &[u8]) {
        // Waits for a place: scenes come rarely, and none may be missing.
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
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            _ => Err(RecordError::Write {
                path: PathBuf::new(),
                why: "the recording's thread has failed".into(),
            }),
        }
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

fn write(
    mut file: RecordFile,
    path: PathBuf,
    items: &Receiver<Item>,
    lost: &AtomicU64,
) -> Result<Written, RecordError> {
    let mut pending = Pending::default();
    let mut flushed = Instant::now();
    loop {
        match items.recv_timeout(FLUSH.saturating_sub(flushed.elapsed())) {
            Ok(Item::Sent(at, sequence, message)) => file.sent(at, sequence, &message)?,
            Ok(Item::Received(at, _, FromDevice::Inputs(inputs))) => pending.add(at, &inputs, &mut file)?,
            Ok(Item::Received(at, sequence, message)) => file.received(at, sequence, &message)?,
            Ok(Item::Scene(image)) => file.scene(now_ns(), &image)?,
            Ok(Item::End) | Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {}
        }
        if flushed.elapsed() >= FLUSH {
            pending.write(&mut file)?;
            file.flush()?;
            flushed = Instant::now();
        }
    }
    pending.write(&mut file)?;
    let lost_messages = lost.load(Ordering::Relaxed);
    file.finish(lost_messages)?;
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

    fn write(&mut self, file: &mut RecordFile) -> Result<(), RecordError> {
        if let Some(ticks) = self.ticks.take() {
            self.written += ticks.inputs.len() as u64;
            file.inputs(self.at_ns, &ticks)?;
        }
        Ok(())
    }
}

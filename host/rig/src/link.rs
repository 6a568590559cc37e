//! The link: numbers outgoing messages, reads incoming ones on its own thread, and matches answers to requests.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mortise_protocol::frame::{self, Decoder, Stamp};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{DeviceState, FromDevice, Refusal, ToDevice};
use mortise_protocol::parameter::ParameterId;

use crate::error::RigError;
use crate::event::{Event, Events};
use crate::log::{self, LogReader};
use crate::observer::Observer;
use crate::transport::{Transport, is_quiet, write_whole};
use crate::words::Words;

/// Kind of answer that a message expects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Expect {
    Ack,
    Hello,
    Capabilities,
    Parameter(ParameterId),
    Statistics,
    Ran,
    Rig,
    Readings,
    MotorTested,
}

impl Expect {
    pub(crate) fn of(message: &ToDevice) -> Self {
        match message {
            ToDevice::Hello(_) => Self::Hello,
            ToDevice::GetCapabilities => Self::Capabilities,
            ToDevice::GetParameter(id) => Self::Parameter(*id),
            ToDevice::GetStatistics { .. } => Self::Statistics,
            ToDevice::Run { .. } => Self::Ran,
            ToDevice::GetRig => Self::Rig,
            ToDevice::GetReadings => Self::Readings,
            ToDevice::TestMotor { .. } => Self::MotorTested,
            _ => Self::Ack,
        }
    }

    fn met_by(self, message: &FromDevice) -> bool {
        match (self, message) {
            (Self::Hello, FromDevice::Hello(_))
            | (Self::Capabilities, FromDevice::Capabilities(_))
            | (Self::Statistics, FromDevice::Statistics(_))
            | (Self::Ran, FromDevice::Ran { .. })
            | (Self::Rig, FromDevice::Rig { .. })
            | (Self::Readings, FromDevice::Readings(_))
            | (Self::MotorTested, FromDevice::MotorTested(_)) => true,
            (Self::Parameter(wanted), FromDevice::Parameter { id, .. }) => wanted == *id,
            _ => false,
        }
    }
}

/// An answer.
#[derive(Debug)]
pub(crate) enum Answer {
    Done,
    Refused(Refusal),
    Value(Box<FromDevice>),
}

/// A message under way. Dropping it removes it from the link.
pub(crate) struct Ticket<'l> {
    link: &'l Link,
    seq: u16,
}

struct Slot {
    seq: u16,
    expect: Expect,
    answer: Option<Answer>,
}

#[derive(Default)]
struct Desk {
    slots: Vec<Slot>,
    lost: Option<String>,
}

struct Writer {
    port: Box<dyn std::io::Write + Send>,
    last: Instant,
    /// Stamp of the last frame; `None` until the board has given the session's number.
    stamp: Option<Stamp>,
}

/// Whether the board still knows this program.
#[derive(Clone, Copy, Default)]
enum Greeted {
    /// Not greeted yet, or a restart is under way.
    #[default]
    No,
    /// Greeted with this message, numbered as by [`Link::sent`].
    With(u64),
    /// Greeted, but a later message was refused as not greeted: the board has restarted.
    Forgotten,
}

/// State shared by the client, the reader thread and the heartbeat.
pub(crate) struct Link {
    writer: Mutex<Writer>,
    desk: Mutex<Desk>,
    answered: Condvar,
    pub(crate) events: Events,
    closing: AtomicBool,
    state: Mutex<Option<DeviceState>>,
    greeted: Mutex<Greeted>,
    /// Number of stops sent by this program, and of stops and faults reported by the board.
    halts: AtomicU64,
    /// Number of messages sent; a sequence number is its lowest 16 bits.
    sent: AtomicU64,
    heard: Mutex<Instant>,
    pub(crate) frames: AtomicU64,
    pub(crate) bad_frames: AtomicU64,
    observer: RwLock<Option<Arc<dyn Observer>>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A reader thread and the objects that the transport keeps alive.
pub(crate) struct Reader {
    thread: Option<JoinHandle<()>>,
    _keep: Option<Box<dyn Send + Sync>>,
}

impl Reader {
    pub(crate) fn join(&mut self) {
        if let Some(thread) = self.thread.take() {
            // A panic in the reader has already been reported as a lost link.
            let _ = thread.join();
        }
    }
}

impl Link {
    /// Starts reading. `elf`: the firmware, for its log strings.
    pub(crate) fn start(transport: Transport, elf: Option<PathBuf>) -> Result<(Arc<Self>, Reader), RigError> {
        let Transport { reader, writer, keep } = transport;
        let link = Arc::new(Self {
            writer: Mutex::new(Writer {
                port: writer,
                last: Instant::now(),
                stamp: None,
            }),
            desk: Mutex::default(),
            answered: Condvar::new(),
            events: Events::default(),
            closing: AtomicBool::new(false),
            state: Mutex::new(None),
            greeted: Mutex::default(),
            halts: AtomicU64::new(0),
            sent: AtomicU64::new(0),
            heard: Mutex::new(Instant::now()),
            frames: AtomicU64::new(0),
            bad_frames: AtomicU64::new(0),
            observer: RwLock::new(None),
        });
        let thread = std::thread::Builder::new()
            .name("mortise-link".into())
            .spawn({
                let link = link.clone();
                move || link.read(reader, elf)
            })
            .map_err(RigError::Thread)?;
        let reader = Reader {
            thread: Some(thread),
            _keep: keep,
        };
        Ok((link, reader))
    }

    fn read(&self, mut reader: Box<dyn std::io::Read + Send>, elf: Option<PathBuf>) {
        let table = elf.as_deref().and_then(log::table);
        let mut lines = LogReader::new(table.as_ref());
        let mut decoder = Decoder::new();
        let mut bytes = [0u8; 4096];
        while !self.closing.load(Ordering::Relaxed) {
            let count = match reader.read(&mut bytes) {
                Ok(0) => return self.lose("the other end has closed the connection"),
                Ok(count) => count,
                Err(error) if is_quiet(&error) => continue,
                Err(error) => return self.lose(&error.to_string()),
            };
            for &byte in &bytes[..count] {
                match decoder.push::<FromDevice>(byte) {
                    None => {}
                    Some(Ok((seq, message))) => {
                        self.frames.fetch_add(1, Ordering::Relaxed);
                        *lock(&self.heard) = Instant::now();
                        self.observed(|observer| observer.received(seq, &message));
                        self.deal(message, &mut lines);
                    }
                    Some(Err(_)) => {
                        self.bad_frames.fetch_add(1, Ordering::Relaxed);
                    }
                }
            }
        }
    }

    fn deal(&self, message: FromDevice, lines: &mut LogReader<'_>) {
        match message {
            FromDevice::Ack { seq } => {
                self.answer(|slot| slot.seq == seq && slot.expect == Expect::Ack, Answer::Done)
            }
            FromDevice::Refused { seq, reason } => {
                let mut greeted = lock(&self.greeted);
                // A late refusal of a message from before the greeting does not count.
                let later = |greeting| self.number(seq) > greeting;
                if reason == Refusal::NotGreeted && matches!(*greeted, Greeted::With(number) if later(number))
                {
                    *greeted = Greeted::Forgotten;
                }
                drop(greeted);
                self.answer(|slot| slot.seq == seq, Answer::Refused(reason))
            }
            FromDevice::Telemetry(sample) => self.events.push(Event::Telemetry(Box::new(sample))),
            FromDevice::State { tick, state } => {
                *lock(&self.state) = Some(state);
                if matches!(state, DeviceState::Stopped | DeviceState::Fault(_)) {
                    self.halts.fetch_add(1, Ordering::SeqCst);
                }
                self.events.push(Event::State { tick, state });
            }
            FromDevice::Fault { tick, fault } => {
                self.halts.fetch_add(1, Ordering::SeqCst);
                self.events.push(Event::Fault { tick, fault });
            }
            // For the observer only.
            FromDevice::Inputs(_) => {}
            FromDevice::Log(bytes) => lines.take(&bytes, |line| self.events.push(Event::Log(line))),
            value => {
                let value = Box::new(value);
                let met = |slot: &Slot| slot.expect.met_by(&value);
                let mut desk = lock(&self.desk);
                if let Some(slot) = desk
                    .slots
                    .iter_mut()
                    .find(|slot| slot.answer.is_none() && met(slot))
                {
                    slot.answer = Some(Answer::Value(value));
                    self.answered.notify_all();
                }
            }
        }
    }

    fn answer(&self, fits: impl Fn(&Slot) -> bool, answer: Answer) {
        let mut desk = lock(&self.desk);
        if let Some(slot) = desk
            .slots
            .iter_mut()
            .find(|slot| slot.answer.is_none() && fits(slot))
        {
            slot.answer = Some(answer);
            self.answered.notify_all();
        }
    }

    /// Marks the link as lost; the first reason stays.
    pub(crate) fn lose(&self, why: &str) {
        {
            let mut desk = lock(&self.desk);
            if desk.lost.is_some() {
                return;
            }
            desk.lost = Some(why.to_owned());
            self.answered.notify_all();
        }
        if !self.closing.load(Ordering::Relaxed) {
            self.events.push(Event::LinkLost(why.to_owned()));
        }
        self.events.close();
    }

    pub(crate) fn check(&self) -> Result<(), RigError> {
        match &lock(&self.desk).lost {
            Some(why) => Err(RigError::LinkLost { why: why.clone() }),
            None => Ok(()),
        }
    }

    /// Sends without waiting; returns the sequence number.
    pub(crate) fn send(&self, message: &ToDevice) -> Result<u16, RigError> {
        let mut writer = lock(&self.writer);
        let seq = self.next_sequence(&writer);
        self.write(&mut writer, seq, message)?;
        Ok(seq)
    }

    /// Sends a message and registers that it expects an answer.
    pub(crate) fn post(&self, message: &ToDevice) -> Result<Ticket<'_>, RigError> {
        let mut writer = lock(&self.writer);
        let seq = self.next_sequence(&writer);
        // Registered before writing: the answer may be faster than this thread.
        lock(&self.desk).slots.push(Slot {
            seq,
            expect: Expect::of(message),
            answer: None,
        });
        let ticket = Ticket { link: self, seq };
        self.write(&mut writer, seq, message)?;
        Ok(ticket)
    }

    /// Called under the writer's lock, so that messages are sent in order.
    fn next_sequence(&self, _writer: &Writer) -> u16 {
        (self.sent.fetch_add(1, Ordering::Relaxed) + 1) as u16
    }

    /// The newest message with this sequence number, numbered as by [`Self::sent`].
    fn number(&self, seq: u16) -> u64 {
        let sent = self.sent.load(Ordering::Relaxed);
        sent.saturating_sub(u64::from((sent as u16).wrapping_sub(seq)))
    }

    fn write(&self, writer: &mut Writer, seq: u16, message: &ToDevice) -> Result<(), RigError> {
        self.check()?;
        if *message == ToDevice::Stop {
            self.halts.fetch_add(1, Ordering::SeqCst);
        }
        let mut out = [0u8; MAX_FRAME];
        // Under the writer's lock, so that the stamp's counts rise in the order of the frames. A greeting has the frozen layout, without a
        // stamp.
        if let Some(stamp) = &mut writer.stamp {
            stamp.count = stamp.count.wrapping_add(1);
        }
        let stamp = writer.stamp.filter(|_| !matches!(message, ToDevice::Hello(_)));
        let bytes = frame::encode_stamped(seq, stamp, message, &mut out).map_err(|_| RigError::TooLarge {
            what: message.words(),
        })?;
        writer.last = Instant::now();
        // Before it is written, so that it precedes its answer.
        self.observed(|observer| observer.sent(seq, message));
        write_whole(&mut *writer.port, bytes).map_err(|error| {
            self.lose(&error.to_string());
            RigError::LinkLost {
                why: error.to_string(),
            }
        })
    }

    /// Passes every message from now on to `observer`; `None`: to nobody.
    pub(crate) fn observe(&self, observer: Option<Arc<dyn Observer>>) {
        *self.observer.write().unwrap_or_else(PoisonError::into_inner) = observer;
    }

    fn observed(&self, show: impl FnOnce(&dyn Observer)) {
        if let Some(observer) = &*self.observer.read().unwrap_or_else(PoisonError::into_inner) {
            show(observer.as_ref());
        }
    }

    /// Writes `bytes` unchanged, then a delimiter, which ends any garbage on the wire.
    pub(crate) fn write_raw(&self, bytes: &[u8]) -> Result<(), RigError> {
        self.check()?;
        let mut writer = lock(&self.writer);
        let written =
            write_whole(&mut *writer.port, bytes).and_then(|()| write_whole(&mut *writer.port, &[0]));
        written.map_err(|error| {
            self.lose(&error.to_string());
            RigError::LinkLost {
                why: error.to_string(),
            }
        })
    }

    /// Ends the reader and releases the port after pending writes.
    pub(crate) fn close(&self) {
        self.closing.store(true, Ordering::Relaxed);
        lock(&self.writer).port = Box::new(std::io::sink());
    }

    /// Stores the session number given by the board: further frames are stamped with it.
    pub(crate) fn begin_session(&self, session: u32) {
        lock(&self.writer).stamp = Some(Stamp { session, count: 0 });
    }

    /// Number that changes with every known stop and fault: decisions made before it changed must not be sent afterwards.
    pub(crate) fn halts(&self) -> u64 {
        self.halts.load(Ordering::SeqCst)
    }

    /// Time since a frame was sent.
    pub(crate) fn silent_for(&self) -> Duration {
        lock(&self.writer).last.elapsed()
    }

    /// Time since a valid frame was received.
    pub(crate) fn unheard_for(&self) -> Duration {
        lock(&self.heard).elapsed()
    }

    /// Restarts the silence timer after a pause in which no frames were expected.
    pub(crate) fn forgive_silence(&self) {
        *lock(&self.heard) = Instant::now();
    }

    /// Records that the board was greeted with the message of this sequence number and knows this program from then on. A detected restart
    /// stays recorded.
    pub(crate) fn set_greeted(&self, seq: u16) {
        let mut greeted = lock(&self.greeted);
        if !matches!(*greeted, Greeted::Forgotten) {
            *greeted = Greeted::With(self.number(seq));
        }
    }

    /// Records that the board need not know this program until it is greeted again.
    pub(crate) fn forget_greeting(&self) {
        *lock(&self.greeted) = Greeted::No;
    }

    /// Whether the board was greeted but no longer knows of it.
    pub(crate) fn has_started_anew(&self) -> bool {
        matches!(*lock(&self.greeted), Greeted::Forgotten)
    }

    /// The last state that the board reported.
    pub(crate) fn state(&self) -> Option<DeviceState> {
        *lock(&self.state)
    }

    pub(crate) fn set_state(&self, state: DeviceState) {
        *lock(&self.state) = Some(state);
    }
}

impl Ticket<'_> {
    /// Sequence number of the message.
    pub(crate) fn seq(&self) -> u16 {
        self.seq
    }

    /// Waits for the answer; `None` when it did not come in time (it may still come: the ticket stays valid).
    pub(crate) fn wait(&self, timeout: Duration) -> Result<Option<Answer>, RigError> {
        let deadline = Instant::now() + timeout;
        let mut desk = lock(&self.link.desk);
        loop {
            if let Some(slot) = desk.slots.iter_mut().find(|slot| slot.seq == self.seq)
                && let Some(answer) = slot.answer.take()
            {
                return Ok(Some(answer));
            }
            if let Some(why) = &desk.lost {
                return Err(RigError::LinkLost { why: why.clone() });
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            desk = self
                .link
                .answered
                .wait_timeout(desk, left)
                .map(|(desk, _)| desk)
                .unwrap_or_else(|poisoned| poisoned.into_inner().0);
        }
    }

    /// Sends `message`, which must be the ticket's, again under the same number.
    pub(crate) fn resend(&self, message: &ToDevice) -> Result<(), RigError> {
        let mut writer = lock(&self.link.writer);
        self.link.write(&mut writer, self.seq, message)
    }
}

impl Drop for Ticket<'_> {
    fn drop(&mut self) {
        lock(&self.link.desk).slots.retain(|slot| slot.seq != self.seq);
    }
}

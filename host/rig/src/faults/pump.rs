//! One direction of a faulty link: takes frames, harms them, delivers them.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use fastrand::Rng;
use mortise_firmware::board::TICK_HZ;
use mortise_protocol::frame::{Decoder, encode};
use mortise_protocol::limits::MAX_FRAME;
use mortise_protocol::message::{FromDevice, ToDevice};
use serde::de::DeserializeOwned;

use super::settings::Faults;
use super::shared::{Shared, read_some};
use crate::transport::write_whole;

/// Longest wait of a frame that is to be overtaken, ms.
const REORDER_MS: u64 = 50;
/// Largest number of spurious frames at once.
const FLOOD_AT_ONCE: f64 = 1000.0;
/// Wait for input while frames are held back, by the wall clock.
const SOON: Duration = Duration::from_millis(1);
/// Milliseconds in a tick.
const TICK_MS: u64 = 1000 / TICK_HZ as u64;

/// Meaning of a frame for the line.
pub(super) enum Kind {
    /// A run of this many ticks follows the frame.
    Run(u32),
    /// The board has finished the released run.
    Ran,
    /// Lockstep begins or ends.
    Lockstep(bool),
    /// A message to be overheard.
    Telling(Box<FromDevice>),
    /// Anything else.
    Other,
}

fn message<M: DeserializeOwned>(frame: &[u8]) -> Option<M> {
    let mut decoder = Decoder::new();
    let read = frame.iter().find_map(|&byte| decoder.push::<M>(byte))?;
    read.ok().map(|(_, message)| message)
}

/// Kind of a frame to the board.
pub(super) fn to_board(frame: &[u8]) -> Kind {
    match message::<ToDevice>(frame) {
        Some(ToDevice::Run { ticks }) => Kind::Run(ticks),
        Some(ToDevice::Lockstep(on)) => Kind::Lockstep(on),
        _ => Kind::Other,
    }
}

/// Kind of a frame from the board.
pub(super) fn from_board(frame: &[u8]) -> Kind {
    match message::<FromDevice>(frame) {
        Some(FromDevice::Ran { .. }) => Kind::Ran,
        Some(reported @ (FromDevice::Telemetry(_) | FromDevice::Fault { .. })) => {
            Kind::Telling(Box::new(reported))
        }
        _ => Kind::Other,
    }
}

type Read<'r> = dyn FnMut(&mut [u8], Duration) -> io::Result<usize> + 'r;

pub(super) struct Pump {
    shared: Arc<Shared>,
    to: Box<dyn Write + Send>,
    kind: fn(&[u8]) -> Kind,
    /// 0: to the board, 1: from it.
    direction: u64,
    random: Rng,
    faults: Faults,
    epoch: u32,
    started: Instant,
    ticks: u64,
    /// Start of the faults, ms.
    begun: u64,
    /// Bytes of an incomplete frame.
    part: Vec<u8>,
    /// Waiting frames by delivery time and order of arrival.
    waiting: BTreeMap<(u64, u64), Vec<u8>>,
    order: u64,
    /// A frame that the next one will overtake, and its time of arrival.
    held: Option<(u64, Vec<u8>)>,
    /// Spurious frames still to be sent, and the time up to which they are counted.
    owed: f64,
    owed_until: u64,
}

fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

impl Pump {
    pub(super) fn new(
        shared: Arc<Shared>,
        to: Box<dyn Write + Send>,
        kind: fn(&[u8]) -> Kind,
        direction: u64,
    ) -> Self {
        Self {
            shared,
            to,
            kind,
            direction,
            random: Rng::with_seed(0),
            faults: Faults::default(),
            epoch: 0,
            started: Instant::now(),
            ticks: 0,
            begun: 0,
            part: Vec::new(),
            waiting: BTreeMap::new(),
            order: 0,
            held: None,
            owed: 0.0,
            owed_until: 0,
        }
    }

    /// Runs until the stream ends on either side.
    pub(super) fn run(mut self, read: &mut Read<'_>) {
        let mut bytes = [0u8; 4096];
        while !self.shared.closing.load(Ordering::Relaxed) {
            let idle = self.waiting.is_empty() && self.held.is_none() && self.faults.flood_per_s == 0;
            let wait = if idle { crate::READ_WAIT } else { SOON };
            let Some(got) = read_some(read(&mut bytes, wait)) else {
                return;
            };
            if self.take(&bytes[..got]).is_err() {
                return;
            }
        }
    }

    fn take(&mut self, bytes: &[u8]) -> io::Result<()> {
        for &byte in bytes {
            self.part.push(byte);
            // Data too long to be a frame passes unharmed.
            if byte == 0 || self.part.len() > 2 * MAX_FRAME {
                let frame = std::mem::take(&mut self.part);
                self.frame(frame)?;
            }
        }
        if !self.lockstep() {
            self.follow()?;
            self.flood()?;
            self.release(false)?;
        }
        Ok(())
    }

    fn lockstep(&self) -> bool {
        self.shared.lockstep.load(Ordering::SeqCst)
    }

    fn acting(&self) -> bool {
        self.epoch % 2 == 1
    }

    /// Time since the faults began, ms.
    fn now(&self) -> u64 {
        self.clock().saturating_sub(self.begun)
    }

    fn clock(&self) -> u64 {
        if self.lockstep() {
            self.ticks * TICK_MS
        } else {
            self.started.elapsed().as_millis() as u64
        }
    }

    /// Detects that faults began or ended.
    fn follow(&mut self) -> io::Result<()> {
        let epoch = self.shared.epoch.load(Ordering::SeqCst);
        if epoch == self.epoch {
            return Ok(());
        }
        self.release(true)?;
        self.epoch = epoch;
        self.faults = if self.acting() {
            self.shared
                .faults
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .clone()
        } else {
            Faults::default()
        };
        self.random = Rng::with_seed(self.faults.seed.wrapping_mul(2).wrapping_add(self.direction));
        self.begun = self.clock();
        self.owed = 0.0;
        self.owed_until = 0;
        Ok(())
    }

    fn frame(&mut self, frame: Vec<u8>) -> io::Result<()> {
        self.follow()?;
        match (self.kind)(&frame) {
            Kind::Run(ticks) => {
                self.flood()?;
                self.release(false)?;
                self.ticks += u64::from(ticks);
                self.shared.released.store(self.ticks, Ordering::SeqCst);
                write_whole(&mut *self.to, &frame)
            }
            Kind::Ran => {
                // A client waits for one run's end before it requests the next.
                self.ticks = self.shared.released.load(Ordering::SeqCst);
                self.flood()?;
                self.release(false)?;
                write_whole(&mut *self.to, &frame)
            }
            Kind::Lockstep(on) => {
                self.release(true)?;
                self.shared.lockstep.store(on, Ordering::SeqCst);
                write_whole(&mut *self.to, &frame)
            }
            _ if !self.acting() => write_whole(&mut *self.to, &frame),
            kind => {
                if let Kind::Telling(reported) = kind {
                    let overheard = &self.shared.overheard;
                    overheard
                        .lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .push(*reported);
                }
                self.harm(frame);
                self.release(false)
            }
        }
    }

    fn harm(&mut self, mut frame: Vec<u8>) {
        let shared = self.shared.clone();
        count(&shared.frames);
        let now = self.now();
        // Every decision is drawn regardless of the others, so that changing one share leaves the other draws unchanged.
        let [lost, damaged, twice, passed] = [
            self.faults.drop,
            self.faults.corrupt,
            self.faults.repeat,
            self.faults.reorder,
        ]
        .map(|share| self.random.f64() < share);
        let [from, to] = self.faults.delay_ms;
        let delay = u64::from(self.random.u32(from..=to));
        if lost || self.faults.is_cut(now) {
            return count(&shared.lost);
        }
        if damaged {
            count(&shared.corrupted);
            self.damage(&mut frame);
        }
        let before = self.held.take();
        if twice {
            count(&shared.repeated);
            self.queue(now + delay, frame.clone());
        }
        if delay > 0 || self.faults.stalled(now) {
            count(&shared.late);
        }
        if passed && before.is_none() {
            count(&shared.reordered);
            self.held = Some((now, frame));
        } else {
            self.queue(now + delay, frame);
        }
        if let Some((_, held)) = before {
            self.queue(now + delay, held);
        }
    }

    /// Flips up to three bits but leaves the delimiter: without it the next frame would be lost too.
    fn damage(&mut self, frame: &mut [u8]) {
        let Some(body) = frame.len().checked_sub(1).filter(|&body| body > 0) else {
            return;
        };
        for _ in 0..self.random.u32(1..=3) {
            frame[self.random.usize(..body)] ^= 1 << self.random.u32(..8);
        }
    }

    fn queue(&mut self, due: u64, frame: Vec<u8>) {
        self.order += 1;
        self.waiting.insert((due, self.order), frame);
    }

    /// Delivers the frames that are due, or all.
    fn release(&mut self, all: bool) -> io::Result<()> {
        let now = self.now();
        if let Some((since, _)) = &self.held
            && (all || since + REORDER_MS <= now)
            && let Some((since, frame)) = self.held.take()
        {
            self.queue(since, frame);
        }
        while let Some(next) = self.waiting.first_entry() {
            if !all && (next.key().0 > now || self.faults.stalled(now)) {
                break;
            }
            let frame = next.remove();
            if !all && self.faults.is_cut(now) {
                count(&self.shared.lost);
                continue;
            }
            write_whole(&mut *self.to, &frame)?;
        }
        Ok(())
    }

    /// Sends the spurious frames due by now.
    fn flood(&mut self) -> io::Result<()> {
        if self.faults.flood_per_s == 0 {
            return Ok(());
        }
        let now = self.now();
        let passed_s = 1e-3 * now.saturating_sub(self.owed_until) as f64;
        self.owed_until = now;
        self.owed = (self.owed + f64::from(self.faults.flood_per_s) * passed_s).min(FLOOD_AT_ONCE);
        while self.owed >= 1.0 {
            self.owed -= 1.0;
            count(&self.shared.flooded);
            let mut room = [0u8; MAX_FRAME];
            let made_up = if self.direction == 0 && self.random.bool() {
                // Number 0 is awaited by the client only once in 65,536 messages.
                encode(0, &ToDevice::Heartbeat, &mut room).unwrap_or(&[0])
            } else {
                let length = self.random.usize(1..64);
                room[..length].fill_with(|| self.random.u8(1..));
                &room[..=length]
            };
            write_whole(&mut *self.to, made_up)?;
        }
        Ok(())
    }
}

//! The in-process rig: the board's own planes, scene store and simulated mechanism on a thread of this program, reached through the same
//! protocol bytes as a board.

use std::cell::Cell;
use std::io;
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mortise_firmware::board::{Clock, ERASED, FlashWord, Identity, Mechanism, Outbound, SLOTS, TICK_HZ};
use mortise_firmware::channel::Channels;
use mortise_firmware::control::Ticked;
use mortise_firmware::device;
use mortise_firmware::link::OUTBOUND_MIN;
use mortise_firmware::store;
use mortise_haptics::Work;
use mortise_mechanism::hardware_limits::HardwareLimits;
use mortise_protocol::message::{CostUnit, ResetReason};
use mortise_protocol::rig::Rig;
use mortise_simulation::ram_flash::{ERASE_SIZE, RamFlash};
use mortise_simulation::simulated_rig::SimulatedRig;

use crate::error::RigError;
use crate::pipe::{PIPE_CAPACITY, PipeReader, PipeWriter, pipe};
use crate::real_time;
use crate::replayed::{Readings, Replayed};
use crate::transport::{READ_WAIT, Transport, is_quiet};

/// Bytes of a scene slot: far more than any board has, so that a PC can simulate scenes too large for present boards.
const SLOT: usize = 256 * ERASE_SIZE;
/// Bytes of all slots: for each slot also a sector for a rig description.
const ALL: usize = SLOTS * (SLOT + ERASE_SIZE);
/// Capacity of a board's output buffer in bytes.
const OUTBOUND: usize = 4 * OUTBOUND_MIN;
/// Number of boards started in this process.
static STARTS: AtomicU64 = AtomicU64::new(0);
const TICK: Duration = Duration::from_micros(1_000_000 / TICK_HZ as u64);
/// Largest number of late ticks that a paced rig makes up after this computer was busy; the rest count as missed.
const CATCH_UP: u32 = 4;
/// Pause after missed ticks: a scene too large for this computer must not occupy a whole core, with or without real-time priority.
const BREATH: Duration = Duration::from_micros(250);

/// Flash of a simulated board: survives its restarts, and outlives the connection when the caller keeps a clone.
#[derive(Clone, Debug, Default)]
pub struct Flash(Arc<Mutex<Vec<FlashWord>>>);

/// Starts a simulated board. With `realtime`, ticks follow the wall clock; otherwise they run as fast as possible, in lockstep on request.
/// If another board still holds `flash`, waits for its end.
///
/// # Errors
/// `Thread`.
pub fn simulate(flash: &Flash, realtime: bool) -> Result<Transport, RigError> {
    start(flash, realtime, SimulatedRig::of, |_| {})
}

/// Starts a simulated board in lockstep whose mechanism reads what a recording of another board holds, and whose motors drive nothing.
///
/// # Errors
/// `Thread`.
pub fn simulate_readings(readings: &Readings) -> Result<Transport, RigError> {
    let readings = readings.clone();
    let flash = Flash::default();
    start(&flash, false, move |_| Replayed::new(readings.clone()), |_| {})
}

/// Starts the board's thread with the mechanism that `build` makes of the stored description; `ticked` receives the work of every tick.
fn start<M: Limited>(
    flash: &Flash,
    realtime: bool,
    build: impl Fn(Option<&Rig>) -> M + Send + 'static,
    mut ticked: impl FnMut(TickWork) + Send + 'static,
) -> Result<Transport, RigError> {
    let (to_board, from_host) = pipe();
    let (to_host, from_board) = pipe();
    let thread = std::thread::Builder::new()
        .name("mortise-board".into())
        .spawn({
            let flash = flash.clone();
            move || run(&flash, realtime, &build, (from_host, to_host), &mut ticked)
        })
        .map_err(RigError::Thread)?;
    Ok(Transport {
        reader: Box::new(from_board),
        writer: Box::new(to_board),
        keep: Some(Box::new(Board(Some(thread)))),
    })
}

/// The force law's work in a tick, by the tick's number in telemetry; `None` when it did not run.
pub type TickWork = (u32, Option<Work>);

/// As [`simulate`] in lockstep, and reports the work of every tick. It computes the same bits as an emulated board, which cannot report what it counts.
///
/// # Errors
/// `Thread`.
pub fn simulate_counted(flash: &Flash) -> Result<(Transport, Receiver<TickWork>), RigError> {
    let (sender, receiver) = mpsc::channel();
    // A receiver that is gone needs no reports.
    let transport = start(flash, false, SimulatedRig::of, move |work| _ = sender.send(work))?;
    Ok((transport, receiver))
}

/// Waits for the board's end, so that its flash is free once the connection is closed. The board ends because its pipes are closed first.
struct Board(Option<JoinHandle<()>>);

impl Drop for Board {
    fn drop(&mut self) {
        if let Some(thread) = self.0.take() {
            // A panic there has been reported as a lost link.
            let _ = thread.join();
        }
    }
}

/// Runs the board from power-on, and again after each restart.
fn run<M: Limited>(
    flash: &Flash,
    realtime: bool,
    build: &dyn Fn(Option<&Rig>) -> M,
    (mut from_host, mut to_host): (PipeReader, PipeWriter),
    ticked: &mut dyn FnMut(TickWork),
) {
    if realtime {
        real_time::ask();
    }
    let mut memory = flash.0.lock().unwrap_or_else(PoisonError::into_inner);
    if memory.is_empty() {
        memory.resize(ALL / size_of::<FlashWord>(), ERASED);
    }
    let mut reset = ResetReason::PowerOn;
    while power_on(
        &mut memory,
        reset,
        realtime,
        build,
        (&mut from_host, &mut to_host),
        ticked,
    )
    .is_ok()
    {
        reset = ResetReason::Requested;
    }
}

/// Runs until a restart is requested or the host is gone (error).
fn power_on<M: Limited>(
    memory: &mut [FlashWord],
    reset: ResetReason,
    realtime: bool,
    build: &dyn Fn(Option<&Rig>) -> M,
    (from_host, to_host): (&mut PipeReader, &mut PipeWriter),
    ticked: &mut dyn FnMut(TickWork),
) -> io::Result<()> {
    let mut channels = Box::new(Channels::new());
    let pace = Rc::new(Pace::new(realtime));
    let flash = RamFlash::new(memory);
    let kept = store::rig::kept(&flash);
    let rig = kept.rig();
    let mechanism = build(rig);
    let identity = Identity {
        board: if realtime {
            "simulation"
        } else {
            "simulation, lockstep"
        },
        force_axes: rig.map_or(3, |rig| rig.joints.len() as u8),
        // A described wrist is passive.
        torque_axes: if rig.is_some() { 0 } else { 3 },
        cost_unit: CostUnit::Nanoseconds,
        // Without pacing no tick has a deadline.
        cost_budget: if realtime { TICK.as_nanos() as u32 } else { 0 },
        reset,
        // The simulated mechanism stands still while a tick is late.
        overrun_ticks: 0,
        hardware_limits: mechanism.hardware_limits(rig),
        // A count suffices: frames for this board cannot reach boards of other processes.
        entropy: STARTS.fetch_add(1, Ordering::Relaxed),
    };
    let (mut link, mut control) =
        device::start(&mut channels, flash, mechanism, WallClock(pace.clone()), identity);
    let mut out = Wire {
        pending: Vec::with_capacity(OUTBOUND),
    };
    // Holds everything a host can have written: bytes written before a tick are read before that tick.
    let mut input = vec![0u8; PIPE_CAPACITY];
    let mut patience = Duration::ZERO;
    loop {
        match from_host.read_within(&mut input, patience) {
            Ok(0) => return Err(io::ErrorKind::BrokenPipe.into()),
            Ok(count) => link.receive(&input[..count], &mut out),
            Err(error) if is_quiet(&error) => {}
            Err(error) => return Err(error),
        }
        patience = pace.until_next().max(pace.breath.take());
        if patience.is_zero() {
            match control.tick() {
                Ticked::Ran => ticked((control.ticks(), control.work())),
                Ticked::Waiting if !realtime => patience = READ_WAIT,
                Ticked::Waiting => {}
            }
        }
        link.poll(&mut out);
        let waiting = out.pending.len();
        out.flush(to_host)?;
        if link.restart_requested() && out.pending.is_empty() {
            return Ok(());
        }
        if out.pending.len() < waiting {
            // Output held back for lack of space can continue now.
            patience = Duration::ZERO;
        } else if waiting > 0 {
            // The host does not read: check again soon.
            patience = patience.min(TICK);
        }
    }
}

/// A mechanism, and the limits of its motors and links.
trait Limited: Mechanism + 'static {
    /// `rig`: the description in the board's flash.
    fn hardware_limits(&self, rig: Option<&Rig>) -> HardwareLimits {
        rig.map_or(HardwareLimits::LARGEST, HardwareLimits::of)
    }
}

impl Limited for SimulatedRig {}

impl Limited for Replayed {
    fn hardware_limits(&self, _rig: Option<&Rig>) -> HardwareLimits {
        self.limits()
    }
}

/// The board's output buffer.
struct Wire {
    pending: Vec<u8>,
}

impl Wire {
    /// Never blocks: ticks do not wait for a host that does not read.
    fn flush(&mut self, to: &mut PipeWriter) -> io::Result<()> {
        if self.pending.is_empty() {
            return Ok(());
        }
        match to.write_within(&self.pending, Duration::ZERO) {
            Ok(written) => {
                self.pending.drain(..written);
                Ok(())
            }
            Err(error) if is_quiet(&error) => Ok(()),
            Err(error) => Err(error),
        }
    }
}

impl Outbound for Wire {
    fn room(&self) -> usize {
        OUTBOUND - self.pending.len().min(OUTBOUND)
    }

    fn write(&mut self, frame: &[u8]) {
        self.pending.extend_from_slice(frame);
    }
}

/// Deadlines of the ticks.
struct Pace {
    realtime: bool,
    begun: Cell<Instant>,
    due: Cell<Instant>,
    /// Wait before the next tick although it is late.
    breath: Cell<Duration>,
}

impl Pace {
    fn new(realtime: bool) -> Self {
        let now = Instant::now();
        Self {
            realtime,
            begun: Cell::new(now),
            due: Cell::new(now),
            breath: Cell::default(),
        }
    }

    fn until_next(&self) -> Duration {
        if self.realtime {
            self.due.get().saturating_duration_since(Instant::now())
        } else {
            Duration::ZERO
        }
    }

    /// Number of ticks skipped because this computer was busy for too long.
    fn begin_tick(&self) -> u32 {
        let now = Instant::now();
        self.begun.set(now);
        if !self.realtime {
            return 0;
        }
        let late = now.saturating_duration_since(self.due.get());
        let behind = (late.as_nanos() / TICK.as_nanos()) as u32;
        let skipped = behind.saturating_sub(CATCH_UP);
        self.due.set(self.due.get() + TICK * (skipped + 1));
        if skipped > 0 {
            self.breath.set(BREATH);
        }
        skipped
    }
}

struct WallClock(Rc<Pace>);

impl Clock for WallClock {
    fn begin(&mut self) -> u32 {
        self.0.begin_tick()
    }

    fn cost(&mut self) -> u32 {
        self.0.begun.get().elapsed().as_nanos().min(u128::from(u32::MAX)) as u32
    }
}

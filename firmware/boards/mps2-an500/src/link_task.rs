//! The link as an embassy task, and the loop that polls the executor and sleeps.

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::NVIC;
use embassy_executor::raw::Executor;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use heapless::spsc::Consumer;
use mortise_firmware::board::{Identity, TICK_HZ};
use mortise_protocol::limits::MAX_LOG;
use mortise_protocol::message::ResetReason;
use static_cell::StaticCell;

use crate::device::Interrupt;
use crate::uart::{self, Sender};
use crate::{Link, crash, log, memory, milliseconds, timer};

/// The executor or the link has something to do.
static PENDING: AtomicBool = AtomicBool::new(false);
/// Something may have happened: a byte, a tick, an empty sender.
static WAKE: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// How often the deepest stack is looked up, ms: it reads the whole unused stack.
const STACK_EVERY: u32 = TICK_HZ as u32;
/// Bytes taken from the pipe at once.
const PIECE: usize = 64;

// SAFETY: the name and signature embassy-executor calls; defined once.
#[unsafe(export_name = "__pender")]
fn pender(_: *mut ()) {
    PENDING.store(true, Ordering::Release);
}

/// From an interrupt: something happened that may concern the link. One store; wakers would need a critical section.
pub fn note() {
    PENDING.store(true, Ordering::Release);
}

/// Logs what a start looks like.
pub fn announce(identity: &Identity, link: &Link) {
    match identity.reset {
        ResetReason::PowerOn => defmt::info!("started: power on"),
        ResetReason::Requested => defmt::info!("started: as requested"),
        ResetReason::Panic { line: 0 } => defmt::error!("started after a processor fault"),
        ResetReason::Panic { line } => defmt::error!("started after a panic in line {=u32}", line),
        _ => defmt::warn!("started: reason unknown"),
    }
    match link.store().current() {
        Some(scene) => defmt::info!(
            "scene {=u32:08x}: {=usize} parts, {=u32} bytes",
            scene.crc,
            scene.image.parts().len(),
            scene.image.header().length
        ),
        None => defmt::info!("no scene"),
    }
}

/// Polls the executor for ever; sleeps between interrupts.
pub fn run(link: Link, bytes: Consumer<'static, u8>) -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    let executor = EXECUTOR.init(Executor::new(core::ptr::null_mut()));
    match serve(link, bytes) {
        Ok(task) => executor.spawner().spawn(task),
        Err(_) => defmt::error!("the link task could not be started"),
    }
    loop {
        PENDING.store(false, Ordering::Relaxed);
        // SAFETY: only here, never from within itself; `pender` only sets a flag.
        unsafe { executor.poll() };
        // An interrupt between the look and the sleep would be slept over, so look with interrupts masked: WFI wakes for a masked one too.
        cortex_m::interrupt::free(|_| {
            if !PENDING.load(Ordering::Acquire) {
                cortex_m::asm::wfi();
            }
        });
        // Whatever woke the processor may concern the link.
        WAKE.signal(());
    }
}

/// Bytes in, frames out, until the board restarts.
#[embassy_executor::task]
async fn serve(mut link: Link, mut bytes: Consumer<'static, u8>) {
    static SENDER: StaticCell<Sender> = StaticCell::new();
    let sender = SENDER.init(Sender::new());
    let mut piece = Piece::new();
    let mut logged = Piece::new();
    let mut stack_at = 0;
    loop {
        // Bounded by what was there when the loop began.
        for _ in 0..=bytes.len() / PIECE {
            piece.fill(|| bytes.dequeue());
            link.receive(piece.as_slice(), sender);
        }
        uart::resume(&bytes);
        if timer::is_stopped() {
            // Lockstep: the control plane looks at what came. It runs before the next line does.
            NVIC::pend(Interrupt::TIMER0);
        }
        if link.poll(sender) > 0 {
            // There is room again for what may have waited for it.
            note();
        }
        if logged.as_slice().is_empty() {
            logged.refill(log::take);
        }
        let taken = link.log(logged.as_slice(), sender);
        logged.drop_front(taken);
        sender.flush();
        if link.restart_requested() && sender.is_empty() {
            crash::restart();
        }
        if milliseconds().wrapping_sub(stack_at) >= STACK_EVERY {
            stack_at = milliseconds();
            link.note_stack(memory::deepest_stack());
        }
        WAKE.wait().await;
    }
}

/// A few bytes on their way, kept when the other side has no room.
struct Piece {
    bytes: [u8; MAX_LOG],
    start: usize,
    end: usize,
}

impl Piece {
    const fn new() -> Self {
        Self {
            bytes: [0; MAX_LOG],
            start: 0,
            end: 0,
        }
    }

    fn as_slice(&self) -> &[u8] {
        &self.bytes[self.start..self.end]
    }

    /// Replaces the content by up to [`PIECE`] bytes.
    fn fill(&mut self, mut next: impl FnMut() -> Option<u8>) {
        (self.start, self.end) = (0, 0);
        while self.end < PIECE
            && let Some(byte) = next()
        {
            self.bytes[self.end] = byte;
            self.end += 1;
        }
    }

    /// Replaces the content.
    fn refill(&mut self, take: impl FnOnce(&mut [u8]) -> usize) {
        self.start = 0;
        self.end = take(&mut self.bytes);
    }

    fn drop_front(&mut self, count: usize) {
        self.start = (self.start + count).min(self.end);
    }
}

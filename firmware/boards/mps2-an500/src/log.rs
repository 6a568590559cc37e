//! defmt into a bounded ring that the link empties into Log messages. A frame that does not fit is dropped whole.
//!
//! Not for the tick: a log statement holds a critical section.

use core::cell::UnsafeCell;

use critical_section::RestoreState;
use heapless::Deque;

const RING: usize = 4096;

#[defmt::global_logger]
struct Logger;

struct Log {
    encoder: defmt::Encoder,
    restore: RestoreState,
    taken: bool,
    ring: Deque<u8, RING>,
    /// Bytes of the frame under way, to be taken back should it not fit.
    frame: usize,
    overflow: bool,
}

struct Guarded(UnsafeCell<Log>);

// SAFETY: only touched inside a critical section (single core).
unsafe impl Sync for Guarded {}

static LOG: Guarded = Guarded(UnsafeCell::new(Log {
    encoder: defmt::Encoder::new(),
    restore: RestoreState::invalid(),
    taken: false,
    ring: Deque::new(),
    frame: 0,
    overflow: false,
}));

impl Log {
    fn push(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if self.overflow || self.ring.push_back(byte).is_err() {
                self.overflow = true;
                return;
            }
            self.frame += 1;
        }
    }
}

/// The ring and the encoder apart, so that one can write into the other.
///
/// # Safety
/// Inside a critical section, and not again while the result is used.
unsafe fn log() -> &'static mut Log {
    // SAFETY: as the caller promises.
    unsafe { &mut *LOG.0.get() }
}

// SAFETY: acquire takes a critical section, release gives it back; nested use is refused.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: released in `release`.
        let restore = unsafe { critical_section::acquire() };
        // SAFETY: inside the section.
        let log = unsafe { log() };
        assert!(!log.taken, "defmt taken twice");
        log.taken = true;
        log.restore = restore;
        log.frame = 0;
        log.overflow = false;
        let mut encoder = core::mem::replace(&mut log.encoder, defmt::Encoder::new());
        encoder.start_frame(|bytes| log.push(bytes));
        log.encoder = encoder;
    }

    // SAFETY: does nothing.
    unsafe fn flush() {}

    // SAFETY: defmt calls it once after `acquire`, which holds the critical section until here.
    unsafe fn release() {
        // SAFETY: still inside the section taken in `acquire`.
        let log = unsafe { log() };
        let mut encoder = core::mem::replace(&mut log.encoder, defmt::Encoder::new());
        encoder.end_frame(|bytes| log.push(bytes));
        log.encoder = encoder;
        if log.overflow {
            for _ in 0..log.frame {
                log.ring.pop_back();
            }
        }
        log.taken = false;
        let restore = log.restore;
        // SAFETY: taken in `acquire`.
        unsafe { critical_section::release(restore) };
    }

    // SAFETY: defmt calls it between `acquire` and `release`, inside the critical section.
    unsafe fn write(bytes: &[u8]) {
        // SAFETY: between acquire and release.
        let log = unsafe { log() };
        let mut encoder = core::mem::replace(&mut log.encoder, defmt::Encoder::new());
        encoder.write(bytes, |bytes| log.push(bytes));
        log.encoder = encoder;
    }
}

defmt::timestamp!("{=u32:ms}", crate::milliseconds());

/// Moves waiting bytes into `out`; returns how many.
pub fn take(out: &mut [u8]) -> usize {
    critical_section::with(|_| {
        // SAFETY: inside the section.
        let log = unsafe { log() };
        let mut taken = 0;
        for place in out.iter_mut() {
            let Some(byte) = log.ring.pop_front() else {
                break;
            };
            *place = byte;
            taken += 1;
        }
        taken
    })
}

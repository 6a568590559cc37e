//! defmt over the link: encoded frames wait in a bounded queue until the link plane sends them as `Log` messages.
//!
//! A frame that finds no room is dropped whole, so the host's decoder stays in step. With feature `rtt` defmt-rtt takes its place, for a debug probe.
//! Never from the tick: defmt uses a critical section (see [`crate::critical`]).

use core::cell::UnsafeCell;

use defmt::{Encoder, global_logger};
use heapless::{Deque, Vec};
use mortise_protocol::limits::MAX_LOG;

/// Bytes that may wait.
const WAITING: usize = 2048;

struct Log {
    waiting: Deque<u8, WAITING>,
    frame: Vec<u8, MAX_LOG>,
    /// The frame being collected has outgrown its buffer.
    too_long: bool,
    encoder: Encoder,
    restore: critical_section::RestoreState,
    collecting: bool,
}

struct Shared(UnsafeCell<Log>);

// SAFETY: touched only inside critical sections, which exclude each other.
unsafe impl Sync for Shared {}

static LOG: Shared = Shared(UnsafeCell::new(Log {
    waiting: Deque::new(),
    frame: Vec::new(),
    too_long: false,
    encoder: Encoder::new(),
    restore: critical_section::RestoreState::invalid(),
    collecting: false,
}));

#[global_logger]
struct LinkLogger;

fn collect(frame: &mut Vec<u8, MAX_LOG>, too_long: &mut bool, bytes: &[u8]) {
    *too_long |= frame.extend_from_slice(bytes).is_err();
}

// SAFETY: from `acquire` to `release` a critical section is held, so the state has one user; defmt calls them in this order.
unsafe impl defmt::Logger for LinkLogger {
    fn acquire() {
        // SAFETY: the critical section is held from the first line until `release`, so this is the only reference to the log.
        unsafe {
            let restore = critical_section::acquire();
            let log = &mut *LOG.0.get();
            // Only a `Format` that logs could come here twice; defmt asks for a panic then.
            assert!(!log.collecting, "log inside log");
            log.collecting = true;
            log.restore = restore;
            log.frame.clear();
            log.too_long = false;
            let Log {
                encoder,
                frame,
                too_long,
                ..
            } = log;
            encoder.start_frame(|bytes| collect(frame, too_long, bytes));
        }
    }

    // SAFETY: does nothing.
    unsafe fn flush() {}

    // SAFETY: defmt calls it once after `acquire`, which holds the critical section until here.
    unsafe fn release() {
        // SAFETY: inside the critical section of `acquire`; it ends with the last line, after the last use of the log.
        unsafe {
            let log = &mut *LOG.0.get();
            let Log {
                encoder,
                frame,
                too_long,
                ..
            } = &mut *log;
            encoder.end_frame(|bytes| collect(frame, too_long, bytes));
            if !log.too_long && log.frame.len() <= log.waiting.capacity() - log.waiting.len() {
                log.waiting.extend(log.frame.iter().copied());
            }
            log.collecting = false;
            critical_section::release(log.restore);
        }
    }

    // SAFETY: defmt calls it between `acquire` and `release`.
    unsafe fn write(bytes: &[u8]) {
        // SAFETY: inside the critical section of `acquire`, so this is the only reference to the log.
        unsafe {
            let log = &mut *LOG.0.get();
            let Log {
                encoder,
                frame,
                too_long,
                ..
            } = log;
            encoder.write(bytes, |bytes| collect(frame, too_long, bytes));
        }
    }
}

/// Offers waiting bytes to `send`, which says how many it took. One reader only.
pub fn drain(send: impl FnOnce(&[u8]) -> usize) {
    let mut piece = [0u8; MAX_LOG];
    let offered = critical_section::with(|_| {
        // SAFETY: inside a critical section.
        let log = unsafe { &*LOG.0.get() };
        let offered = log.waiting.len().min(MAX_LOG);
        for (place, byte) in piece.iter_mut().zip(&log.waiting) {
            *place = *byte;
        }
        offered
    });
    if offered == 0 {
        return;
    }
    let taken = send(&piece[..offered]).min(offered);
    critical_section::with(|_| {
        // SAFETY: inside a critical section.
        let log = unsafe { &mut *LOG.0.get() };
        for _ in 0..taken {
            log.waiting.pop_front();
        }
    });
}

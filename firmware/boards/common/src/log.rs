//! defmt over the link: encoded frames wait in a bounded ring until the link plane sends them as `Log` messages.
//!
//! Never from the tick: a log statement holds a critical section.

use core::cell::UnsafeCell;

use critical_section::RestoreState;
use defmt::Encoder;
use mortise_protocol::limits::MAX_LOG;

use crate::ring::Ring;

/// Bytes that may wait.
const WAITING: usize = 4096;

#[defmt::global_logger]
struct LinkLogger;

struct Log {
    encoder: Encoder,
    ring: Ring<WAITING>,
    restore: RestoreState,
    collecting: bool,
}

struct Shared(UnsafeCell<Log>);

// SAFETY: touched only inside critical sections, which exclude each other.
unsafe impl Sync for Shared {}

static LOG: Shared = Shared(UnsafeCell::new(Log {
    encoder: Encoder::new(),
    ring: Ring::new(),
    restore: RestoreState::invalid(),
    collecting: false,
}));

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
            let Log { encoder, ring, .. } = log;
            ring.begin();
            encoder.start_frame(|bytes| ring.push(bytes));
        }
    }

    // SAFETY: does nothing.
    unsafe fn flush() {}

    // SAFETY: defmt calls it once after `acquire`, which holds the critical section until here.
    unsafe fn release() {
        // SAFETY: inside the critical section of `acquire`; it ends with the last line, after the last use of the log.
        unsafe {
            let log = &mut *LOG.0.get();
            let Log { encoder, ring, .. } = &mut *log;
            encoder.end_frame(|bytes| ring.push(bytes));
            ring.end();
            log.collecting = false;
            critical_section::release(log.restore);
        }
    }

    // SAFETY: defmt calls it between `acquire` and `release`.
    unsafe fn write(bytes: &[u8]) {
        // SAFETY: inside the critical section of `acquire`, so this is the only reference to the log.
        unsafe {
            let Log { encoder, ring, .. } = &mut *LOG.0.get();
            encoder.write(bytes, |bytes| ring.push(bytes));
        }
    }
}

/// Offers waiting bytes to `send`, which returns how many it took. One reader only.
pub fn drain(send: impl FnOnce(&[u8]) -> usize) {
    let mut piece = [0u8; MAX_LOG];
    // SAFETY: inside a critical section.
    let offered = critical_section::with(|_| unsafe { &*LOG.0.get() }.ring.peek(&mut piece));
    if offered == 0 {
        return;
    }
    let taken = send(&piece[..offered]).min(offered);
    // SAFETY: inside a critical section.
    critical_section::with(|_| unsafe { &mut *LOG.0.get() }.ring.drop_front(taken));
}

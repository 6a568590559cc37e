//! What both directions of a faulty link use.

use std::io;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64};

use mortise_protocol::message::FromDevice;

use super::settings::Faults;

/// State of a line, used by both directions.
#[derive(Debug, Default)]
pub(super) struct Shared {
    pub faults: Mutex<Faults>,
    /// Odd while faults are active.
    pub epoch: AtomicU32,
    pub lockstep: AtomicBool,
    /// Number of ticks released so far.
    pub released: AtomicU64,
    pub closing: AtomicBool,
    pub overheard: Mutex<Vec<FromDevice>>,
    pub frames: AtomicU64,
    pub lost: AtomicU64,
    pub corrupted: AtomicU64,
    pub repeated: AtomicU64,
    pub reordered: AtomicU64,
    pub late: AtomicU64,
    pub flooded: AtomicU64,
}

/// Number of bytes read, 0 when none came; `None` at the end of the stream.
pub(super) fn read_some(result: io::Result<usize>) -> Option<usize> {
    match result {
        Ok(0) => None,
        Ok(count) => Some(count),
        Err(error) if crate::transport::is_quiet(&error) => Some(0),
        Err(_) => None,
    }
}

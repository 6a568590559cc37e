//! The planes as this board has them, and its clock.

use core::sync::atomic::{AtomicU32, Ordering};

use mortise_firmware::control::ControlPlane;
use mortise_firmware::link::LinkPlane;
use mortise_simulation::ram_flash::RamFlash;

use crate::{motors, timer};

/// The control plane of this board.
pub type Control = ControlPlane<'static, 'static, motors::Motors, timer::TickClock>;
/// The link plane of this board.
pub type Link = LinkPlane<'static, 'static, RamFlash<'static>>;

/// Timer ticks since start.
pub static MILLISECONDS: AtomicU32 = AtomicU32::new(0);

/// Timer ticks since start, for the log's timestamps.
pub fn milliseconds() -> u32 {
    MILLISECONDS.load(Ordering::Relaxed)
}

//! The link plane's task: bytes from the port to the link plane, frames back, once a millisecond and whenever bytes arrive.

use cortex_m::peripheral::SCB;
use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use mortise_firmware::link::LinkPlane;

use crate::flash::SlotFlash;
use crate::memory::deepest_stack;
use crate::usb::{IN_BYTES, InPipe, Out, OutPipe};

/// The link plane of this board.
pub type Link = LinkPlane<'static, 'static, SlotFlash>;

/// A tick has run. Set by `idle`, not by the tick: the tick uses no critical section.
pub static TICKED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// Passes between stack measurements: they read some 100 kB.
const STACK_EVERY: u32 = 1000;
/// Passes with an empty outgoing pipe before a granted restart: the last packets are on their way to the host.
const RESTART_AFTER: u32 = 50;

/// Runs for ever.
#[embassy_executor::task]
pub async fn run(mut plane: Link, incoming: &'static InPipe, outgoing: &'static OutPipe) -> ! {
    let mut out = Out(outgoing);
    let mut buffer = [0u8; IN_BYTES];
    let mut passes = 0u32;
    let mut quiet = 0u32;
    loop {
        // Taken whether or not there is room for answers: a STOP may be in it.
        if let Either::First(length) = select(incoming.read(&mut buffer), TICKED.wait()).await {
            plane.receive(&buffer[..length], &mut out);
        }
        plane.poll(&mut out);
        #[cfg(not(feature = "rtt"))]
        crate::log::drain(|bytes| plane.log(bytes, &mut out));

        if passes.is_multiple_of(STACK_EVERY) {
            plane.note_stack(deepest_stack());
        }
        passes = passes.wrapping_add(1);
        quiet = if plane.restart_requested() && outgoing.is_empty() {
            quiet + 1
        } else {
            0
        };
        if quiet > RESTART_AFTER {
            crate::motors::cut();
            SCB::sys_reset();
        }
    }
}

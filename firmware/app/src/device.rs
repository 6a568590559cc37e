//! Starts both planes: the entry point for a board's start-up code and for the simulated rig.
//!
//! ```
//! use mortise_firmware::board::{Clock, Identity, Outbound};
//! use mortise_mechanism::hardware_limits::HardwareLimits;
//! use mortise_firmware::channel::Channels;
//! use mortise_firmware::control::Ticked;
//! use mortise_firmware::device::start;
//! use mortise_firmware::board::ERASED;
//! use mortise_simulation::ram_flash::RamFlash;
//! use mortise_simulation::simulated::Simulated;
//! use mortise_protocol::message::{CostUnit, ResetReason};
//!
//! struct NoClock;
//! impl Clock for NoClock {
//!     fn cost(&mut self) -> u32 { 0 }
//!     fn begin(&mut self) -> u32 { 0 }
//! }
//! struct Wire(Vec<u8>);
//! impl Outbound for Wire {
//!     fn room(&self) -> usize { 65536 - self.0.len() }
//!     fn write(&mut self, frame: &[u8]) { self.0.extend_from_slice(frame) }
//! }
//!
//! let mut flash = vec![ERASED; 2 * 8192];
//! let mut channels = Box::new(Channels::new());
//! let identity = Identity {
//!     board: "simulated", force_axes: 3, torque_axes: 3, cost_unit: CostUnit::Nanoseconds, cost_budget: 0,
//!     reset: ResetReason::PowerOn, overrun_ticks: 0, hardware_limits: HardwareLimits::LARGEST, entropy: 1,
//! };
//! let (mut link, mut control) = start(&mut channels, RamFlash::new(&mut flash), Simulated::new(), NoClock, identity);
//! let mut out = Wire(Vec::new());
//! link.receive(&[0], &mut out); // bytes from the host
//! assert_eq!(control.tick(), Ticked::Ran); // each millisecond
//! link.poll(&mut out); // frames to the host
//! ```

use crate::board::{Clock, Flash, Identity, Mechanism};
use crate::channel::Channels;
use crate::control::ControlPlane;
use crate::link::LinkPlane;
use crate::parameters::ControlSettings;

/// Both planes, motors off. The link plane reads flash here: about 10 instructions per byte of scene.
pub fn start<'c, 's, F: Flash<'s>, M: Mechanism, C: Clock>(
    channels: &'c mut Channels<'s>,
    flash: F,
    mut mechanism: M,
    clock: C,
    identity: Identity,
) -> (LinkPlane<'c, 's, F>, ControlPlane<'c, 's, M, C>) {
    let (link_ends, control_ends) = channels.split();
    let simulated = mechanism.simulation().is_some();
    let control = ControlPlane::new(
        control_ends,
        mechanism,
        clock,
        &identity,
        ControlSettings::at_start(identity.hardware_limits),
    );
    let link = LinkPlane::new(link_ends, flash, identity, simulated, M::DESCRIBED);
    (link, control)
}

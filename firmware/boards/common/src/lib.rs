//! What boards share. A board crate adds its pins, clocks and interrupts, [`device::Hardware`], and [`crash`]'s one hook that turns its motors off.
//!
//! | module | what |
//! |---|---|
//! | [`device`] | the described mechanism on a real board's encoders and motors |
//! | [`set_value`] | current to duty cycle and direction of a motor driver |
//! | [`executor`] | the idle loop: polls the link's executor, sleeps between interrupts |
//! | [`log`] | defmt into a bounded ring that the link empties |
//! | [`crash`] | panic and processor fault: motors off, a record that survives, restart |
//! | [`start`] | what a board logs when it starts |
//! | [`stack`] | how deep the stack has been |
//! | [`ring`], [`record`] | what of this needs no processor |
#![no_std]

#[cfg(test)]
extern crate std;

pub mod device;
pub mod record;
pub mod ring;
pub mod set_value;

#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod crash;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod executor;
#[cfg(all(target_arch = "arm", target_os = "none", not(feature = "rtt")))]
pub mod log;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod stack;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod start;

#[cfg(test)]
#[path = "../../../app/tests/support/rigs.rs"]
#[allow(dead_code, reason = "each test file uses its share")]
mod rigs;

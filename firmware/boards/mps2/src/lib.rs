//! QEMU's MPS2 machine as Mortise's emulated boards use it: everything that depends on the machine and not on which of its FPGA images is emulated.
//!
//! | module | what |
//! |---|---|
//! | [`interrupts`], [`registers`] | interrupt numbers and vectors; the devices' addresses |
//! | [`timer`], [`deadlines`] | the millisecond and what a tick costs in instructions; which deadlines passed |
//! | [`uart`], [`link`] | the serial line; the link plane's task on it |
//! | [`memory`], [`starts`] | RAM that stands in for flash; stack guard; how often the board has started |
//! | [`motors`] | the simulated mechanism behind an enable output |
//!
//! From QEMU 7.2 `hw/arm/mps2.c`, `hw/char/cmsdk-apb-uart.c`, `hw/timer/cmsdk-apb-timer.c` and Arm AN385/AN500.
#![no_std]

#[cfg(test)]
extern crate std;

pub mod deadlines;
pub mod starts;

#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod interrupts;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod link;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod memory;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod motors;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod registers;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod timer;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod uart;

// RTIC looks for these at the root of its `device`.
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub use interrupts::{Interrupt, NVIC_PRIO_BITS, interrupt};

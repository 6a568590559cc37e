//! Code that only simulation needs: a mechanism and an operator in place of real ones, injected input faults, flash in RAM. Used by the in-process
//! rig of the host, by the emulated board, and by tests; no real board contains any of it.
//!
//! | module | what |
//! |---|---|
//! | [`simulated`], [`described`] | a free handle with six motors; the mechanism of a rig's description |
//! | [`simulated_rig`] | whichever of the two a simulated board has |
//! | [`hand`] | operator model: a scripted hand |
//! | [`input_faults`] | faults at the inputs |
//! | [`ram_flash`] | flash in RAM |
#![no_std]

#[cfg(test)]
extern crate std;

pub mod described;
pub mod hand;
pub mod input_faults;
pub mod ram_flash;
pub mod simulated;
pub mod simulated_rig;

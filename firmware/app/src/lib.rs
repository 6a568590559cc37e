//! The application that every board shares: everything between bytes on the link and the motors, free of hardware access.
//!
//! Two planes. The **control plane** ([`control`]) is one call each millisecond at the highest priority: sensors, safety state machine, force law,
//! motors. The **link plane** ([`link`]) decodes and checks messages at low priority, keeps scenes in flash ([`store`]) and passes finished values on
//! through bounded queues ([`channel`]). [`device::start`] creates both; the same code runs on each board and, on one thread, in the simulated rig of
//! the host. Conversion between encoder counts and motor currents is in [`mortise_mechanism`].
//!
//! | module | what |
//! |---|---|
//! | [`board`] | what a board must provide |
//! | [`channel`] | queues and words between the planes |
//! | [`control`], [`safety`], [`statistics`] | the tick; its state machine; counters and state hash |
//! | [`link`], [`parameters`], [`wire`] | messages; values and settings; conversions |
//! | [`store`] | A/B scene slots, the rig's description |
//! | [`scripts`] | which scripts a simulated mechanism can follow |
#![no_std]

#[cfg(test)]
extern crate std;

pub mod board;
pub mod channel;
pub mod control;
pub mod device;
pub mod link;
pub mod parameters;
pub mod safety;
pub mod scripts;
pub mod statistics;
pub mod store;
pub mod wire;

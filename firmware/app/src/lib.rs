//! The application every board shares: all that lies between bytes on the link and the motors, without any hardware.
//!
//! Two planes. The **control plane** ([`control`]) is one call each millisecond at the highest priority: sensors, safety state machine, force law,
//! motors. The **link plane** ([`link`]) decodes and checks messages at low priority, keeps scenes in flash ([`store`]) and hands finished values
//! over through bounded queues ([`channel`]). [`device::start`] puts them together; the same code runs on each board and, on one thread, in the
//! simulated rig of the host. What lies between encoder counts and motor currents is [`mortise_mechanism`].
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

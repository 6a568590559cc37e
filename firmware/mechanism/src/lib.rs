//! The mechanism: all that lies between encoder counts and motor currents, without any hardware. Every board uses it, real or simulated.
//!
//! | module | what |
//! |---|---|
//! | [`interface`] | what the control plane reads of a mechanism and sets on it, once in each tick |
//! | [`kinematics`], [`joints`] | of a described rig: angles to pose and force to torques; counts to angles and torques to currents |
//! | [`described`] | all of it for a described rig: counts to what is sensed, wrench to currents |
//! | [`encoder`], [`velocity`], [`encoder_watch`] | encoder counts to motion; motion to speed; dead encoders |
//! | [`ceilings`] | the rig's limits, and what they leave of a wrench |
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod ceilings;
pub mod described;
pub mod encoder;
pub mod encoder_watch;
pub mod interface;
pub mod joints;
pub mod kinematics;
pub mod velocity;

//! The mechanism: conversion between encoder counts and motor currents, free of hardware access. Every board uses it, real or simulated.
//!
//! | module | what |
//! |---|---|
//! | [`interface`] | sensor readings and drive commands that the control plane exchanges with a mechanism in each tick |
//! | [`kinematics`], [`joints`] | of a described rig: angles to pose and force to torques; counts to angles and torques to currents |
//! | [`described`] | the whole chain for a described rig: counts to sensor readings, wrench to currents |
//! | [`encoder`], [`velocity`], [`encoder_watch`] | encoder counts to motion; motion to speed; dead encoders |
//! | [`hardware_limits`] | the hardware limits, and their enforcement on a wrench |
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod described;
pub mod encoder;
pub mod encoder_watch;
pub mod hardware_limits;
pub mod interface;
pub mod joints;
pub mod kinematics;
pub mod velocity;

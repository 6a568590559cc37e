//! The STM32H743 as Mortise's boards use it: everything that depends on the chip and not on how it is wired.
//!
//! | module | what |
//! |---|---|
//! | [`clocks`], [`memory`], [`critical`] | clocks; memory protection and caches; critical sections below the tick |
//! | [`tick_timer`], [`watchdog`] | the 1 kHz timer and what a tick costs; the independent watchdog |
//! | [`flash_map`], [`flash`] | where scenes and the rig's description lie; erasing and writing them |
//! | [`usb`], [`link`] | a USB serial port; the link plane's task on it |
//! | [`motor_timer`], [`stop_input`] | set values of motor drivers, and what cuts them in hardware |
//! | [`encoders`], [`motors`], [`hardware`] | encoders counted by timers; motor outputs; both as the shared device uses them |
//! | [`boot`], [`reset`], [`entropy`] | why the board started; the chip's flags; random bits |
#![no_std]

#[cfg(test)]
extern crate std;

pub mod boot;
pub mod flash_map;

#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod clocks;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod critical;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod encoders;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod entropy;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod flash;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod hardware;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod link;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod memory;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod motor_timer;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod motors;
#[cfg(test)]
mod power_loss;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod reset;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod stop_input;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod tick_timer;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod usb;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod watchdog;

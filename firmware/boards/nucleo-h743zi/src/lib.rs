//! What of the board needs no chip: current commands, flash map, reset cause.
//!
//! Tested on the PC with `cargo test -p nucleo-h743zi --lib --target x86_64-unknown-linux-gnu`. The program that wires it to the chip is
//! `main.rs` and the modules beside it; they are compiled for the chip only.
#![no_std]
// A test stands in for the chip's flash.
#![cfg_attr(not(test), forbid(unsafe_code))]

#[cfg(test)]
extern crate std;

pub mod boot;
pub mod drive;
pub mod flash_map;
#[cfg(test)]
mod power_loss;

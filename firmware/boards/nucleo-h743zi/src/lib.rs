//! What of the board needs no chip: kinematics, current commands, flash map, reset cause.
//!
//! Tested on the PC with `cargo test -p nucleo-h743zi --lib --target x86_64-unknown-linux-gnu`. The program that wires it to the chip is
//! `main.rs` and the modules beside it; they are compiled for the chip only.
#![no_std]
#![forbid(unsafe_code)]

pub mod boot;
pub mod drive;
pub mod encoder;
pub mod flash_map;
pub mod kinematics;
pub mod rig;

//! Writing firmware to a board.
//!
//! | module | what |
//! |---|---|
//! | [`firmware`] | a file of firmware: which board it is for, and of which release |
//! | [`probe`] | debug probes |
//! | [`prober`] | finding them, and writing through one, by the program `probe-rs` |
//! | `simulated` | a probe and a board that are not there, with faults (on Unix) |
//!
//! `probe-rs` runs as a program of its own and not as a library: with its tables of chips the library is as large as Mortise itself, and its probes need
//! drivers and permissions that a person sets up with that program anyway.

pub mod firmware;
pub mod probe;
pub mod prober;
#[cfg(unix)]
pub mod simulated;

mod error;

pub use error::FlashError;
pub use firmware::Firmware;
pub use probe::Probe;
pub use prober::Prober;

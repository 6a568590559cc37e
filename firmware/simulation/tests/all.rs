//! Integration tests of this crate: one program, which is linked once and whose tests share both cores.

mod described;
mod encoder_watch;
#[path = "../../app/tests/support/rigs.rs"]
mod rigs;
mod simulated;
mod support;

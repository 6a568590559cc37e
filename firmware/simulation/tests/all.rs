//! Integration tests of this package: one program, which is linked once.

mod described;
mod encoder_watch;
#[path = "../../app/tests/support/rigs.rs"]
mod rigs;
mod simulated;
mod support;

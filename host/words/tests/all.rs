//! Integration tests of this crate: one program, which is linked once and whose tests share both cores.

mod flanges;
mod held_out;
mod scattered;
mod support;

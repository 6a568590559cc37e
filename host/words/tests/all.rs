//! Integration tests of this package: one program, which is linked once.

mod flanges;
mod held_out;
mod scattered;
mod support;

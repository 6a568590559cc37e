//! Integration tests of this package: one program, which is linked once.

#[allow(dead_code)]
mod build;
mod invariance;
mod recognise;
mod regions;

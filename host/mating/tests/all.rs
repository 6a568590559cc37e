//! Integration tests of this crate: one program, which is linked once and whose tests share both cores.

#[allow(dead_code)]
mod build;
mod invariance;
mod recognise;
mod regions;

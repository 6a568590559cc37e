//! Integration tests of this crate: one program, which is linked once and whose tests share both cores.

mod clearance;
mod measure;
mod section;
mod shared_parts;
mod support;

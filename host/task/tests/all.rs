//! Integration tests of this crate: one program, which is linked once and whose tests share both cores.

mod clearance;
mod freedoms;
mod insertion;
mod joined;
mod ports;
mod sequences;
mod support;
mod wishes;

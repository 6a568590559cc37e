//! Integration tests of this package: one program, which is linked once.

mod clearance;
mod freedoms;
mod insertion;
mod joined;
mod ports;
mod sequences;
mod support;
mod wishes;

//! Integration tests of this crate: one program, which is linked once and whose tests share both cores.

mod cli;
mod contacts;
mod methods;
mod planned;
mod probe;
mod probe_brute_force;

//! Integration tests of this package: one program, which is linked once.

mod cli;
mod contacts;
mod methods;
mod planned;
mod probe;
mod probe_brute_force;

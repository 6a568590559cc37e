//! Integration tests of this crate: one program, which is linked once and whose tests share both cores.

mod external;
mod pair;
mod shared;
mod support;
mod synthetic;

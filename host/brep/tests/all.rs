//! Integration tests of this package: one program, which is linked once.

mod external;
mod pair;
mod shared;
mod support;
mod synthetic;

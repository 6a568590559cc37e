//! Integration tests of this package: one program, which is linked once.

mod clearance;
mod measure;
mod section;
mod shared_parts;
mod support;

//! Random pairs of solids that fit, as STEP texts: material for tests and experiments, with the designed pose as the truth.
//!
//! Units: millimetres and radians.

mod pairs;
mod step;

pub use pairs::{Designed, Free, KINDS};

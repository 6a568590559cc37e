//! Random pairs of solids that fit, as STEP texts: material for tests and experiments, with the designed pose as the truth; and the writer of such texts.
//!
//! Units: millimetres and radians.

mod pairs;
pub mod step;

pub use pairs::{Designed, Free, KINDS};

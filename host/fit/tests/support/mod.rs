//! Common code of the tests: random pairs of parts that fit, as STEP files.

pub mod pairs;
pub mod step;

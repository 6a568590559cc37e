//! Tests of several modules together.

mod rounding;
mod stored;

//! Tests of several modules together.

mod overlap;

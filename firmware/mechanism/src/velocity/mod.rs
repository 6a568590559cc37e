//! Velocity of an axis from its encoder's counts.

pub mod adaptive_window;
pub mod low_pass;

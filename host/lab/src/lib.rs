//! Experiments: scenarios that any rig can run, and the figures the product is measured by.
//!
//! A [`scenario`] is data (TOML): a STEP file, a part to grab, what the simulated hand does, and what must hold. [`scenario::run`] bakes,
//! uploads, plays it on a rig in lockstep, and measures; `mortise demo --headless`, the hardware-in-the-loop tests and [`figures::figures`] are all
//! this one function. [`figures::figures`] measures every row of a named table.
//! [`probe`] asks a scene for gap and contacts at given poses.

pub mod corpus;
mod error;
pub mod figures;
pub mod probe;
pub mod scenario;

pub use error::LabError;

//! Experiments: scenarios that any rig can run, and the figures the product is measured by.
//!
//! A [`scenario`] is data (TOML): a STEP file, a part to grab, what the simulated hand does, and what must hold. [`scenario::run`] bakes,
//! uploads, plays it on a rig in lockstep, and measures; `mortise demo --headless`, the hardware-in-the-loop tests and [`figures::figures`] are all
//! this one function. [`figures::figures`] measures every row of a named table.
//! [`clearance`] finds the smallest clearance that assembles, [`pareto`] holds accuracy against cost; [`chart`] and [`table`] write what sweeps find.
//! [`rate`] and [`blend`] show an insertion tick by tick, the thesis' figures or method beside ours; [`study`] repeats its chapter 7.
//! [`stability`] closes loops on one axis and finds where they become unstable.
//! [`probe`] asks a scene for gap and contacts at given poses.

pub mod blend;
pub mod chart;
pub mod clearance;
pub mod contacts;
pub mod corpus;
pub mod endurance;
mod error;
mod exact_fit;
pub mod figures;
pub mod fit;
mod guided;
pub mod hybrid;
pub mod motion;
pub mod pareto;
pub mod peer;
mod port;
pub mod probe;
pub mod rate;
pub mod scenario;
pub mod scene_p;
pub mod stability;
pub mod study;
pub mod table;
pub mod variant;

pub use error::LabError;
pub use mortise_guide as guide;

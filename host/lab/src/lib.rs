//! Experiments: the figures by which the product is measured, sweeps and studies. Scenarios and probes come from `mortise-scenario`.
//!
//! [`figures::figures`] measures every row of a named table. An [`experiment`] has a name and a full and a quick form, and its run finds rows and
//! charts; [`experiments::ALL`] lists all experiments. [`clearance`] finds the smallest clearance that assembles, [`pareto`] compares accuracy with
//! cost; [`chart`] and [`table`] write the results of sweeps. [`rate`] and [`blend`] show an insertion tick by tick, beside the thesis' figures or
//! method; [`study`] repeats its chapter 7. [`costs`] measures the board's cost table. [`stability`] closes loops on one axis and finds where they become unstable.

pub mod blend;
pub mod chart;
pub mod clearance;
mod contact_law;
pub mod contacts;
mod convex;
pub mod corpus;
pub mod costs;
mod crossing_law;
mod driven;
pub mod endurance;
pub mod energy;
mod error;
mod exact_fit;
pub mod experiment;
pub mod experiments;
pub mod figures;
pub mod fit;
mod followed;
mod generated;
mod guided;
pub mod helps;
pub mod hybrid;
mod least_distance;
pub mod motion;
mod parallel;
pub mod pareto;
pub mod peer;
pub mod peers;
pub mod rate;
mod row;
pub mod scene_p;
mod separation;
pub mod span;
pub mod stability;
mod step_text;
pub mod study;
pub mod table;
#[cfg(test)]
mod tests;
pub mod variant;

pub use error::LabError;

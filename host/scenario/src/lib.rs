//! Scenarios: a scene, an operator model, and bounds, as data that any rig plays; and probing of a scene at given poses.
//!
//! A [`Scenario`] is TOML: a STEP file, a part to grab, the motion of the simulated hand, and the bounds. [`run`] bakes, uploads, plays it on a rig
//! in lockstep, and measures; `mortise demo --headless`, the hardware-in-the-loop tests and the experiments of `mortise-lab` all use this one
//! function. [`probe`] finds gap and contacts of a scene at given poses, [`sweep`] the first touch along a motion. [`measure`], [`port`] and [`wire`] serve the computation of figures.

mod error;
mod group;
mod hand;
mod hand_way;
pub mod insertions;
pub mod measure;
mod outcome;
pub mod overlap;
pub mod port;
pub mod probe;
mod report;
mod run;
pub mod sample;
mod scenario;
mod scene;
pub mod sweep;
#[cfg(test)]
mod tests;
mod truth;
pub mod wire;

pub use error::ScenarioError;
pub use measure::Felt;
pub use outcome::{Bounds, Outcome, QUANTITIES, Quantity, Verdict, three_digits};
pub use report::report;
pub use run::{Listener, Recording, connect, connect_with_scene, record, run, run_on};
pub use scenario::{Depth, Hand, Integrator, Key, Press, Run, Scenario, Scene, Shell};
pub use scene::{Body, ClosedForm, PreparedScene};

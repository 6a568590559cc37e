//! Scenarios: a scene, a hand that moves in it, and what must hold, as data that any rig plays; and a scene's answers at given poses.
//!
//! A [`Scenario`] is TOML: a STEP file, a part to grab, what the simulated hand does, and what must hold. [`run`] bakes, uploads, plays it on a
//! rig in lockstep, and measures; `mortise demo --headless`, the hardware-in-the-loop tests and the experiments of `mortise-lab` are all this one
//! function. [`probe`] finds gap and contacts of a scene at given poses. [`measure`], [`port`] and [`wire`] are what figures are made with.

mod error;
mod hand;
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

//! The force law: a pure function of state, scene, settings and inputs.
//!
//! [`tick()`] is called at 1 kHz. It pulls the grabbed part (the *object*) towards the handle through a virtual coupling, finds where the object
//! meets the other parts (points of one in the signed distance field of the other, in both directions), moves the object by one implicit step, and
//! returns the wrench for the handle. No I/O, no allocation, no clock. The same source runs on a PC and on a Cortex-M7 and gives the same bits:
//! single precision only, `libm` instead of the standard library, no fused multiply-add, one order of summation. Only the probe, which no tick calls, measures in double
//! precision.
//!
//! | module | what |
//! |---|---|
//! | `tick`, `contact_step` | order of the calculations in a tick; contact search and solve |
//! | `settings`, `io`, `state`, `hand` | settings; inputs and outputs of a tick; state kept from tick to tick |
//! | `math` | rigid motions, 6×6 solver, vectors and scalars |
//! | `motion` | speed of the object's points within a tick |
//! | `collision` | contact search: sphere trees against distance fields, advancement bounds, decimation, contact store, face pairs |
//! | `constraints` | constraint targets: alignment errors, engagement, saturating springs, contact exclusions |
//! | `dynamics` | virtual coupling, mass properties, force terms, implicit step with contacts, force limits |
//! | `passivity` | energy tank of the coupling, and the energy bound on what targets deliver to the operator |
//! | `baseline` | the textbook's methods for comparison: voxmap contact, explicit Newton–Euler step |
//! | `observer` | energy delivered to the operator beyond what the operator supplied, observed from outside: for measurement, not for the tick |
//! | `probe` | gap and contacts at one pose, first touch along a motion: for measurement, not for the tick |
//!
//! Symbols are those of `docs/notation.md`.
#![no_std]
#![forbid(unsafe_code)]

mod baseline;
mod collision;
mod constraints;
mod contact_step;
mod dynamics;
mod hand;
mod io;
mod math;
mod motion;
pub mod observer;
mod passivity;
mod probe;
mod settings;
mod settings_group;
mod state;
mod tick;

pub use collision::cost;
pub use collision::edge_crossing::LEAST_SINE as LEAST_CROSSING_SINE;
pub use collision::exact_surface::{Rendered, rendered_distance};
pub use collision::patch::{SIDE_M, distance_to_patch};
pub use constraints::targets::TargetError;
pub use glam::{Quat, Vec3};
pub use io::{FacePair, FacePairs, Flags, GuidanceState, Input, Output, Work};
pub use math::pose::{Pose, Twist, Wrench};
pub use math::rotation;
pub use mortise_protocol::parameter::ParameterId;
pub use passivity::tank::Passivity;
pub use probe::nearest::{Measure, Nearest};
pub use probe::prober::{ContactPoint, Probe, ProbeError, Prober};
pub use probe::sweep::{Course, Motion, Sweep};
pub use settings::{
    ContactSettings, CouplingSettings, FrictionSettings, GuidanceMethod, GuidanceSettings, Integrator,
    LimitSettings, ObjectSettings, PassivitySettings, Settings,
};
pub use settings_group::{FromParameter, Range, SettingsError, each_parameter_drives_one_setting};
pub use state::{GrabError, PlaceError, State};
pub use tick::tick;

//! The force law: a pure function of state, scene, settings and inputs.
//!
//! [`tick()`] is called at 1 kHz. It pulls the grabbed part (the *object*) towards the handle through a virtual coupling, finds where the
//! object meets the other parts (points of one in the signed-distance field of the other, both ways), moves the object by one implicit
//! step, and gives the wrench the handle must feel. No I/O, no allocation, no clock; the same source runs on a PC and on a
//! Cortex-M7 and gives the same bits: single precision only, `libm` instead of the standard library, no fused multiply-add, one
//! order of summation.
//!
//! | module | what |
//! |---|---|
//! | `pose`, `rotation` | rigid motions, between rotation vectors and quaternions |
//! | `settings`, `io`, `state` | what a tick reads, returns and remembers |
//! | `coupling` | virtual coupling between handle and object |
//! | `proximity`, `leaf`, `job`, `contact` | sphere tree against field; bounded store of contacts |
//! | `coherence`, `above`, `walls` | what is not due yet; which leaves have one face before them |
//! | `overload` | what is left out when there is too much to look at |
//! | `occupancy` | the same with a voxmap in place of the field: the textbook method, to be compared with |
//! | `step`, `linear`, `body` | implicit step with contacts; 6×6 solver; mass properties |
//! | `explicit` | Newton–Euler step, the textbook's, to be compared with |
//! | `guidance`, `constraint`, `pull` | constraint targets: in force, engaged; errors and their rows; how they pull in a step |
//! | `exclusion` | what an engaged target keeps apart leaves the work |
//! | `counted` | work on a motion that is told in an encoder's counts |
//! | `passivity` | observer of the energy the coupling makes, and the valve that stops it |
//! | `grip` | energy account of the handle while targets pull: what they would give that the hand never brought slips or is not passed on |
//! | `limits`, `touching` | force limits; touching face pairs |
//! | `tick` | the order in which all this happens |
//! | `observer` | energy that the hand was given and nobody credit_j, seen from outside: for measuring, not for the tick |
//! | `probe`, `nearest`, `analytic` | gap and contacts at one pose, without motion: for measuring, not for the tick |
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
mod state;
mod tick;

pub use collision::cost;
pub use constraints::targets::TargetError;
pub use glam::{Quat, Vec3};
pub use io::{FacePair, FacePairs, Flags, GuidanceState, Input, Output, Work};
pub use math::pose::{Pose, Twist, Wrench};
pub use math::rotation;
pub use passivity::tank::Passivity;
pub use probe::nearest::Nearest;
pub use probe::prober::{ContactPoint, Probe, ProbeError, Prober};
pub use settings::{
    ContactSettings, CouplingSettings, FrictionSettings, GuidanceMethod, GuidanceSettings, Integrator,
    LimitSettings, ObjectSettings, PassivitySettings, Range, Settings, SettingsError, ranges,
};
pub use state::{GrabError, State};
pub use tick::tick;

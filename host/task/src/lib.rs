//! Assembly by task: where parts can be connected, what connects them, how they move, and in which order they come apart and go together, with every
//! clearance in micrometres.
//!
//! 1. [`Assembly`] prepares a [`CadModel`](mortise_brep::CadModel): samples of each part under a tree ([`Body`]), and contacts.
//! 2. Queries on exact surfaces: the least distance of placed parts ([`gap`], [`refined`]), how far a motion goes ([`free_share`]), and the least distance over a
//!    motion ([`least_over`]).
//! 3. [`ports`]: places for connections, with [`profile`]s of any form; [`mod@graph`]: the connection graph, from contacts and [`fits`]; [`taxonomy`]: kinds of both;
//!    [`catalogue`]: what the file cannot say.
//! 4. [`mobility`]: freedoms by contact cones ([`mod@cone`]), confirmed over finite steps.
//! 5. [`removal`]: ways out of one or several legs, and proofs that there is none ([`Proof`]); [`blocking`] and [`sequence`]: whole sequences with subassemblies;
//!    [`insertion`]: their steps that a hand can do.
//! 6. [`report`]: results as values for JSON.
//!
//! Lengths are mm, angles radians, poses from part to assembly. Nothing here reads files, and results depend on no random numbers but those of fixed seeds; where
//! a time limit ends a search, how far it came depends on the computer.

mod assembly;
pub mod blocking;
mod body;
pub mod catalogue;
mod clearance;
pub mod cone;
mod deadline;
pub mod directions;
mod disc;
mod error;
mod explore;
pub mod fits;
pub mod graph;
mod helix;
mod hints;
pub mod insertion;
pub mod joined;
mod kept;
mod leg;
mod line;
mod linking;
pub mod mobility;
mod motion;
mod opening;
mod passage;
pub mod ports;
pub mod profile;
mod proof;
mod race;
pub mod removal;
pub mod report;
mod search;
pub mod sequence;
mod shorten;
mod skeleton;
mod stated;
mod support;
pub mod taxonomy;
mod threads;
mod walk;
mod way;
mod wishes;
mod work;

pub use assembly::{ALLOWED_MM, Assembly, Clearance, Moved, SEARCH_STEP_MM};
pub use body::{Body, SAMPLE_ERROR_MM, Sample};
pub use clearance::{Gap, Limits, Placed, free_share, gap, least_over, refined};
pub use deadline::Deadline;
pub use error::TaskError;
pub use motion::Motion;
pub use proof::Proof;
pub use wishes::Wishes;

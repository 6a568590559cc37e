//! The program's state without its presentation: the open document, the connected rig, the board's reports. Needs no window.
//!
//! The window draws a [`Session`] and passes [`Intent`]s to it; threads beside it ([`work`], [`link`]) send messages that [`Session::poll`]
//! takes in. [`intent::obstacle`] alone decides which intents are possible.

mod act;
mod advance;
pub mod ask;
mod barrier;
pub mod clearances;
pub mod document;
pub mod finding;
pub mod fits;
pub mod fitting;
pub mod flashing;
mod following;
mod forwarding;
pub mod guidance;
pub mod history;
pub mod insertion;
mod instruct;
pub mod instructions;
pub mod intent;
mod introduction;
mod keeper;
mod keeping;
pub mod link;
pub mod moves;
mod moving;
pub mod notes;
pub mod outbox;
mod perform;
mod place;
mod placed_scene;
mod placing;
mod playback;
pub mod pose;
pub mod project;
mod project_file;
pub mod purpose;
pub mod readings;
mod record;
pub mod recording;
pub mod remaining;
pub mod rig_page;
pub mod run;
mod saved;
pub mod sequence;
pub mod sequencing;
mod set_up;
mod state;
pub mod steps;
mod taking_apart;
pub mod tap;
pub mod threads;
pub mod touch;
mod tour;
pub mod tree;
mod tuning;
mod update;
pub mod verdict;
mod visibility;
mod ways;
pub mod work;
mod write_firmware;

pub use self::intent::{Intent, obstacle};
pub use self::state::{GUIDE_CAP_N, Job, Lost, Session};

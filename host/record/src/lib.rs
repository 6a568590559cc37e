//! Recordings of sessions with a rig, in files that other programs open (MCAP, `docs/recording.md`).
//!
//! [`Recorder`] writes every message that crosses the link, and the inputs of every tick, while a session goes on. [`Recording`] reads such a file,
//! also one whose program was killed. [`replay()`] computes it again: the recorded readings pass through the board's own control plane in a
//! simulation, which must arrive at the same bits, and the first tick that does not is named.

mod columns;
mod error;
mod file;
mod reading;
mod recorder;
mod records;
mod replay;
mod schema;

pub use columns::{Ticks, decode, encode};
pub use error::RecordError;
pub use reading::{Entry, EntryKind, Recording};
pub use recorder::{Recorder, Written};
pub use replay::{Difference, Replayed, replay, replay_with};

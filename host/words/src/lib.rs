//! Assembly by plain words: an instruction in, acts and moved parts out.
//!
//! 1. [`token`]: words, numbers and part names; misspelt words corrected.
//! 2. [`grammar`]: verb, noun phrases, places, amounts, to [`phrase::Command`].
//! 3. [`mod@reference`]: noun phrases to parts; what is ambiguous becomes a question.
//! 4. [`mod@connect`], [`mod@disconnect`], [`mod@adjust`]: the operations of Jung, "Task-Level Assembly Modeling in Virtual Environments"
//!    (2003), figs. 5 and 8, on exact geometry by [`mortise_task`].
//! 5. [`session`]: one turn after another, with undo and redo.
//!
//! Nothing here reads or writes files. Lengths are in millimetres in the assembly's frame, angles in radians unless a name says degrees.

pub mod adjust;
mod clause;
pub mod connect;
pub mod disconnect;
pub mod flange;
mod flange_seats;
pub mod grammar;
pub mod lexicon;
pub mod manner;
pub mod matching;
mod noun;
pub mod phrase;
pub mod plane_port;
mod plane_seats;
pub mod port;
pub mod reference;
pub mod session;
pub mod token;
pub mod turn;
mod verbs;
mod word;
pub mod world;

pub use session::Session;
pub use turn::{Act, Code, Moved, Outcome, Pose, Reason, Turn, Verb};

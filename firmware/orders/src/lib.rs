//! A model checker for the order of messages: the real control and link planes, led through every order of a few events.
//!
//! The events are those that decide whether motors are driven: greetings of two hosts, orders that arrive, are lost, late or repeated, STOP, damage
//! in flash, a lost reference, the stop input, a full line, and the runs of either plane ([`Event`]). After each event the promises of
//! `docs/safety.md` are looked at ([`Broken`]), by an account of what was sent that shares nothing with the planes. Worlds that go on alike are
//! taken once: their fingerprint is what in both planes decides what they do, the relation of every frame to the session, and what waits in the
//! queues.
//!
//! ```
//! let report = mortise_orders::enumerate(2);
//! assert!(report.broken.is_empty(), "{report}");
//! ```

mod board;
mod event;
mod oracle;
mod search;
mod world;

pub use event::{ALPHABET, Event, Host, Order, TOPICS, Topic};
pub use oracle::{Broken, PROMISES};
pub use search::{Report, enumerate, enumerate_of, enumerate_topics};

//! A model checker for the order of messages: it runs the real control and link planes through every sequence of a few events.
//!
//! The events are those that decide whether motors are driven: greetings of two hosts, orders that arrive, are lost, late or repeated, STOP,
//! disarming, release, damage in flash, a lost reference, the stop input, a full line, and the runs of either plane ([`Event`]). After each event the promises of
//! `docs/safety.md` are checked ([`Broken`]) against a separate record of the sent messages and of the bytes in flash that shares no code with the planes. Equivalent worlds
//! are explored once: their fingerprint covers the state of both planes that determines their behaviour, the relation of every frame to the session,
//! and the content of the queues.
//!
//! ```
//! let report = mortise_orders::enumerate(2);
//! assert!(report.broken.is_empty(), "{report}");
//! ```

mod board;
mod event;
mod oracle;
mod planes;
mod search;
mod world;

pub use event::{ALPHABET, Event, Host, Order, TOPICS, Topic};
pub use oracle::{Broken, PROMISES};
pub use search::{Report, compare_equals, enumerate, enumerate_of, enumerate_topics};

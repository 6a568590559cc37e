//! Samples of the loop over the last minutes, and the views of them: signals, envelopes for drawing, tables for export.

mod distribution;
mod envelope;
mod sample;
mod signal;
mod store;
mod table;

pub use self::distribution::{Distribution, distribution};
pub use self::envelope::{Line, envelope};
pub use self::sample::Sample;
pub use self::signal::{Quantity, SIGNALS, Signal};
pub use self::store::{History, MAX_CHUNKS, MAX_SAMPLES, OVERRUN_SPAN_S, RESOLVED_HOLE_S};
pub use self::table::csv;

//! Observation of all messages of a link, for a recording.

use mortise_protocol::message::{FromDevice, ToDevice};

/// Receives every message of a link in order, on the thread that sends or reads it: it must not block.
pub trait Observer: Send + Sync {
    /// A message is about to be written to the board, with this sequence number.
    fn sent(&self, sequence: u16, message: &ToDevice);

    /// A message has been read from the board, with the board's sequence number.
    fn received(&self, sequence: u16, message: &FromDevice);
}
